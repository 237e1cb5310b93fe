// The MIT codec against vectors worked out by hand, and every trap of the protocol.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "firmware_hal/codec/canopen.hpp"
#include "firmware_hal/codec/mit.hpp"
#include "tests/firmware_hal/golden_file.hpp"

namespace clamber {
namespace {

constexpr double kStep16 = 25.0 / 65535;

MitDrive drive() {
  MitDrive d;
  d.id = 1;
  d.reply_id = 0x401;
  d.ranges = {.position = {-12.5, 12.5},
              .velocity = {-45, 45},
              .kp = {0, 500},
              .kd = {0, 5},
              .torque = {-18, 18},
              .reply_torque = {-18, 18},
              .voltage = {0, 80}};
  return d;
}

MitReplyKind kind_of(const std::string& name) {
  if (name == "plain") return MitReplyKind::kPlain;
  if (name == "voltage") return MitReplyKind::kVoltage;
  if (name == "temperature_error") return MitReplyKind::kTemperatureError;
  EXPECT_EQ(name, "state_nibble");
  return MitReplyKind::kStateNibble;
}

TEST(Mit, CommandsAreTheGoldenBytes) {
  int count = 0;
  for (const auto& row : test::golden_lines("mit_commands.txt")) {
    ASSERT_EQ(row.size(), 6u);
    const JointCommand command{std::stod(row[1]), std::stod(row[2]), std::stod(row[3]),
                               std::stod(row[4]), std::stod(row[5])};
    CanFrame frame;
    ASSERT_EQ(encode_mit_command(drive(), command, frame), CodecStatus::kOk);
    EXPECT_EQ(test::hex_of(frame), row[0]);
    EXPECT_EQ(frame.id, 1u);
    MitCommand back;
    ASSERT_EQ(decode_mit_command(drive(), make_frame(1, test::bytes_of(row[0])), back),
              CodecStatus::kOk);
    EXPECT_FALSE(back.special);
    EXPECT_NEAR(back.setpoint.q, command.q, 0.5 * kStep16 + 1e-12);
    EXPECT_NEAR(back.setpoint.dq, command.dq, 0.5 * 90 / 4095 + 1e-12);
    EXPECT_NEAR(back.setpoint.kp, command.kp, 0.5 * 500 / 4095 + 1e-12);
    EXPECT_NEAR(back.setpoint.kd, command.kd, 0.5 * 5.0 / 4095 + 1e-12);
    EXPECT_NEAR(back.setpoint.tau, command.tau, 0.5 * 36 / 4095 + 1e-12);
    ++count;
  }
  EXPECT_EQ(count, 6);
}

TEST(Mit, RepliesAreTheGoldenBytes) {
  int count = 0;
  for (const auto& row : test::golden_lines("mit_replies.txt")) {
    ASSERT_EQ(row.size(), 9u);
    MitDrive d = drive();
    d.reply = kind_of(row[0]);
    MitReply reply;
    ASSERT_EQ(decode_mit_reply(d, make_frame(0x401, test::bytes_of(row[1])), reply),
              CodecStatus::kOk)
        << row[1];
    EXPECT_NEAR(reply.q, std::stod(row[2]), kStep16);
    EXPECT_NEAR(reply.dq, std::stod(row[3]), 90.0 / 4095);
    EXPECT_NEAR(reply.tau, std::stod(row[4]), 36.0 / 4095);
    EXPECT_EQ(reply.temperature, std::stod(row[5]));
    EXPECT_NEAR(reply.voltage, std::stod(row[6]), 0.01);
    EXPECT_EQ(reply.error, std::stoi(row[7]));
    EXPECT_EQ(reply.enabled, row[8] == "1");
    // Back to the same bytes; of two temperatures the hotter one is kept.
    const std::string again = test::hex_of(encode_mit_reply(d, reply));
    EXPECT_EQ(again.substr(0, 12), row[1].substr(0, 12));
    EXPECT_EQ(again.size(), row[1].size());
    ++count;
  }
  EXPECT_EQ(count, 7);
}

TEST(Mit, SpecialsAreTheGoldenBytes) {
  for (const auto& [special, hex] : {std::pair{MitSpecial::kEnable, "FFFFFFFFFFFFFFFC"},
                                     std::pair{MitSpecial::kDisable, "FFFFFFFFFFFFFFFD"},
                                     std::pair{MitSpecial::kSetZero, "FFFFFFFFFFFFFFFE"},
                                     std::pair{MitSpecial::kClearFault, "FFFFFFFFFFFFFFFB"}}) {
    const CanFrame frame = encode_mit_special(drive(), special);
    EXPECT_EQ(test::hex_of(frame), hex);
    EXPECT_EQ(is_mit_enable(frame), special == MitSpecial::kEnable);
    MitCommand back;
    ASSERT_EQ(decode_mit_command(drive(), frame, back), CodecStatus::kOk);
    EXPECT_TRUE(back.special);
    EXPECT_EQ(back.code, special);
  }
}

// ---- the traps of the protocol

/// Trap: all ends of all ranges together are the bytes of "enable" (torque FFC), "disable" (FFD)
/// and "set zero" (FFE).
TEST(MitTrap, NoSetpointIsASpecialCommand) {
  const MitDrive d = drive();
  for (int step = 0; step <= 4095; ++step) {
    const double tau = -18.0 + step * 36.0 / 4095;
    CanFrame frame;
    (void)encode_mit_command(d, {12.5, 45, 500, 5, tau}, frame);
    MitCommand back;
    ASSERT_EQ(decode_mit_command(d, frame, back), CodecStatus::kOk);
    ASSERT_FALSE(back.special) << step;
    ASSERT_NEAR(back.setpoint.kd, 5.0, 1.001 * 5 / 4095);  // what it costs
    ASSERT_NEAR(back.setpoint.tau, tau, 1e-9);
  }
}

TEST(MitTrap, NoCommandOfAnyBitsEnables) {
  std::mt19937_64 random(3);
  const MitDrive d = drive();
  for (int i = 0; i < 300000; ++i) {
    const auto any = [&] {
      switch (random() % 4) {
        case 0:
          return 1e300;
        case 1:
          return std::bit_cast<double>(random());
        default:
          return static_cast<double>(random() % 100000) * 0.01 - 100;
      }
    };
    CanFrame frame;
    const CodecStatus status = encode_mit_command(d, {any(), any(), any(), any(), any()}, frame);
    if (status == CodecStatus::kNotFinite) {
      ASSERT_EQ(frame, CanFrame{});
      continue;
    }
    ASSERT_TRUE(status == CodecStatus::kOk || status == CodecStatus::kClamped);
    MitCommand back;
    ASSERT_EQ(decode_mit_command(d, frame, back), CodecStatus::kOk);
    ASSERT_FALSE(back.special);
  }
}

/// Trap: the factory's reply id 0 is CANopen's network management, and is shared by all drives.
TEST(MitTrap, ReplyIdZeroIsNoNetworkCommandAndTellsDrivesApart) {
  MitDrive first = drive();
  first.reply_id = 0;
  MitDrive second = first;
  second.id = 2;
  for (const MitReplyKind kind : {MitReplyKind::kPlain, MitReplyKind::kVoltage,
                                  MitReplyKind::kTemperatureError, MitReplyKind::kStateNibble}) {
    first.reply = second.reply = kind;
    const CanFrame frame = encode_mit_reply(second, {.q = 1.0});
    MitReply reply;
    EXPECT_EQ(decode_mit_reply(first, frame, reply), CodecStatus::kForeign);
    EXPECT_EQ(decode_mit_reply(second, frame, reply), CodecStatus::kOk);
    NmtCommand command = NmtCommand::kStop;
    std::uint8_t node = 0;
    EXPECT_NE(decode_nmt(frame, command, node), CodecStatus::kOk);
  }
}

/// Trap: ranges are not on the wire. The same bytes under two firmwares' tables of one motor.
TEST(MitTrap, RangesBelongToTheFirmware) {
  MitDrive v1 = drive();
  v1.ranges.position = {-95.5, 95.5};
  MitDrive v1_1 = drive();
  const CanFrame frame = encode_mit_reply(v1, {.q = 1.0});
  MitReply reply;
  ASSERT_EQ(decode_mit_reply(v1_1, frame, reply), CodecStatus::kOk);
  EXPECT_NEAR(reply.q, 1.0 * 12.5 / 95.5, 1e-3);  // wrong, and nothing tells
  // Some firmware scales the torque of replies otherwise than that of commands.
  MitDrive sensed = drive();
  sensed.ranges.reply_torque = {-20, 20};
  ASSERT_EQ(decode_mit_reply(sensed, encode_mit_reply(sensed, {.tau = 19.0}), reply),
            CodecStatus::kOk);
  EXPECT_NEAR(reply.tau, 19.0, 0.01);
}

/// Trap: 6, 7 and 8 bytes for the same id: a reply of another firmware must not be read as ours.
TEST(MitTrap, ReplyOfAnotherLengthIsRefused) {
  for (const MitReplyKind kind :
       {MitReplyKind::kPlain, MitReplyKind::kVoltage, MitReplyKind::kTemperatureError}) {
    MitDrive d = drive();
    d.reply = kind;
    for (std::size_t length = 0; length <= 8; ++length) {
      std::vector<std::uint8_t> bytes(length, 1);
      MitReply reply;
      EXPECT_EQ(decode_mit_reply(d, make_frame(0x401, bytes), reply),
                length == mit_reply_length(kind) ? CodecStatus::kOk : CodecStatus::kBadLength);
    }
  }
}

/// Trap: FD is not automatic. Drives answer FD commands in classic frames until they are set up,
/// and without BRS the payload is as slow as before.
TEST(MitTrap, FormatIsAgreedNotGuessed) {
  MitDrive fd = drive();
  fd.format = {true, true};
  CanFrame command;
  ASSERT_EQ(encode_mit_command(fd, {}, command), CodecStatus::kOk);
  EXPECT_TRUE(command.fd);
  EXPECT_TRUE(command.brs);
  const MitDrive classic = drive();
  CanFrame no_brs = encode_mit_reply(fd, {});
  no_brs.brs = false;
  CanFrame extended = encode_mit_reply(fd, {});
  extended.extended = true;
  CanFrame remote = encode_mit_reply(classic, {});
  remote.remote = true;
  MitReply reply;
  EXPECT_EQ(decode_mit_reply(fd, encode_mit_reply(classic, {}), reply), CodecStatus::kBadFormat);
  EXPECT_EQ(decode_mit_reply(classic, encode_mit_reply(fd, {}), reply), CodecStatus::kBadFormat);
  EXPECT_EQ(decode_mit_reply(fd, no_brs, reply), CodecStatus::kBadFormat);
  MitDrive slow_fd = drive();
  slow_fd.format = {true, false};
  EXPECT_EQ(decode_mit_reply(slow_fd, no_brs, reply), CodecStatus::kOk);
  EXPECT_EQ(decode_mit_reply(slow_fd, encode_mit_reply(classic, {}), reply),
            CodecStatus::kBadFormat);
  EXPECT_EQ(decode_mit_reply(fd, extended, reply), CodecStatus::kBadFormat);
  EXPECT_EQ(decode_mit_reply(classic, remote, reply), CodecStatus::kBadFormat);
  EXPECT_EQ(decode_mit_reply(fd, encode_mit_reply(fd, {}), reply), CodecStatus::kOk);
}

TEST(Mit, ClampsAndSaysSo) {
  CanFrame frame;
  MitCommand back;
  EXPECT_EQ(encode_mit_command(drive(), {.tau = 18.01}, frame), CodecStatus::kClamped);
  ASSERT_EQ(decode_mit_command(drive(), frame, back), CodecStatus::kOk);
  EXPECT_NEAR(back.setpoint.tau, 18.0, 1e-12);
  EXPECT_EQ(encode_mit_command(drive(), {.kp = 501}, frame), CodecStatus::kClamped);
  EXPECT_EQ(encode_mit_command(drive(), {.q = -13}, frame), CodecStatus::kClamped);
}

TEST(Mit, RefusesWhatIsNoNumberAndTouchesNothing) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (int field = 0; field < 5; ++field) {
    for (const double bad : {kNan, kInf, -kInf}) {
      JointCommand command;
      (field == 0   ? command.q
       : field == 1 ? command.dq
       : field == 2 ? command.kp
       : field == 3 ? command.kd
                    : command.tau) = bad;
      CanFrame frame;
      EXPECT_EQ(encode_mit_command(drive(), command, frame), CodecStatus::kNotFinite);
      EXPECT_EQ(frame, CanFrame{});
    }
  }
}

}  // namespace
}  // namespace clamber
