// The simulated MIT drive, told what to do in bytes.
#include <gtest/gtest.h>

#include "firmware_hal/virtual_drives/bench_plant.hpp"
#include "firmware_hal/virtual_drives/mit_drive.hpp"

namespace clamber {
namespace {

constexpr double kStep = 1e-3;

MitDrive codec(MitReplyKind reply) {
  MitDrive d;
  d.id = 0x29;
  d.reply_id = 0x429;
  d.ranges = {.position = {-4, 4},
              .velocity = {-10, 10},
              .kp = {0, 500},
              .kd = {0, 5},
              .torque = {-54, 54},
              .reply_torque = {-54, 54},
              .voltage = {0, 60}};
  d.reply = reply;
  return d;
}

class MitDriveTest : public testing::TestWithParam<MitReplyKind> {
 protected:
  MitDriveTest() : drive(codec(GetParam()), 0.025, {}, kStep) {}

  MitReply send(const CanFrame& frame) {
    drive.receive(frame);
    MitReply reply;
    EXPECT_EQ(drive.outbox().frames().size(), 1u);
    if (!drive.outbox().frames().empty()) {
      EXPECT_EQ(decode_mit_reply(codec(GetParam()), drive.outbox().frames()[0], reply),
                CodecStatus::kOk);
    }
    drive.outbox().clear();
    return reply;
  }
  MitReply special(MitSpecial code) { return send(encode_mit_special(codec(GetParam()), code)); }
  MitReply command(const JointCommand& setpoint) {
    CanFrame frame;
    EXPECT_EQ(encode_mit_command(codec(GetParam()), setpoint, frame), CodecStatus::kOk);
    return send(frame);
  }
  void step(int n = 1) {
    for (int i = 0; i < n; ++i) {
      const std::array<double, 1> tau{drive.torque()};
      plant.step(tau, kStep);
      drive.sense(plant.motion(0));
      drive.pass();
    }
  }
  bool reports_state() const { return GetParam() == MitReplyKind::kStateNibble; }
  bool reports_errors() const {
    return reports_state() || GetParam() == MitReplyKind::kTemperatureError;
  }

  VirtualMitDrive drive;
  BenchPlant plant{{BenchJoint{}}};
};

TEST_P(MitDriveTest, IsLimpUntilItIsEnabled) {
  EXPECT_EQ(command({.q = 1, .kp = 100}).enabled, !reports_state());
  step(10);
  EXPECT_EQ(plant.joint(0).q, 0.0);
  special(MitSpecial::kEnable);
  EXPECT_EQ(drive.power(), DrivePower::kOn);
  step(10);
  EXPECT_GT(plant.joint(0).q, 0.0);  // with the setpoint from before: the known trap
  special(MitSpecial::kDisable);
  EXPECT_EQ(drive.power(), DrivePower::kOff);
  EXPECT_EQ(drive.torque(), 0.0);
}

TEST_P(MitDriveTest, ClosesItsLoopAtEveryStep) {
  special(MitSpecial::kEnable);
  for (int i = 0; i < 150; ++i) {  // a command every 20 steps only
    command({.q = 0.5, .dq = 0.0, .kp = 200, .kd = 5, .tau = 0});
    step(20);
  }
  EXPECT_NEAR(plant.joint(0).q, 0.5, 2e-3);
  command({.q = 4, .dq = 0, .kp = 500, .kd = 0, .tau = 0});
  EXPECT_EQ(drive.torque(), 54.0);
}

TEST_P(MitDriveTest, AnswersWithWhatItsSensorsRead) {
  plant.joint(0).q = 1.25;
  special(MitSpecial::kEnable);
  command({.tau = 20});
  step(5);
  const MitReply reply = special(MitSpecial::kDisable);
  EXPECT_NEAR(reply.q, plant.joint(0).q, 1e-4);
  EXPECT_NEAR(reply.dq, plant.joint(0).dq, 3e-3);
  EXPECT_NEAR(reply.tau, 20.0, 0.02);
  if (reports_errors()) {
    EXPECT_NEAR(reply.temperature, 25.0, 0.6);
  }
  if (GetParam() == MitReplyKind::kVoltage) {
    EXPECT_NEAR(reply.voltage, 48.0, 0.2);
  }
}

TEST_P(MitDriveTest, SilenceLongerThanItsWatchdogMakesItLimp) {
  special(MitSpecial::kEnable);
  command({.tau = 10});
  step(24);
  EXPECT_GT(drive.torque(), 9.9);
  step(1);
  EXPECT_EQ(drive.torque(), 0.0);
  EXPECT_EQ(drive.power(), DrivePower::kDropped);
  const MitReply reply = command({.tau = 10});
  if (reports_state()) {
    EXPECT_EQ(reply.error, 0xD);
    EXPECT_EQ(drive.torque(), 0.0);
    special(MitSpecial::kEnable);  // refused: the error stands
    EXPECT_EQ(drive.power(), DrivePower::kDropped);
    special(MitSpecial::kClearFault);
    special(MitSpecial::kEnable);
    EXPECT_EQ(drive.power(), DrivePower::kOn);
  } else {
    EXPECT_GT(drive.torque(), 9.9);  // bgkatz and CubeMars just go on
  }
}

TEST_P(MitDriveTest, TooHotItLetsGoAndStaysOffUntilCool) {
  special(MitSpecial::kEnable);
  drive.set_temperature(101.0);
  command({.tau = 30});
  step(2);
  EXPECT_EQ(drive.torque(), 0.0);
  const MitReply reply = special(MitSpecial::kClearFault);
  if (reports_errors()) {
    EXPECT_NE(reply.error, 0);
  }
  special(MitSpecial::kDisable);
  special(MitSpecial::kEnable);
  EXPECT_NE(drive.power(), DrivePower::kOn);
  drive.set_temperature(60.0);
  special(MitSpecial::kDisable);
  special(MitSpecial::kClearFault);
  special(MitSpecial::kEnable);
  EXPECT_EQ(drive.power(), DrivePower::kOn);
}

TEST_P(MitDriveTest, IsDeafWhileItStoresItsZero) {
  plant.joint(0).q = 0.75;
  step(1);
  drive.receive(encode_mit_special(codec(GetParam()), MitSpecial::kSetZero));
  for (int i = 0; i < 1500; ++i) {
    EXPECT_TRUE(drive.outbox().frames().empty());
    drive.receive(encode_mit_special(codec(GetParam()), MitSpecial::kDisable));
    step(1);
  }
  EXPECT_NEAR(special(MitSpecial::kDisable).q, 0.0, 1e-4);
}

TEST_P(MitDriveTest, IgnoresWhatIsNotForItOrNoCommand) {
  const std::array<std::uint8_t, 8> bytes{};
  drive.receive(make_frame(0x2A, bytes));
  drive.receive(make_frame(0x29, std::span(bytes).first(7)));
  EXPECT_TRUE(drive.outbox().frames().empty());
  EXPECT_EQ(drive.traffic().malformed, 1u);
}

TEST_P(MitDriveTest, PowerCycleForgetsAndDrops) {
  special(MitSpecial::kEnable);
  command({.tau = 10});
  drive.power_cycle(0.01);
  EXPECT_EQ(drive.torque(), 0.0);
  EXPECT_EQ(drive.power(), DrivePower::kDropped);
  step(10);
  const MitReply reply = command({.tau = 10});
  EXPECT_EQ(reply.enabled, !reports_state());
  EXPECT_EQ(drive.torque(), 0.0);
}

INSTANTIATE_TEST_SUITE_P(Replies, MitDriveTest,
                         testing::Values(MitReplyKind::kPlain, MitReplyKind::kVoltage,
                                         MitReplyKind::kTemperatureError,
                                         MitReplyKind::kStateNibble));

TEST(Winding, WarmsToItsSteadyStateAndNoFurther) {
  const WindingHeat heat;
  Winding winding(heat);
  for (int i = 0; i < 300'000; ++i) winding.pass(20.0, 1e-3);  // one time constant
  EXPECT_NEAR(winding.temperature(), 25.0 + 75.0 * (1.0 - std::exp(-1.0)), 0.05);
  for (int i = 0; i < 100; ++i) winding.pass(20.0, 100.0);
  EXPECT_NEAR(winding.temperature(), 100.0, 1e-3);
}

}  // namespace
}  // namespace clamber
