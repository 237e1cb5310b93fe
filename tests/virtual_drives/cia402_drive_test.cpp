// The simulated CANopen servo drive: against the protocol's rules, and against the project's host.
#include <gtest/gtest.h>

#include <cmath>

#include "firmware_hal/codec/cia402_host.hpp"
#include "firmware_hal/virtual_drives/bench_plant.hpp"
#include "firmware_hal/virtual_drives/cia402_drive.hpp"

namespace clamber {
namespace {

constexpr double kStep = 1e-3;
constexpr std::uint8_t kNode = 41;

class Cia402DriveTest : public testing::TestWithParam<Cia402Mode> {
 protected:
  Cia402DriveTest() : drive(codec(), motor(), {}, kStep), host(settings()) {
    EXPECT_TRUE(host.add_drive(codec(), {}, 0.2));
  }
  static Cia402HostSettings settings() { return {kStep, 0.02, 1, LostHostReaction::kQuickStop}; }
  static Cia402Drive codec() { return {kNode, GetParam(), 1e5, 0.02, 54.0, -1}; }
  static Cia402Motor motor() {
    Cia402Motor m;
    m.rated_torque = 20;
    m.gear_ratio = 100;
    m.lower_option = -1;
    return m;
  }

  void deliver() {
    for (const CanFrame& frame : drive.outbox().frames()) {
      log.push_back(frame);
      if (connected) (void)host.receive(frame);
    }
    drive.outbox().clear();
  }
  void tick(int n = 1) {
    for (int i = 0; i < n; ++i) {
      host.begin_tick(commands, frames);
      for (const CanFrame& frame : frames.frames()) {
        if (connected) drive.receive(frame);
        deliver();
      }
      host.end_tick(states);
      const std::array<double, 1> tau{drive.torque()};
      plant.step(tau, kStep);
      drive.sense(plant.motion(0));
      drive.pass();
      deliver();
    }
  }
  void turn_on() {
    for (int i = 0; i < 400 && !host.all_off(); ++i) tick();
    ASSERT_TRUE(host.all_off());
    host.set_goal(HostGoal::kOn);
    commands[0].q = plant.joint(0).q;
    for (int i = 0; i < 50 && !host.all_on(); ++i) tick();
    ASSERT_TRUE(host.all_on());
    ASSERT_EQ(drive.power(), DrivePower::kOn);
  }
  Sdo ask(SdoKind kind, std::uint16_t index, std::uint8_t sub, std::uint8_t size = 0,
          std::uint32_t value = 0) {
    drive.receive(encode_sdo({kind, kNode, index, sub, size, value}, true));
    Sdo answer;
    bool request = true;
    EXPECT_EQ(drive.outbox().frames().size(), 1u);
    EXPECT_EQ(decode_sdo(drive.outbox().frames()[0], answer, request), CodecStatus::kOk);
    EXPECT_FALSE(request);
    drive.outbox().clear();
    return answer;
  }
  std::vector<Emergency> emergencies() const {
    std::vector<Emergency> all;
    for (const CanFrame& frame : log) {
      Emergency e;
      if (decode_emergency(frame, e) == CodecStatus::kOk && e.node == kNode) all.push_back(e);
    }
    return all;
  }

  VirtualCia402Drive drive;
  Cia402Host host;
  BenchPlant plant{{BenchJoint{}}};
  std::array<JointCommand, 1> commands{};
  std::array<JointState, 1> states{};
  FrameList frames;
  std::vector<CanFrame> log;
  bool connected = true;
};

TEST_P(Cia402DriveTest, IsFoundConfiguredEnabledMovedAndStopped) {
  plant.joint(0).q = 0.3;
  drive.sense(plant.motion(0));
  turn_on();
  EXPECT_NEAR(states[0].q, 0.3, 1e-4);
  if (GetParam() == Cia402Mode::kCyclicTorque) {
    commands[0].tau = 12.0;
    tick(20);
    EXPECT_NEAR(states[0].tau, 12.0, 0.011);
    EXPECT_GT(plant.joint(0).dq, 0.5);
    EXPECT_NEAR(states[0].dq, plant.joint(0).dq, 0.1);
  } else {
    for (int i = 0; i < 500; ++i) {
      commands[0].q += 1e-3;  // 1 rad/s
      tick();
    }
    EXPECT_NEAR(plant.joint(0).q, commands[0].q, 0.01);
  }
  host.set_goal(HostGoal::kQuickStop);
  tick(2);
  EXPECT_EQ(drive.state(), Cia402State::kQuickStop);
  tick(300);
  EXPECT_NEAR(plant.joint(0).dq, 0.0, 1e-3);
  plant.joint(0).load = 5.0;  // held, not let go
  tick(500);
  EXPECT_NEAR(plant.joint(0).dq, 0.0, 1e-3);
  host.set_goal(HostGoal::kOff);
  tick(3);
  EXPECT_EQ(drive.power(), DrivePower::kOff);
  EXPECT_TRUE(emergencies().empty());
}

/// The ramp of 6085h: v^2 / 2a and not a metre more, for a joint that can follow it.
TEST_P(Cia402DriveTest, QuickStopGoesDownItsRamp) {
  turn_on();
  plant.joint(0).dq = 2.0;
  drive.sense(plant.motion(0));
  const double before = plant.joint(0).q;
  host.set_goal(HostGoal::kQuickStop);
  tick(400);
  EXPECT_NEAR(plant.joint(0).q - before, 2.0 * 2.0 / (2.0 * 20.0), 0.02);
}

TEST_P(Cia402DriveTest, RefusesWhatCia301LetsItRefuse) {
  EXPECT_EQ(ask(SdoKind::kUpload, 0x2000, 0).value, kSdoAbortNoObject);
  EXPECT_EQ(ask(SdoKind::kUpload, 0x1018, 9).value, kSdoAbortNoSubIndex);
  EXPECT_EQ(ask(SdoKind::kDownload, 0x1000, 0, 4, 1).value, kSdoAbortReadOnly);
  EXPECT_EQ(ask(SdoKind::kDownload, 0x6060, 0, 2, 8).value, kSdoAbortLength);
  EXPECT_EQ(ask(SdoKind::kDownload, 0x6060, 0, 1, 3).value, kSdoAbortRange);
  EXPECT_EQ(ask(SdoKind::kDownload, 0x6007, 0, 2, 4).value, kSdoAbortRange);
  EXPECT_EQ(ask(SdoKind::kDownload, 0x1A00, 1, 4, 0x12340010).value, kSdoAbortNoMapping);
  EXPECT_EQ(ask(SdoKind::kDownload, 0x1A00, 1, 4, 0x60410010).kind, SdoKind::kDownloadReply);
  EXPECT_EQ(ask(SdoKind::kDownload, 0x1A00, 0, 1, 1).kind, SdoKind::kDownloadReply);
  EXPECT_EQ(ask(SdoKind::kDownload, 0x1A00, 1, 4, 0x60640020).value, kSdoAbortState);
  EXPECT_EQ(ask(SdoKind::kUpload, 0x6076, 0).value, 200u);
}

/// What process data hold is the host's decision: here status alone, with another id.
TEST_P(Cia402DriveTest, SendsWhatIsMapped) {
  ask(SdoKind::kDownload, 0x1A00, 1, 4, 0x60410010);
  ask(SdoKind::kDownload, 0x1A00, 2, 4, 0x60610008);
  ask(SdoKind::kDownload, 0x1A00, 0, 1, 2);
  ask(SdoKind::kDownload, 0x1800, 2, 1, 1);
  ask(SdoKind::kDownload, 0x1800, 1, 4, 0x1F0);
  drive.receive(encode_sync());
  EXPECT_TRUE(drive.outbox().frames().empty());  // not operational
  drive.receive(encode_nmt(NmtCommand::kStart, kNode));
  drive.receive(encode_sync());
  ASSERT_EQ(drive.outbox().frames().size(), 1u);
  EXPECT_EQ(drive.outbox().frames()[0].id, 0x1F0u);
  EXPECT_EQ(drive.outbox().frames()[0].length, 3);
}

class LostHost : public Cia402DriveTest {
 protected:
  void lose(LostHostReaction reaction) {
    turn_on();
    drive.objects().set(0x6007, 0, static_cast<std::uint32_t>(reaction));
    tick(30);
    connected = false;
    tick(60);  // 2.5 heartbeats of 20 ms, and one to be heard in
    ASSERT_FALSE(emergencies().empty());
    EXPECT_EQ(emergencies().back().code, kEmergencyHeartbeatLost);
    EXPECT_EQ(emergencies().size(), 1u);
  }
};

TEST_P(LostHost, Nothing) {
  lose(LostHostReaction::kNone);
  EXPECT_EQ(drive.state(), Cia402State::kEnabled);
  connected = true;
  tick(25);
  EXPECT_EQ(emergencies().back().code, kEmergencyReset);
}
TEST_P(LostHost, Fault) {
  lose(LostHostReaction::kFault);
  EXPECT_EQ(drive.state(), Cia402State::kFault);
  EXPECT_EQ(drive.power(), DrivePower::kDropped);
  EXPECT_EQ(drive.torque(), 0.0);
}
TEST_P(LostHost, Disable) {
  lose(LostHostReaction::kDisable);
  EXPECT_EQ(drive.state(), Cia402State::kSwitchOnDisabled);
  EXPECT_EQ(drive.power(), DrivePower::kDropped);
}
TEST_P(LostHost, QuickStop) {
  plant.joint(0).load = 5.0;
  lose(LostHostReaction::kQuickStop);
  EXPECT_EQ(drive.state(), Cia402State::kQuickStop);
  tick(300);  // down the ramp
  const double q = plant.joint(0).q;
  tick(1000);
  EXPECT_NEAR(plant.joint(0).q, q, 0.01);
}
/// Sinks under its load, slower than a limp joint by far, and lets go when its host is back.
TEST_P(LostHost, Lower) {
  turn_on();
  plant.joint(0).load = 5.0;
  commands[0].tau = -5.0;
  ASSERT_TRUE(host.set_failure_policy(FailurePolicy::kLower));
  tick(static_cast<int>(host.policy_ticks()));
  EXPECT_EQ(static_cast<std::int16_t>(drive.objects().value(0x6007)), -1);
  EXPECT_EQ(host.counters().policies_refused, 0u);
  connected = false;
  tick(60);
  EXPECT_EQ(drive.power(), DrivePower::kOn);
  const double q = plant.joint(0).q;
  double fastest = 0.0;
  for (int i = 0; i < 4000; ++i) {
    tick();
    fastest = std::max(fastest, std::abs(plant.joint(0).dq));
  }
  EXPECT_GT(std::abs(plant.joint(0).q - q), 0.05);
  EXPECT_LT(fastest, 0.2);  // 5 N m against a damping of 40 N m s/rad
  EXPECT_EQ(drive.state(), Cia402State::kFaultReaction);
  connected = true;
  tick(25);
  EXPECT_EQ(drive.state(), Cia402State::kFault);
  EXPECT_EQ(drive.torque(), 0.0);
}
TEST_P(LostHost, TheLastPolicyToldCounts) {
  turn_on();
  for (const auto& [policy, code] :
       {std::pair{FailurePolicy::kLower, -1}, std::pair{FailurePolicy::kLimp, 2},
        std::pair{FailurePolicy::kHold, 3}}) {
    ASSERT_TRUE(host.set_failure_policy(policy));
    tick(static_cast<int>(host.policy_ticks()));
    EXPECT_EQ(static_cast<std::int16_t>(drive.objects().value(0x6007)), code);
  }
  EXPECT_EQ(drive.state(), Cia402State::kEnabled);
}
TEST_P(LostHost, StoppedNode) {
  turn_on();
  drive.receive(encode_nmt(NmtCommand::kStop, 0));
  EXPECT_EQ(drive.state(), Cia402State::kQuickStop);
}

TEST_P(Cia402DriveTest, BreaksDownAndIsResetByTheOperatorOnly) {
  turn_on();
  drive.break_down(0x3210);
  tick(3);
  EXPECT_EQ(host.status(0).fault, LinkFault::kDriveError);
  EXPECT_EQ(host.status(0).code, 0x3210u);
  EXPECT_EQ(drive.state(), Cia402State::kFault);
  tick(100);
  EXPECT_EQ(drive.state(), Cia402State::kFault);
  host.set_goal(HostGoal::kOff);
  tick(200);
  turn_on();
  EXPECT_EQ(emergencies().back().code, kEmergencyReset);
}

TEST_P(Cia402DriveTest, TooHotItIsAFaultThatStaysUntilCool) {
  turn_on();
  drive.set_temperature(150.0);
  tick(3);
  EXPECT_EQ(host.status(0).code, 0x4310u);
  host.set_goal(HostGoal::kOff);
  tick(200);
  host.set_goal(HostGoal::kOn);
  tick(200);
  EXPECT_EQ(drive.state(), Cia402State::kFault);
  drive.set_temperature(50.0);
  host.set_goal(HostGoal::kOff);
  tick(200);
  turn_on();
}

TEST_P(Cia402DriveTest, PowerCycleAnnouncesItselfAndForgets) {
  turn_on();
  drive.power_cycle(0.03);
  tick(29);
  EXPECT_EQ(host.status(0).fault, LinkFault::kNone);
  tick(2);
  EXPECT_EQ(host.status(0).fault, LinkFault::kRebooted);
  EXPECT_EQ(drive.objects().value(0x1017), 0u);
  EXPECT_EQ(drive.power(), DrivePower::kDropped);
  host.set_goal(HostGoal::kOff);
  tick(2);
  turn_on();
}

TEST_P(Cia402DriveTest, MutedHeartbeatIsSeenByTheHost) {
  turn_on();
  tick(100);
  drive.mute_heartbeat(true);
  tick(71);
  EXPECT_EQ(host.status(0).fault, LinkFault::kHeartbeatLost);
}

TEST_P(Cia402DriveTest, TooShortProcessDataAreAnEmergencyAndChangeNothing) {
  turn_on();
  const std::array<std::uint8_t, 3> bytes{};
  drive.receive(make_frame(0x200 + kNode, bytes));
  deliver();
  EXPECT_EQ(emergencies().back().code, kEmergencyPdoLength);
  EXPECT_EQ(drive.state(), Cia402State::kEnabled);
}

TEST_P(Cia402DriveTest, TorqueAtItsLimitIsReported) {
  turn_on();
  if (GetParam() == Cia402Mode::kCyclicTorque) {
    drive.objects().set(0x6071, 0, 3000);  // 60 N m
    commands[0].tau = 54.0;
  } else {
    commands[0].q = 2.0;
  }
  tick(3);
  EXPECT_LE(std::abs(drive.torque()), 54.0);
  if (GetParam() == Cia402Mode::kCyclicPosition) {
    EXPECT_NE(states[0].flags & kJointSaturated, 0u);
  }
}

const auto kModes = testing::Values(Cia402Mode::kCyclicTorque, Cia402Mode::kCyclicPosition);
INSTANTIATE_TEST_SUITE_P(Modes, Cia402DriveTest, kModes);
INSTANTIATE_TEST_SUITE_P(Modes, LostHost, kModes);

}  // namespace
}  // namespace clamber
