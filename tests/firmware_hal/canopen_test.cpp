// CANopen and CiA 402 codecs against the standards' tables, and the state machine exhaustively.
#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "firmware_hal/codec/cia402.hpp"
#include "tests/firmware_hal/golden_file.hpp"

namespace clamber {
namespace {

using Row = std::vector<std::string>;

unsigned long hex(const std::string& text) { return std::stoul(text, nullptr, 16); }
CanFrame frame_of(const Row& row) {
  return make_frame(static_cast<std::uint32_t>(hex(row[1])), test::bytes_of(row[2]));
}
std::vector<Row> rows(const std::string& service) {
  std::vector<Row> found;
  for (const Row& row : test::golden_lines("canopen.txt"))
    if (row[0] == service) found.push_back(row);
  EXPECT_FALSE(found.empty()) << service;
  return found;
}

TEST(Canopen, NetworkManagement) {
  const std::map<std::string, NmtCommand> kCommands{
      {"start", NmtCommand::kStart},
      {"stop", NmtCommand::kStop},
      {"pre_operational", NmtCommand::kPreOperational},
      {"reset_node", NmtCommand::kResetNode},
      {"reset_communication", NmtCommand::kResetCommunication}};
  for (const Row& row : rows("nmt")) {
    NmtCommand command = NmtCommand::kStop;
    std::uint8_t node = 255;
    ASSERT_EQ(decode_nmt(frame_of(row), command, node), CodecStatus::kOk);
    EXPECT_EQ(command, kCommands.at(row[3]));
    EXPECT_EQ(node, std::stoi(row[4]));
    EXPECT_EQ(encode_nmt(command, node), frame_of(row));
  }
}

TEST(Canopen, HeartbeatAndSync) {
  for (const Row& row : rows("heartbeat")) {
    NmtState state = NmtState::kStopped;
    std::uint8_t node = 0;
    ASSERT_EQ(decode_heartbeat(frame_of(row), node, state), CodecStatus::kOk);
    EXPECT_EQ(node, std::stoi(row[3]));
    EXPECT_EQ(static_cast<int>(state), std::stoi(row[4]));
    EXPECT_EQ(encode_heartbeat(node, state), frame_of(row));
  }
  EXPECT_EQ(encode_sync(), make_frame(0x80, {}));
}

TEST(Canopen, Emergency) {
  for (const Row& row : rows("emergency")) {
    struct Emergency emergency;
    ASSERT_EQ(decode_emergency(frame_of(row), emergency), CodecStatus::kOk);
    EXPECT_EQ(emergency.node, std::stoi(row[3]));
    EXPECT_EQ(emergency.code, hex(row[4]));
    EXPECT_EQ(emergency.error_register, hex(row[5]));
    EXPECT_EQ(encode_emergency(emergency), frame_of(row));
  }
}

TEST(Canopen, Sdo) {
  const std::map<std::string, SdoKind> kKinds{{"download", SdoKind::kDownload},
                                              {"upload", SdoKind::kUpload},
                                              {"download_reply", SdoKind::kDownloadReply},
                                              {"upload_reply", SdoKind::kUploadReply},
                                              {"abort", SdoKind::kAbort}};
  for (const Row& row : rows("sdo")) {
    struct Sdo sdo;
    bool request = false;
    ASSERT_EQ(decode_sdo(frame_of(row), sdo, request), CodecStatus::kOk) << row[2];
    EXPECT_EQ(request, row[3] == "request");
    EXPECT_EQ(sdo.kind, kKinds.at(row[4]));
    EXPECT_EQ(sdo.node, std::stoi(row[5]));
    EXPECT_EQ(sdo.index, hex(row[6]));
    EXPECT_EQ(sdo.sub, hex(row[7]));
    EXPECT_EQ(sdo.size, std::stoi(row[8]));
    EXPECT_EQ(sdo.value, hex(row[9]));
    EXPECT_EQ(encode_sdo(sdo, request), frame_of(row));
  }
}

/// Segmented and block transfers, and bits that the standard keeps at zero.
TEST(Canopen, SdoCommandsThatAreNotExpeditedAreRefused) {
  int accepted = 0;
  for (int command = 0; command < 256; ++command) {
    for (const std::uint32_t id : {0x601u, 0x581u}) {
      const std::array<std::uint8_t, 8> bytes{static_cast<std::uint8_t>(command)};
      struct Sdo sdo;
      bool request = false;
      accepted += decode_sdo(make_frame(id, bytes), sdo, request) == CodecStatus::kOk ? 1 : 0;
    }
  }
  // download 22 23 27 2B 2F, upload 40, abort 80; replies 42 43 47 4B 4F, 60, 80
  EXPECT_EQ(accepted, 7 + 7);
}

TEST(Canopen, WrongLengthIsNeverTakenForAService) {
  for (std::uint32_t id = 0; id <= kMaxStandardId; ++id) {
    for (std::size_t length = 0; length <= 8; ++length) {
      const std::vector<std::uint8_t> bytes(length, 0x01);
      CanopenId what;
      if (classify_canopen(make_frame(id, bytes), what) != CodecStatus::kOk) continue;
      switch (what.kind) {
        case CanopenKind::kNmt:
          EXPECT_EQ(length, 2u);
          EXPECT_EQ(id, 0u);
          break;
        case CanopenKind::kHeartbeat:
          EXPECT_EQ(length, 1u);
          break;
        case CanopenKind::kSync:
          EXPECT_LE(length, 1u);
          break;
        case CanopenKind::kTpdo:
        case CanopenKind::kRpdo:
          EXPECT_GE(what.pdo, 1);
          EXPECT_LE(what.pdo, 4);
          break;
        default:
          EXPECT_EQ(length, 8u);
      }
      if (what.kind != CanopenKind::kNmt && what.kind != CanopenKind::kSync) {
        EXPECT_EQ(what.node, id & 0x7F);
      }
    }
  }
  CanFrame fd = encode_sync();
  fd.fd = true;
  CanopenId what;
  EXPECT_EQ(classify_canopen(fd, what), CodecStatus::kBadFormat);
}

// ---- CiA 402

Cia402Drive drive(Cia402Mode mode) { return {41, mode, 1000.0, 0.02, 20.0}; }

TEST(Cia402, ProcessData) {
  for (const auto& [name, mode] : {std::pair{"cst", Cia402Mode::kCyclicTorque},
                                   std::pair{"csp", Cia402Mode::kCyclicPosition}}) {
    for (const Row& row : rows(name)) {
      Cia402Command command;
      ASSERT_EQ(decode_cia402_command(drive(mode), frame_of(row), command), CodecStatus::kOk);
      EXPECT_EQ(command.controlword, hex(row[3]));
      EXPECT_NEAR(command.q, std::stod(row[4]), 1e-12);
      EXPECT_NEAR(command.tau, std::stod(row[5]), 1e-12);
      CanFrame frame;
      ASSERT_EQ(encode_cia402_command(drive(mode), command, frame), CodecStatus::kOk);
      EXPECT_EQ(frame, frame_of(row));
    }
  }
  for (const Row& row : rows("tpdo")) {
    Cia402Reply reply;
    const Cia402Drive d = drive(Cia402Mode::kCyclicTorque);
    ASSERT_EQ(decode_cia402_reply(d, frame_of(row), reply), CodecStatus::kOk);
    EXPECT_EQ(reply.statusword, hex(row[3]));
    EXPECT_NEAR(reply.q, std::stod(row[4]), 1e-12);
    EXPECT_NEAR(reply.tau, std::stod(row[5]), 1e-12);
    EXPECT_EQ(state_of(reply.statusword),
              row[6] == "fault" ? Cia402State::kFault : Cia402State::kEnabled);
    EXPECT_EQ(encode_cia402_reply(d, reply), frame_of(row));
  }
}

TEST(Cia402, TorqueIsClampedAndNumbersAreRequired) {
  CanFrame frame;
  const Cia402Drive torque = drive(Cia402Mode::kCyclicTorque);
  EXPECT_EQ(encode_cia402_command(torque, {0, 0, 25}, frame), CodecStatus::kClamped);
  Cia402Command back;
  ASSERT_EQ(decode_cia402_command(torque, frame, back), CodecStatus::kOk);
  EXPECT_NEAR(back.tau, 20.0, 1e-12);
  const CanFrame before = frame;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(encode_cia402_command(torque, {0, 0, kNan}, frame), CodecStatus::kNotFinite);
  EXPECT_EQ(encode_cia402_command(drive(Cia402Mode::kCyclicPosition), {0, kNan, 0}, frame),
            CodecStatus::kNotFinite);
  EXPECT_EQ(frame, before);
  EXPECT_EQ(encode_cia402_command(drive(Cia402Mode::kCyclicPosition), {0, 1e9, 0}, frame),
            CodecStatus::kClamped);
}

/// Statuswords of CiA 402-2 table 30, with the bits that they leave open set both ways.
TEST(Cia402, StatuswordsDecode) {
  struct Case {
    std::uint16_t mask, value;
    Cia402State state;
  };
  for (const Case& c :
       {Case{0x4F, 0x00, Cia402State::kNotReady}, Case{0x4F, 0x40, Cia402State::kSwitchOnDisabled},
        Case{0x6F, 0x21, Cia402State::kReady}, Case{0x6F, 0x23, Cia402State::kSwitchedOn},
        Case{0x6F, 0x27, Cia402State::kEnabled}, Case{0x6F, 0x07, Cia402State::kQuickStop},
        Case{0x4F, 0x0F, Cia402State::kFaultReaction}, Case{0x4F, 0x08, Cia402State::kFault}}) {
    for (std::uint32_t word = 0; word <= 0xFFFF; ++word)
      if ((word & c.mask) == c.value) {
        ASSERT_EQ(state_of(static_cast<std::uint16_t>(word)), c.state) << word;
      }
    EXPECT_EQ(state_of(statusword_of(c.state)), c.state);
  }
}

constexpr std::array kStates{Cia402State::kNotReady,      Cia402State::kSwitchOnDisabled,
                             Cia402State::kReady,         Cia402State::kSwitchedOn,
                             Cia402State::kEnabled,       Cia402State::kQuickStop,
                             Cia402State::kFaultReaction, Cia402State::kFault};

/// Every state times every pair of controlword bits that matter.
TEST(Cia402, OnlyEnableOperationEnables) {
  for (const Cia402State state : kStates) {
    for (std::uint16_t before = 0; before < 256; ++before) {
      for (std::uint16_t word = 0; word < 256; ++word) {
        const Cia402State next = next_state(state, before, word);
        if (next == Cia402State::kEnabled && state != Cia402State::kEnabled) {
          ASSERT_EQ(word & 0x8F, 0x0F);
          ASSERT_TRUE(state == Cia402State::kSwitchedOn || state == Cia402State::kQuickStop);
        }
        if (state == Cia402State::kFault && next != state) {
          ASSERT_EQ(next, Cia402State::kSwitchOnDisabled);
          ASSERT_TRUE((word & 0x80) != 0 && (before & 0x80) == 0);
        }
        if (state == Cia402State::kEnabled && (word & 0x82) == 0) {
          ASSERT_EQ(next, Cia402State::kSwitchOnDisabled);
        }
        if (state == Cia402State::kFaultReaction) {
          ASSERT_EQ(next, state);
        }
      }
    }
  }
}

/// Transitions 2 to 12 as in CiA 402-2 figure 2.
TEST(Cia402, Transitions) {
  using S = Cia402State;
  const auto go = [](S from, std::uint16_t word) { return next_state(from, 0, word); };
  EXPECT_EQ(go(S::kSwitchOnDisabled, kControlShutdown), S::kReady);               // 2
  EXPECT_EQ(go(S::kReady, kControlSwitchOn), S::kSwitchedOn);                     // 3
  EXPECT_EQ(go(S::kSwitchedOn, kControlEnable), S::kEnabled);                     // 4
  EXPECT_EQ(go(S::kEnabled, kControlSwitchOn), S::kSwitchedOn);                   // 5
  EXPECT_EQ(go(S::kSwitchedOn, kControlShutdown), S::kReady);                     // 6
  EXPECT_EQ(go(S::kReady, kControlDisableVoltage), S::kSwitchOnDisabled);         // 7
  EXPECT_EQ(go(S::kReady, kControlQuickStop), S::kSwitchOnDisabled);              // 7
  EXPECT_EQ(go(S::kEnabled, kControlShutdown), S::kReady);                        // 8
  EXPECT_EQ(go(S::kEnabled, kControlDisableVoltage), S::kSwitchOnDisabled);       // 9
  EXPECT_EQ(go(S::kSwitchedOn, kControlDisableVoltage), S::kSwitchOnDisabled);    // 10
  EXPECT_EQ(go(S::kEnabled, kControlQuickStop), S::kQuickStop);                   // 11
  EXPECT_EQ(go(S::kQuickStop, kControlDisableVoltage), S::kSwitchOnDisabled);     // 12
  EXPECT_EQ(next_state(S::kFault, 0, kControlFaultReset), S::kSwitchOnDisabled);  // 15
  EXPECT_EQ(next_state(S::kFault, kControlFaultReset, kControlFaultReset), S::kFault);
}

/// The host's controlwords lead from everywhere to enabled, except out of a fault.
TEST(Cia402, HostReachesEnabledFromEverywhereButFaults) {
  for (const Cia402State start : kStates) {
    Cia402State state = start;
    std::uint16_t before = 0;
    for (int i = 0; i < 10; ++i) {
      const std::uint16_t word = controlword_towards_enabled(state);
      state = next_state(state, before, word);
      before = word;
    }
    const bool stuck = start == Cia402State::kNotReady || start == Cia402State::kFaultReaction ||
                       start == Cia402State::kFault;
    EXPECT_EQ(state == Cia402State::kEnabled, !stuck) << to_string(start);
  }
}

TEST(Cia402, EnablingFramesAreRecognised) {
  const std::array<std::uint8_t, 2> enable{0x0F, 0x00};
  const std::array<std::uint8_t, 2> switch_on{0x07, 0x00};
  EXPECT_TRUE(is_cia402_enable(make_frame(0x201, enable)));
  EXPECT_FALSE(is_cia402_enable(make_frame(0x201, switch_on)));
  EXPECT_FALSE(is_cia402_enable(make_frame(0x181, enable)));
  EXPECT_TRUE(
      is_cia402_enable(encode_sdo({SdoKind::kDownload, 1, 0x6040, 0, 2, kControlEnable}, true)));
  EXPECT_FALSE(is_cia402_enable(
      encode_sdo({SdoKind::kDownload, 1, 0x6040, 0, 2, kControlDisableVoltage}, true)));
}

}  // namespace
}  // namespace clamber
