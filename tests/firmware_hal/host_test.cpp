// Both hosts against bench drives: bringing up, enabling, commands, and every way a drive goes
// wrong.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/firmware_hal/bench_drives.hpp"

namespace clamber {
namespace {

constexpr double kTick = 0.001;

MitDrive mit_codec(std::uint16_t id) {
  MitDrive d;
  d.id = id;
  d.reply_id = static_cast<std::uint16_t>(0x400 + id);
  d.ranges = {.position = {-12.5, 12.5},
              .velocity = {-45, 45},
              .kp = {0, 500},
              .kd = {0, 5},
              .torque = {-54, 54},
              .reply_torque = {-54, 54},
              .voltage = {}};
  d.reply = MitReplyKind::kStateNibble;
  d.format = {true, true};
  return d;
}

/// A host with two drives, joints 1 and 0, the second one mounted the other way round.
template <typename Host, typename Drive>
class Rig {
 public:
  Rig(Host& host, std::vector<Drive> drives) : host_(host), drives_(std::move(drives)) {}

  void tick() {
    host_.begin_tick(commands, frames);
    for (const CanFrame& frame : frames.frames()) {
      log.push_back(frame);
      for (Drive& drive : drives_)
        for (const CanFrame& reply : drive.take(frame)) deliver(reply);
    }
    ++count;
    if constexpr (std::is_same_v<Drive, test::BenchCia402Drive>) {
      for (Drive& drive : drives_)
        if (beats && !drive.silent && count % 20 == 0)
          deliver(encode_heartbeat(drive.codec.node, drive.nmt));
    }
    complete = host_.replies_complete();
    host_.end_tick(states);
  }
  void ticks(int n) {
    for (int i = 0; i < n; ++i) tick();
  }
  void deliver(const CanFrame& frame) {
    log.push_back(frame);
    (void)host_.receive(frame);
  }
  Drive& drive(std::size_t i) { return drives_[i]; }

  std::array<JointCommand, 2> commands{};
  std::array<JointState, 2> states{};
  FrameList frames;
  std::vector<CanFrame> log;
  bool complete = false;
  bool beats = true;
  int count = 0;

 private:
  Host& host_;
  std::vector<Drive> drives_;
};

class MitHostTest : public testing::Test {
 protected:
  MitHostTest() : host(kTick), rig(host, {bench(1), bench(2)}) {
    EXPECT_TRUE(host.add_drive(mit_codec(1), {1, 1.0, 0.0}, 0.025));
    EXPECT_TRUE(host.add_drive(mit_codec(2), {0, -1.0, 0.5}, 0.025));
    rig.drive(0).q = 0.3;
    rig.drive(1).q = -0.7;
  }
  static test::BenchMitDrive bench(std::uint16_t id) {
    test::BenchMitDrive drive;
    drive.codec = mit_codec(id);
    return drive;
  }
  void turn_on() {
    host.set_goal(HostGoal::kOn);
    for (int i = 0; i < 20 && !host.all_on(); ++i) rig.tick();
    ASSERT_TRUE(host.all_on());
  }

  MitHost host;
  Rig<MitHost, test::BenchMitDrive> rig;
};

TEST_F(MitHostTest, ReadsJointsWithoutEnabling) {
  rig.ticks(100);
  EXPECT_TRUE(rig.complete);
  EXPECT_NEAR(rig.states[1].q, 0.3, 1e-3);
  EXPECT_NEAR(rig.states[0].q, 1.2, 1e-3);  // -1 * (-0.7 - 0.5)
  EXPECT_EQ(rig.states[0].flags, 0u);
  EXPECT_EQ(rig.states[0].age, 0u);
  EXPECT_EQ(rig.states[0].sequence, 100u);
  for (const CanFrame& frame : rig.log) EXPECT_FALSE(is_mit_enable(frame));
}

/// Trap: firmware keeps the last setpoint, and "enable" would kick with it.
TEST_F(MitHostTest, EnablesOutOfALimpSetpoint) {
  rig.ticks(3);
  rig.commands[1].tau = 20.0;
  turn_on();
  const auto& heard = rig.drive(0).heard;
  std::size_t enable = 0;
  while (!(heard[enable].special && heard[enable].code == MitSpecial::kEnable)) ++enable;
  for (const std::size_t at : {enable - 1, enable + 1}) {
    EXPECT_FALSE(heard[at].special);
    EXPECT_EQ(heard[at].setpoint.kp, 0.0);
    EXPECT_EQ(heard[at].setpoint.kd, 0.0);
    EXPECT_NEAR(heard[at].setpoint.tau, 0.0, 0.014);  // zero lies between two steps
    EXPECT_NEAR(heard[at].setpoint.q, 0.3, 1e-3);
  }
  rig.tick();
  EXPECT_NEAR(heard.back().setpoint.tau, 20.0, 0.014);
  EXPECT_NE(rig.states[1].flags & kJointEnabled, 0u);
}

TEST_F(MitHostTest, CommandsGoThroughTheMounting) {
  turn_on();
  rig.commands[0] = {0.2, 1.0, 100.0, 2.0, 5.0};
  rig.tick();
  const JointCommand heard = rig.drive(1).heard.back().setpoint;
  EXPECT_NEAR(heard.q, 0.3, 1e-3);  // -0.2 + 0.5
  EXPECT_NEAR(heard.dq, -1.0, 0.02);
  EXPECT_NEAR(heard.kp, 100.0, 0.1);
  EXPECT_NEAR(heard.kd, 2.0, 0.01);
  EXPECT_NEAR(heard.tau, -5.0, 0.02);
}

TEST_F(MitHostTest, NeverEnablesAJointItCannotRead) {
  rig.drive(0).silent = true;
  host.set_goal(HostGoal::kOn);
  rig.ticks(2000);
  EXPECT_FALSE(host.all_on());
  for (const CanFrame& frame : rig.log) EXPECT_FALSE(is_mit_enable(frame) && frame.id == 1);
  EXPECT_NE(rig.states[1].flags & kJointStale, 0u);
}

/// Trap: after 25 ms without commands the drive is limp; going on as if nothing had been would
/// kick.
TEST_F(MitHostTest, SilenceBeyondTheWatchdogIsAFaultUntilSwitchedOff) {
  turn_on();
  rig.drive(0).silent = true;
  rig.ticks(24);
  EXPECT_EQ(host.status(0).phase, LinkPhase::kOn);
  EXPECT_EQ(rig.states[1].age, 24u);
  rig.ticks(3);
  EXPECT_EQ(host.status(0).fault, LinkFault::kWatchdog);
  EXPECT_NE(rig.states[1].flags & kJointFault, 0u);
  EXPECT_EQ(host.status(1).phase, LinkPhase::kOn);
  EXPECT_EQ(host.counters().missing_replies, 27u);
  rig.drive(0).silent = false;
  const std::size_t before = rig.drive(0).heard.size();
  rig.ticks(50);
  for (std::size_t i = before; i < rig.drive(0).heard.size(); ++i)
    EXPECT_EQ(rig.drive(0).heard[i].code, MitSpecial::kDisable);
  host.set_goal(HostGoal::kOff);
  rig.tick();
  turn_on();
}

TEST_F(MitHostTest, DriveErrorsAndDropOutsAreLatched) {
  turn_on();
  rig.drive(0).error = 13;
  rig.ticks(3);
  EXPECT_EQ(host.status(0).fault, LinkFault::kDriveError);
  EXPECT_EQ(host.status(0).code, 13u);
  rig.drive(1).enabled = false;
  rig.ticks(3);
  EXPECT_EQ(host.status(1).fault, LinkFault::kDroppedOut);
  host.set_goal(HostGoal::kOff);  // clears the error in the drive as well
  rig.ticks(3);
  EXPECT_EQ(rig.drive(0).error, 0);
  turn_on();
}

/// Trap: storing the zero takes up to 1.5 s, in which the drive neither hears nor answers.
TEST_F(MitHostTest, LeavesADriveAloneWhileItStoresItsZero) {
  rig.ticks(3);
  EXPECT_FALSE(host.request_zero(7));
  ASSERT_TRUE(host.request_zero(0));
  rig.tick();
  EXPECT_EQ(rig.drive(0).heard.back().code, MitSpecial::kSetZero);
  const std::size_t heard = rig.drive(0).heard.size();
  host.set_goal(HostGoal::kOn);  // must not cut it short either
  rig.ticks(1499);
  EXPECT_EQ(rig.drive(0).heard.size(), heard);
  EXPECT_TRUE(rig.complete);
  rig.ticks(3);
  EXPECT_GT(rig.drive(0).heard.size(), heard);
  turn_on();
  EXPECT_FALSE(host.request_zero(0));
}

TEST_F(MitHostTest, QuickStopDampsAndOnlyOffLeadsOutOfIt) {
  host.set_goal(HostGoal::kQuickStop);  // nothing to stop: stays off
  rig.ticks(3);
  EXPECT_TRUE(host.all_off());
  turn_on();
  rig.commands[1] = {0.0, 0.0, 0.0, 0.0, 30.0};
  host.set_goal(HostGoal::kQuickStop);
  rig.tick();
  EXPECT_EQ(rig.drive(0).heard.back().setpoint.kp, 0.0);
  EXPECT_EQ(rig.drive(0).heard.back().setpoint.kd, 5.0);
  EXPECT_NEAR(rig.drive(0).heard.back().setpoint.tau, 0.0, 0.014);
  host.set_goal(HostGoal::kOn);
  rig.tick();
  EXPECT_EQ(rig.drive(0).heard.back().setpoint.kd, 5.0);
  host.set_goal(HostGoal::kOff);
  rig.tick();
  EXPECT_EQ(rig.drive(0).heard.back().code, MitSpecial::kDisable);
}

TEST_F(MitHostTest, RepeatsTheLastGoodCommandForWhatIsNoNumber) {
  turn_on();
  rig.commands[1].tau = 7.0;
  rig.tick();
  rig.commands[1].tau = std::numeric_limits<double>::quiet_NaN();
  rig.tick();
  EXPECT_NEAR(rig.drive(0).heard.back().setpoint.tau, 7.0, 0.014);
  EXPECT_EQ(host.counters().not_finite, 1u);
  rig.commands[1].tau = 100.0;
  rig.tick();
  EXPECT_EQ(host.counters().clamped, 1u);
  EXPECT_NE(rig.states[1].flags & kJointSaturated, 0u);
}

TEST_F(MitHostTest, ForeignAndMalformedFramesAreCountedAndIgnored) {
  rig.ticks(3);
  const JointState before = rig.states[1];
  const std::array<std::uint8_t, 8> bytes{};
  EXPECT_EQ(host.receive(make_frame(0x123, bytes)), CodecStatus::kForeign);
  EXPECT_EQ(host.receive(make_frame(0x401, bytes)), CodecStatus::kForeign);  // id byte of nobody
  EXPECT_EQ(host.receive(make_frame(0x401, std::span(bytes).first(3))), CodecStatus::kBadLength);
  EXPECT_EQ(host.counters().foreign, 2u);
  EXPECT_EQ(host.counters().malformed, 1u);
  host.end_tick(rig.states);
  EXPECT_EQ(rig.states[1].q, before.q);
  EXPECT_EQ(rig.states[1].sequence, before.sequence);
}

TEST_F(MitHostTest, MoreDrivesThanFitAreRefused) {
  for (std::uint16_t id = 3; id <= kMaxDrives; ++id)
    EXPECT_TRUE(host.add_drive(mit_codec(id), {}, 0.0));
  EXPECT_FALSE(host.add_drive(mit_codec(99), {}, 0.0));
}

// ---- CiA 402

class Cia402HostTest : public testing::TestWithParam<Cia402Mode> {
 protected:
  Cia402HostTest() : host(settings()), rig(host, {bench(41), bench(42)}) {
    EXPECT_TRUE(host.add_drive(codec(41), {1, 1.0, 0.0}, 0.2));
    EXPECT_TRUE(host.add_drive(codec(42), {0, -1.0, 0.5}, 0.2));
    rig.drive(0).q = 0.3;
    rig.drive(1).q = -0.7;
  }
  static Cia402HostSettings settings() { return {kTick, 0.02, 1, LostHostReaction::kQuickStop}; }
  static Cia402Drive codec(std::uint8_t node) { return {node, GetParam(), 1e5, 0.02, 54.0}; }
  static test::BenchCia402Drive bench(std::uint8_t node) {
    test::BenchCia402Drive drive;
    drive.codec = codec(node);
    drive.objects[0x100000] = 0x00020192;  // servo drive, profile 402
    drive.objects[0x650200] = 1u << 7 | 1u << 9;
    drive.objects[0x607600] = 200;
    return drive;
  }
  void start() {
    for (int i = 0; i < 400 && !host.all_off(); ++i) rig.tick();
    ASSERT_TRUE(host.all_off());
  }
  void turn_on() {
    host.set_goal(HostGoal::kOn);
    for (int i = 0; i < 400 && !host.all_on(); ++i) rig.tick();
    ASSERT_TRUE(host.all_on());
  }

  Cia402Host host;
  Rig<Cia402Host, test::BenchCia402Drive> rig;
};

TEST_P(Cia402HostTest, ConfiguresAndReadsWithoutEnabling) {
  start();
  rig.ticks(50);
  auto& objects = rig.drive(0).objects;
  EXPECT_EQ(objects[0x101700], 20u);
  EXPECT_EQ(objects[0x101601], 1u << 16 | 50u);
  EXPECT_EQ(objects[0x600700], 3u);
  EXPECT_EQ(objects[0x606000], static_cast<std::uint32_t>(GetParam()));
  EXPECT_EQ(objects[0x140001], 0x229u);
  EXPECT_EQ(objects[0x180001], 0x1A9u);
  EXPECT_EQ(objects[0x180002], 1u);
  EXPECT_EQ(objects[0x1A0000], 3u);
  EXPECT_EQ(objects[0x1A0002], 0x60640020u);
  EXPECT_EQ(objects[0x160000], GetParam() == Cia402Mode::kCyclicTorque ? 2u : 3u);
  EXPECT_EQ(objects[0x140101], 0x80000329u);
  EXPECT_EQ(objects[0x180301], 0x800004A9u);
  EXPECT_NEAR(rig.states[1].q, 0.3, 1e-4);
  EXPECT_NEAR(rig.states[0].q, 1.2, 1e-4);
  EXPECT_EQ(rig.states[1].flags, 0u);
  for (const CanFrame& frame : rig.log) EXPECT_FALSE(is_cia402_enable(frame));
}

/// Questions of a log that set 6007h, by drive and value.
std::vector<std::pair<int, std::uint32_t>> policies_told(const std::vector<CanFrame>& log) {
  std::vector<std::pair<int, std::uint32_t>> told;
  for (const CanFrame& frame : log) {
    Sdo sdo;
    bool request = false;
    if (decode_sdo(frame, sdo, request) == CodecStatus::kOk && request && sdo.index == 0x6007)
      told.emplace_back(sdo.node, sdo.value);
  }
  return told;
}

TEST_P(Cia402HostTest, TellsAFailurePolicyOneDriveAfterTheOther) {
  start();
  turn_on();
  rig.log.clear();
  ASSERT_TRUE(host.set_failure_policy(FailurePolicy::kLimp));
  rig.ticks(static_cast<int>(host.policy_ticks()));
  EXPECT_EQ(rig.drive(0).objects[0x600700], 2u);
  EXPECT_EQ(rig.drive(1).objects[0x600700], 2u);
  rig.ticks(100);
  const std::vector<std::pair<int, std::uint32_t>> once{{41, 2u}, {42, 2u}};
  EXPECT_EQ(policies_told(rig.log), once);  // who has answered is not asked again
  // These drives have no code of their own for it.
  ASSERT_TRUE(host.set_failure_policy(FailurePolicy::kLower));
  rig.ticks(static_cast<int>(host.policy_ticks()));
  EXPECT_EQ(rig.drive(0).objects[0x600700], 3u);
  EXPECT_TRUE(host.all_on());
  EXPECT_EQ(host.counters().policies_refused, 0u);
}

TEST_P(Cia402HostTest, ADriveThatDoesNotAnswerIsAskedThreeTimesAndCounted) {
  start();
  turn_on();
  rig.log.clear();
  rig.drive(0).deaf_to_sdo = true;
  ASSERT_TRUE(host.set_failure_policy(FailurePolicy::kLimp));
  rig.ticks(100);
  const auto told = policies_told(rig.log);
  EXPECT_EQ(std::count_if(told.begin(), told.end(), [](auto& t) { return t.first == 41; }), 3);
  EXPECT_EQ(rig.drive(1).objects[0x600700], 2u);
  EXPECT_EQ(host.counters().policies_refused, 1u);
  EXPECT_TRUE(host.all_on());
  // The next policy is a new question.
  rig.drive(0).deaf_to_sdo = false;
  ASSERT_TRUE(host.set_failure_policy(FailurePolicy::kHold));
  rig.ticks(100);
  EXPECT_EQ(rig.drive(0).objects[0x600700], 3u);
}

TEST_P(Cia402HostTest, EnablesStepByStepAndPassesCommands) {
  start();
  rig.commands[1] = {0.4, 0.0, 0.0, 0.0, 12.0};
  turn_on();
  EXPECT_EQ(rig.drive(0).enables, 1);
  rig.tick();
  EXPECT_NEAR(rig.drive(0).tau, 12.0, 0.011);
  if (GetParam() == Cia402Mode::kCyclicPosition) {
    EXPECT_NEAR(rig.drive(0).commanded_q, 0.4, 1e-4);
  }
  EXPECT_NE(rig.states[1].flags & kJointEnabled, 0u);
  host.set_goal(HostGoal::kOff);
  rig.ticks(2);
  EXPECT_EQ(rig.drive(0).state, Cia402State::kSwitchOnDisabled);
}

TEST_P(Cia402HostTest, NothingMovesWhileEnabling) {
  start();
  rig.ticks(2);
  rig.commands[1] = {2.0, 0.0, 0.0, 0.0, 30.0};
  host.set_goal(HostGoal::kOn);
  for (int i = 0; i < 20 && !host.all_on(); ++i) {
    rig.tick();
    EXPECT_EQ(rig.drive(0).tau, 0.0);
    if (GetParam() == Cia402Mode::kCyclicPosition) {
      EXPECT_NEAR(rig.drive(0).commanded_q, 0.3, 1e-4);
    }
  }
}

TEST_P(Cia402HostTest, DriveLawIsKeptInEitherMode) {
  start();
  turn_on();
  rig.commands[0] = {1.3, 0.0, 50.0, 0.0, 1.0};  // joint 0: mounted the other way round, at 1.2
  rig.tick();
  if (GetParam() == Cia402Mode::kCyclicTorque) {
    EXPECT_NEAR(rig.drive(1).tau, -(1.0 + 50.0 * 0.1), 0.02);
  } else {
    EXPECT_NEAR(rig.drive(1).tau, -1.0, 0.02);
    EXPECT_NEAR(rig.drive(1).commanded_q, -1.3 + 0.5, 1e-4);
  }
}

TEST_P(Cia402HostTest, VelocityIsTheDifferenceOfPositions) {
  start();
  for (int i = 0; i < 10; ++i) {
    rig.drive(0).q += 0.002;
    rig.tick();
  }
  EXPECT_NEAR(rig.states[1].dq, 2.0, 0.011);
  rig.drive(0).silent = true;  // a lost reply: the difference is over two ticks
  rig.drive(0).q += 0.002;
  rig.tick();
  EXPECT_EQ(rig.states[1].age, 1u);
  rig.drive(0).silent = false;
  rig.drive(0).q += 0.002;
  rig.tick();
  EXPECT_NEAR(rig.states[1].dq, 2.0, 0.011);
}

TEST_P(Cia402HostTest, SilentDrivesAreCalledUntilTheyAnswer) {
  rig.drive(1).silent = true;
  rig.ticks(3000);
  EXPECT_EQ(host.status(1).phase, LinkPhase::kStarting);
  EXPECT_EQ(host.status(0).phase, LinkPhase::kOff);
  rig.drive(1).silent = false;
  rig.ticks(1000);
  EXPECT_TRUE(host.all_off());
}

TEST_P(Cia402HostTest, RefusedConfigurationIsAFaultWithItsCode) {
  rig.drive(0).abort_index = 0x1016;
  rig.ticks(300);
  EXPECT_EQ(host.status(0).fault, LinkFault::kNone);  // goal off: tried again and again
  host.set_goal(HostGoal::kOn);
  rig.ticks(300);
  EXPECT_EQ(host.status(0).fault, LinkFault::kSdoAbort);
  EXPECT_EQ(host.status(0).code, kSdoAbortNoObject);
}

TEST_P(Cia402HostTest, OptionalObjectsMayBeMissing) {
  rig.drive(0).abort_index = 0x60C2;
  start();
}

TEST_P(Cia402HostTest, AnotherDriveThanConfiguredIsAFault) {
  host.set_goal(HostGoal::kOn);
  rig.drive(0).objects[0x607600] = 5000;  // a larger motor: every torque would be wrong
  rig.drive(1).objects[0x100000] = 0x00020191;
  rig.ticks(300);
  EXPECT_EQ(host.status(0).fault, LinkFault::kWrongDrive);
  EXPECT_EQ(host.status(0).code, 0x6076u);
  EXPECT_EQ(host.status(1).fault, LinkFault::kWrongDrive);
  EXPECT_EQ(host.status(1).code, 0x1000u);
}

TEST_P(Cia402HostTest, LostHeartbeatRebootEmergencyAndDriveFaultAreLatched) {
  const auto recover = [this] {
    host.set_goal(HostGoal::kOff);
    start();
    rig.ticks(100);
    turn_on();
  };
  start();
  turn_on();
  rig.ticks(100);
  rig.beats = false;
  rig.ticks(51);
  EXPECT_EQ(host.status(0).fault, LinkFault::kHeartbeatLost);
  rig.beats = true;
  recover();

  rig.drive(0).nmt = NmtState::kPreOperational;
  rig.drive(0).state = Cia402State::kSwitchOnDisabled;
  rig.deliver(encode_heartbeat(41, NmtState::kBoot));
  EXPECT_EQ(host.status(0).fault, LinkFault::kRebooted);
  rig.ticks(200);
  EXPECT_EQ(rig.drive(0).state, Cia402State::kSwitchOnDisabled);
  recover();

  rig.deliver(encode_emergency({41, 0x2310, 0x02, {}}));
  rig.tick();
  EXPECT_EQ(host.status(0).fault, LinkFault::kDriveError);
  EXPECT_EQ(host.status(0).code, 0x2310u);
  rig.deliver(encode_emergency({41, kEmergencyReset, 0, {}}));
  rig.ticks(5);
  EXPECT_EQ(host.status(0).phase, LinkPhase::kFault);
  recover();

  rig.drive(0).state = Cia402State::kFault;
  rig.ticks(3);
  EXPECT_EQ(host.status(0).fault, LinkFault::kDriveError);
  rig.ticks(50);
  EXPECT_EQ(rig.drive(0).state, Cia402State::kFault);  // never reset by itself
  recover();

  rig.drive(0).nmt = NmtState::kStopped;
  rig.ticks(21);
  EXPECT_EQ(host.status(0).fault, LinkFault::kDroppedOut);
}

TEST_P(Cia402HostTest, QuickStopIsTheDrivesOwn) {
  start();
  turn_on();
  rig.commands[1].tau = 30.0;
  rig.tick();
  host.set_goal(HostGoal::kQuickStop);
  rig.ticks(3);
  EXPECT_EQ(rig.drive(0).state, Cia402State::kQuickStop);
  EXPECT_EQ(rig.drive(0).tau, 0.0);
  host.set_goal(HostGoal::kOn);
  rig.ticks(5);
  EXPECT_EQ(rig.drive(0).state, Cia402State::kQuickStop);
  EXPECT_EQ(rig.drive(0).enables, 1);
  host.set_goal(HostGoal::kOff);
  rig.ticks(2);
  EXPECT_EQ(rig.drive(0).state, Cia402State::kSwitchOnDisabled);
}

TEST_P(Cia402HostTest, ADriveLeftEnabledIsSwitchedOffBeforeItIsConfigured) {
  EXPECT_EQ(rig.drive(0).objects.count(0x604000), 0u);
  start();
  EXPECT_EQ(rig.drive(0).objects[0x604000], 0u);
}

INSTANTIATE_TEST_SUITE_P(Modes, Cia402HostTest,
                         testing::Values(Cia402Mode::kCyclicTorque, Cia402Mode::kCyclicPosition),
                         [](const auto& mode) {
                           return mode.param == Cia402Mode::kCyclicTorque ? "torque" : "position";
                         });

}  // namespace
}  // namespace clamber
