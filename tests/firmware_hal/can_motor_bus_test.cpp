// The motor bus over ports in simulated time: start, ticks, everything that goes wrong, the end.
#include "firmware_hal/can_motor_bus.hpp"

#include <gtest/gtest.h>

#include "tests/firmware_hal/bench_drives.hpp"
#include "tests/firmware_hal/fake_port.hpp"

namespace clamber {
namespace {

constexpr std::int64_t kTick = 1'000'000;

/// Two buses, "left" with joints 0 and 1, "right" with joint 2, each drive at another position.
class CanMotorBusTest : public testing::Test {
 protected:
  CanMotorBusTest() : hosts{MitHost(0.001), MitHost(0.001)} {
    for (std::uint16_t id = 1; id <= 3; ++id) {
      test::BenchMitDrive& drive = drives[id - 1u];
      drive.codec.id = id;
      drive.codec.reply_id = static_cast<std::uint16_t>(0x400 + id);
      drive.codec.ranges = {.position = {-12.5, 12.5},
                            .velocity = {-45, 45},
                            .kp = {0, 500},
                            .kd = {0, 5},
                            .torque = {-54, 54},
                            .reply_torque = {-54, 54},
                            .voltage = {}};
      drive.codec.reply = MitReplyKind::kStateNibble;
      drive.q = 0.1 * id;
      EXPECT_TRUE(hosts[id == 3].add_drive(drive.codec, {id - 1, 1.0, 0.0}, 0.025));
    }
    make_bus();
  }
  void make_bus(bool lock_step = false, FrameObserver* observer = nullptr) {
    CanBusSettings settings;
    settings.joint_count = 3;
    settings.lock_step = lock_step;
    settings.observer = observer;
    const std::array<CanSegment, 2> segments{CanSegment{&hosts[0], &left},
                                             CanSegment{&hosts[1], &right}};
    bus.emplace(settings, clock, segments);
  }
  std::vector<CanFrame> drives_take(std::size_t first, std::size_t last, const CanFrame& frame) {
    std::vector<CanFrame> replies;
    if (stubborn) drives[1].error = 9;
    for (std::size_t i = first; i < last; ++i)
      for (const CanFrame& reply : drives[i].take(frame)) replies.push_back(reply);
    return replies;
  }
  /// A tick as the run loop does it.
  BusStatus tick() {
    const std::int64_t start = clock.now;
    const BusStatus status = bus->exchange(commands, states, start + kTick);
    last_duration = clock.now - start;
    EXPECT_LE(last_duration, kTick);
    clock.now = start + kTick;
    return status;
  }
  void ticks(int n) {
    for (int i = 0; i < n; ++i) (void)tick();
  }
  bool stale(std::size_t joint) const { return (states[joint].flags & kJointStale) != 0; }
  static bool any_enable(const std::vector<CanFrame>& frames) {
    return std::any_of(frames.begin(), frames.end(), is_mit_enable);
  }

  test::FakeClock clock;
  std::array<test::BenchMitDrive, 3> drives;
  test::FakePort left{clock, [this](const CanFrame& f) { return drives_take(0, 2, f); }};
  test::FakePort right{clock, [this](const CanFrame& f) { return drives_take(2, 3, f); }};
  std::array<MitHost, 2> hosts;
  std::optional<CanMotorBus> bus;
  std::array<JointCommand, 3> commands{};
  std::array<JointState, 3> states{};
  std::int64_t last_duration = 0;
  bool stubborn = false;  ///< joint 1 has an error that does not go away
};

TEST_F(CanMotorBusTest, CommandsGoOutAndStatesComeIn) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  for (const test::BenchMitDrive& drive : drives) EXPECT_TRUE(drive.enabled);
  commands[2].tau = 9.0;
  EXPECT_EQ(tick(), BusStatus::kOk);
  EXPECT_NEAR(drives[2].heard.back().setpoint.tau, 0.0, 0.014);  // the first one only asks
  EXPECT_EQ(tick(), BusStatus::kOk);
  EXPECT_NEAR(drives[2].heard.back().setpoint.tau, 9.0, 0.014);
  EXPECT_EQ(last_duration, 100'000);  // no longer than the replies took
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_NEAR(states[j].q, 0.1 * static_cast<double>(j + 1), 1e-3);
    EXPECT_EQ(states[j].age, 0u);
    EXPECT_EQ(states[j].flags, kJointEnabled);
  }
  const std::uint64_t sequence = states[0].sequence;
  ticks(10);
  EXPECT_EQ(states[0].sequence, sequence + 10);
  EXPECT_EQ(bus->counters().exchanges, 12u);
  EXPECT_EQ(bus->segment_counters(0).slowest_reply_ns, 100'000);
}

TEST_F(CanMotorBusTest, NothingIsSwitchedOnWhileAJointIsSilent) {
  drives[2].silent = true;
  EXPECT_EQ(bus->enable(), BusStatus::kDown);
  EXPECT_EQ(bus->trouble().what, BusTrouble::kJointSilent);
  EXPECT_EQ(bus->trouble().bus, 1u);
  EXPECT_EQ(bus->trouble().joint, 2);
  EXPECT_FALSE(any_enable(left.sent));
  EXPECT_FALSE(any_enable(right.sent));
  EXPECT_EQ(tick(), BusStatus::kDown);
}

TEST_F(CanMotorBusTest, ADriveWithAFaultIsNamedAndAllAreOffAgain) {
  drives[1].error = 9;
  EXPECT_EQ(bus->enable(), BusStatus::kOk);  // the drive lets it be cleared while it is off
  bus->disable();
  stubborn = true;
  EXPECT_EQ(bus->enable(), BusStatus::kDown);
  EXPECT_EQ(bus->trouble().what, BusTrouble::kNotEnabled);
  EXPECT_EQ(bus->trouble().joint, 1);
  for (const test::BenchMitDrive& drive : drives) EXPECT_FALSE(drive.enabled);
}

/// At any tick of the switching on, whoever asked for it may think again.
TEST_F(CanMotorBusTest, GivingUpLeavesEveryDriveOff) {
  for (int after = 1; after <= 10; ++after) {
    int asked = 0;
    bus->set_give_up([&] { return ++asked >= after; });
    const BusStatus status = bus->enable();
    if (asked < after) {  // on before that
      EXPECT_EQ(status, BusStatus::kOk);
      EXPECT_GT(after, 5);
      return;
    }
    EXPECT_EQ(status, BusStatus::kDown);
    EXPECT_EQ(bus->trouble().what, BusTrouble::kGivenUp);
    for (const test::BenchMitDrive& drive : drives) EXPECT_FALSE(drive.enabled) << after;
  }
  FAIL() << "never switched on";
}

TEST_F(CanMotorBusTest, AMissingReplyMakesItsJointStale) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  tick();
  const std::uint64_t before = bus->counters().missing_replies;
  drives[1].silent = true;
  EXPECT_EQ(tick(), BusStatus::kLate);
  EXPECT_FALSE(stale(0));
  EXPECT_TRUE(stale(1));
  EXPECT_FALSE(stale(2));
  EXPECT_EQ(states[1].age, 1u);
  EXPECT_GE(last_duration, kTick * 9 / 10);  // waited for, but not to the end
  EXPECT_LT(last_duration, kTick);
  ticks(3);
  EXPECT_EQ(states[1].age, 4u);
  EXPECT_EQ(bus->counters().missing_replies, before + 4);
  drives[1].silent = false;
  EXPECT_EQ(tick(), BusStatus::kOk);
  EXPECT_EQ(states[1].age, 0u);
  EXPECT_FALSE(stale(1));
}

TEST_F(CanMotorBusTest, ALateReplyIsCountedAndItsJointIsStaleForTheTick) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  tick();
  right.delay = 970'000;  // after the waiting, before the next tick
  EXPECT_EQ(tick(), BusStatus::kLate);
  EXPECT_TRUE(stale(2));
  EXPECT_EQ(bus->counters().late, 0u);
  right.delay = 100'000;
  ticks(2);
  EXPECT_EQ(bus->segment_counters(1).late_replies, 1u);
  EXPECT_EQ(bus->segment_counters(0).late_replies, 0u);
}

TEST_F(CanMotorBusTest, AFullInterfaceIsOfferedTheRestAgain) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  tick();
  left.room = 1;
  clock.arrivals.emplace_back([this] {  // room comes back a little later
    if (left.room == 0 && clock.now % kTick > 250'000) left.room = 10;
    return std::int64_t{1} << 62;
  });
  EXPECT_EQ(tick(), BusStatus::kOk);
  EXPECT_GT(left.counters().refused, 0u);
  EXPECT_EQ(bus->segment_counters(0).unsent_frames, 0u);
  clock.arrivals.pop_back();
  left.room = 0;  // and not at all: given up by half of the tick, for ever
  EXPECT_EQ(tick(), BusStatus::kLate);
  EXPECT_EQ(bus->segment_counters(0).unsent_frames, 2u);
  EXPECT_TRUE(stale(0) && stale(1) && !stale(2));
  const std::size_t sent = left.sent.size();
  left.room = 1000;
  commands[0].tau = 5.0;
  EXPECT_EQ(tick(), BusStatus::kOk);
  EXPECT_EQ(left.sent.size(), sent + 2);  // the new tick's, and none of the old ones
  EXPECT_NEAR(drives[0].heard.back().setpoint.tau, 5.0, 0.014);
}

/// Users of other stacks: the queue fills while nobody acknowledges, and what is in it moves the
/// robot when the bus comes back.
TEST_F(CanMotorBusTest, NeverMoreThanOneTicksFramesWaitToBeSent) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  tick();
  left.stuck = true;
  ticks(15);
  EXPECT_EQ(left.unsent.size(), 2u);  // one tick's
  EXPECT_EQ(bus->segment_counters(0).held_ticks, 14u);
  EXPECT_EQ(states[2].age, 0u);
  left.release();
  commands[0].tau = 3.0;
  ticks(2);
  EXPECT_NEAR(drives[0].heard.back().setpoint.tau, 3.0, 0.014);
  EXPECT_FALSE(stale(0));
}

TEST_F(CanMotorBusTest, StoppingTakesBackWhatIsUnsent) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  commands[0].tau = 30.0;
  ticks(2);
  left.stuck = true;
  ticks(3);
  left.sent.clear();
  bus->disable();
  EXPECT_GT(left.discards, 0);
  EXPECT_EQ(right.discards, 0);  // nothing unsent there
  const std::size_t heard = drives[0].heard.size();
  left.release();
  for (std::size_t i = heard; i < drives[0].heard.size(); ++i)
    EXPECT_LT(drives[0].heard[i].setpoint.tau, 1.0);
  EXPECT_LE(left.sent.size(), 4u);  // quick stop and off, once each
  EXPECT_FALSE(drives[2].enabled);
  EXPECT_FALSE(drives[0].enabled);  // "off" waited behind nothing
  const std::size_t after = right.sent.size();
  EXPECT_EQ(tick(), BusStatus::kDown);
  EXPECT_EQ(right.sent.size(), after);
}

/// Where the transport cannot take frames back: at most one tick's go out, and "off" follows.
TEST_F(CanMotorBusTest, StoppingABusWhoseFramesCannotBeTakenBack) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  commands[0].tau = 30.0;
  ticks(2);
  left.stuck = true;
  left.discards_work = false;
  ticks(8);
  bus->disable();
  EXPECT_EQ(left.unsent.size(), 6u);  // a tick's setpoints, quick stop, off; two drives
  left.release();
  EXPECT_FALSE(drives[0].enabled);
  EXPECT_FALSE(drives[1].enabled);
}

TEST_F(CanMotorBusTest, OneBusUnpluggedTheOtherGoesOn) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  tick();
  left.state_now = PortState::kDown;
  for (int i = 1; i < 20; ++i) {
    EXPECT_EQ(tick(), BusStatus::kLate);
    EXPECT_TRUE(stale(0) && stale(1) && !stale(2));
    EXPECT_EQ(states[0].age, static_cast<std::uint32_t>(i));
    EXPECT_EQ(last_duration, 100'000);  // no time is lost waiting for it
  }
  EXPECT_GT(left.maintained, 19);
  left.state_now = PortState::kActive;
  EXPECT_EQ(tick(), BusStatus::kOk);
  EXPECT_FALSE(stale(0));
  // Away for longer than the drives' watchdog: they are limp, and that is a fault that stays.
  left.state_now = PortState::kDown;
  ticks(30);
  left.state_now = PortState::kActive;
  ticks(5);
  EXPECT_NE(states[0].flags & kJointFault, 0u);
  EXPECT_EQ(states[2].flags, kJointEnabled);
}

TEST_F(CanMotorBusTest, WithoutAnyBusItIsDown) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  left.state_now = PortState::kBusOff;
  right.state_now = PortState::kDown;
  const std::size_t sent = left.sent.size();
  EXPECT_EQ(tick(), BusStatus::kDown);
  EXPECT_EQ(left.sent.size(), sent);  // else it would all go out on return
  EXPECT_EQ(bus->trouble().what, BusTrouble::kNoBus);
  bus->disable();
}

TEST_F(CanMotorBusTest, EndsWithQuickStopAndOff) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  commands[1].tau = 20.0;
  ticks(3);
  const std::size_t heard = drives[1].heard.size();
  bus.reset();  // also when nobody calls disable()
  EXPECT_FALSE(drives[1].enabled);
  ASSERT_GT(drives[1].heard.size(), heard + 200);
  EXPECT_EQ(drives[1].heard[heard].setpoint.kd, 5.0);
  EXPECT_NEAR(drives[1].heard[heard].setpoint.tau, 0.0, 0.014);
  EXPECT_EQ(drives[1].heard.back().code, MitSpecial::kDisable);
}

TEST_F(CanMotorBusTest, QuickStopWorksWithinATickAndStays) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  commands[0].tau = 20.0;
  ticks(2);
  bus->quick_stop();
  tick();
  EXPECT_EQ(drives[0].heard.back().setpoint.kd, 5.0);
  EXPECT_NEAR(drives[0].heard.back().setpoint.tau, 0.0, 0.014);
  ticks(5);
  EXPECT_EQ(drives[0].heard.back().setpoint.kd, 5.0);
}

TEST_F(CanMotorBusTest, WithoutADeadlineATickIsTheLimit) {
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  drives[0].silent = true;
  const std::int64_t start = clock.now;
  EXPECT_EQ(bus->exchange(commands, states, 0), BusStatus::kLate);
  EXPECT_LE(clock.now - start, kTick);
  EXPECT_EQ(bus->exchange(std::span(commands).first(2), states, 0), BusStatus::kDown);
}

struct Record final : FrameObserver {
  void sent(std::size_t bus, const CanFrame& frame) noexcept override { note('s', bus, frame.id); }
  void received(std::size_t bus, const CanFrame& frame) noexcept override {
    note('r', bus, frame.id);
  }
  void tick_ended(std::uint64_t tick) noexcept override { note('t', tick, 0); }
  void note(char what, std::uint64_t where, std::uint32_t id) {
    text.push_back(what);
    text.append(std::to_string(where)).append(std::to_string(id));
  }
  std::string text;
};

TEST_F(CanMotorBusTest, LockStepEndsATickWhenThePartnerSaysSo) {
  Record record;
  make_bus(true, &record);
  left.partner = right.partner = true;
  right.delay = 300'000'000;  // as slow as it likes
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  const std::int64_t start = clock.now;
  record.text.clear();
  EXPECT_EQ(bus->exchange(commands, states, 0), BusStatus::kOk);
  EXPECT_EQ(clock.now - start, 300'000'000);
  EXPECT_EQ(states[2].age, 0u);
  EXPECT_EQ(record.text.substr(0, record.text.find('t')), "s01s02s13r01025r01026r11027");
  left.deaf = true;  // its replies get lost, the tick still ends
  EXPECT_EQ(bus->exchange(commands, states, 0), BusStatus::kLate);
  EXPECT_TRUE(stale(0) && stale(1) && !stale(2));
  bus.reset();  // before its observer
}

TEST_F(CanMotorBusTest, LockStepWithoutAPartner) {
  make_bus(true);
  left.partner = true;
  EXPECT_EQ(bus->enable(), BusStatus::kDown);
  EXPECT_EQ(bus->trouble().what, BusTrouble::kNoPartner);
  EXPECT_EQ(bus->trouble().bus, 1u);
  for (const test::BenchMitDrive& drive : drives) EXPECT_TRUE(drive.heard.empty());
}

TEST_F(CanMotorBusTest, LockStepPartnerThatGoesAway) {
  make_bus(true);
  left.partner = right.partner = true;
  ASSERT_EQ(bus->enable(), BusStatus::kOk);
  EXPECT_EQ(bus->exchange(commands, states, 0), BusStatus::kOk);
  right.partner = false;
  EXPECT_EQ(bus->exchange(commands, states, 0), BusStatus::kDown);
  EXPECT_EQ(bus->trouble().what, BusTrouble::kNoPartner);
  const std::int64_t start = clock.now;
  bus->disable();
  EXPECT_LT(clock.now - start, 1'000'000'000);
}

}  // namespace
}  // namespace clamber
