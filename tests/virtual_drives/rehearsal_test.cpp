// The host's own code on simulated buses and drives, all in this process.
#include <gtest/gtest.h>

#include <memory>

#include "firmware_hal/bus_model/bus_budget.hpp"
#include "firmware_hal/candump.hpp"
#include "firmware_hal/lock_step.hpp"
#include "firmware_hal/virtual_drives/bench_plant.hpp"
#include "firmware_hal/virtual_drives/drive_server.hpp"
#include "firmware_hal/virtual_drives/rehearsal_bus.hpp"
#include "robot_model/sha256.hpp"
#include "tests/firmware_hal/coman_map.hpp"

namespace clamber {
namespace {

/// Every frame of a rehearsal as text.
class Transcript final : public FrameObserver {
 public:
  void sent(std::size_t bus, const CanFrame& frame) noexcept override { add(bus, frame); }
  void received(std::size_t bus, const CanFrame& frame) noexcept override { add(bus, frame); }
  void tick_ended(std::uint64_t tick) noexcept override { text += std::to_string(tick) + '\n'; }
  std::string text;

 private:
  void add(std::size_t bus, const CanFrame& frame) {
    text += format_candump(0, "can" + std::to_string(bus), frame) + '\n';
  }
};

class Rehearsal : public testing::TestWithParam<const char*> {
 protected:
  explicit Rehearsal(FrameObserver* observer = nullptr)
      : map(test::shipped_map(GetParam())),
        plant(std::vector<BenchJoint>(23, BenchJoint{.load = 2.0})),
        bus(map, plant, observer) {}

  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) {
      for (std::size_t j = 0; j < states.size(); ++j)
        commands[j].tau = 30.0 * (commands[j].q - states[j].q) - 5.0 * states[j].dq - 2.0;
      status = bus.exchange(commands, states, 0);
    }
  }

  BusMap map;
  BenchPlant plant;
  RehearsalBus bus;
  std::array<JointCommand, 23> commands{};
  std::array<JointState, 23> states{};
  BusStatus status = BusStatus::kOk;
};

TEST_P(Rehearsal, HoldsARobotAndLetsItGo) {
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  EXPECT_TRUE(bus.drives().released());
  run(1000);
  EXPECT_EQ(status, BusStatus::kOk);
  for (const JointState& state : states) {
    EXPECT_EQ(state.flags, kJointEnabled);
    EXPECT_NEAR(state.q, 0.0, 0.05);
  }
  EXPECT_EQ(bus.counters().missing_replies, 0u);
  bus.disable();
  EXPECT_EQ(bus.drives().finished_runs(), 1u);
}

/// The budget's response times bound what the simulated buses show.
TEST_P(Rehearsal, RepliesComeWithinTheBudget) {
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  run(500);
  const std::vector<BusBudget> budgets = bus_budgets(map);
  for (std::size_t b = 0; b < map.buses.size(); ++b) {
    const double slowest =
        1e-9 * static_cast<double>(bus.bus().segment_counters(b).slowest_reply_ns);
    EXPECT_LE(slowest, budgets[b].response) << map.buses[b].name;
    EXPECT_GE(slowest, 0.5 * budgets[b].response) << map.buses[b].name;
  }
}

TEST_P(Rehearsal, TwoAreTheSameToTheLastFrame) {
  std::array<std::string, 2> hashes;
  for (std::string& hash : hashes) {
    Transcript transcript;
    BenchPlant joints(std::vector<BenchJoint>(23, BenchJoint{.load = 2.0}));
    RehearsalBus other(map, joints, &transcript);
    ASSERT_EQ(other.enable(), BusStatus::kOk);
    for (int i = 0; i < 300; ++i) {
      for (std::size_t j = 0; j < states.size(); ++j) commands[j].tau = -20.0 * states[j].q - 2.0;
      (void)other.exchange(commands, states, 0);
    }
    other.disable();
    EXPECT_GT(transcript.text.size(), 300u * 46u * 10u);
    hash = sha256_hex(transcript.text);
    states = {};
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

/// On the stand nothing moves, whatever pulls; a drive that lets go by itself lets it fall.
TEST_P(Rehearsal, StandHoldsUntilAllAreOn) {
  const double before = plant.joint(5).q;
  for (int i = 0; i < 100; ++i) bus.drives().step();
  EXPECT_EQ(plant.joint(5).q, before);
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  run(100);
  const PlacedDrive& broken = bus.drives().bus(0)[0];
  broken.drive->break_down(0);
  const auto joint = static_cast<std::size_t>(broken.mounting.joint);
  const double held = plant.joint(joint).q;
  run(200);
  EXPECT_EQ(bus.drives().finished_runs(), 0u);
  EXPECT_GT(plant.joint(joint).q, held + 0.05);
}

INSTANTIATE_TEST_SUITE_P(Maps, Rehearsal, testing::Values("coman_mit.yaml", "coman_cia402.yaml"),
                         [](const auto& map) {
                           return std::string(map.param) == "coman_mit.yaml" ? "mit" : "cia402";
                         });

/// Two ports joined back to back, and a clock that is only a number.
class Pipe final : public FramePort {
 public:
  SendResult send(std::span<const CanFrame> frames) noexcept override {
    for (const CanFrame& frame : frames) other->inbox.push_back({frame, 0});
    return {frames.size(), SendStatus::kOk};
  }
  std::size_t receive(std::span<ReceivedFrame> into) noexcept override {
    const std::size_t count = std::min(into.size(), inbox.size());
    std::copy_n(inbox.begin(), count, into.begin());
    inbox.erase(inbox.begin(), inbox.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }
  bool discard_unsent() noexcept override { return true; }
  bool has_unsent() noexcept override { return false; }
  void maintain(std::int64_t) noexcept override {}
  PortState state() const noexcept override { return PortState::kActive; }
  const PortCounters& counters() const noexcept override { return counters_; }

  Pipe* other = nullptr;
  std::vector<ReceivedFrame> inbox;

 private:
  PortCounters counters_;
};

class Number final : public PortClock {
 public:
  std::int64_t now_ns() noexcept override { return now; }
  void wait(std::int64_t until) noexcept override { now = std::max(now, until); }
  std::int64_t now = 0;
};

class Server : public testing::Test {
 protected:
  Server() {
    for (int i = 0; i < 5; ++i) {
      host[i].other = &drive_side[i];
      drive_side[i].other = &host[i];
      ports.push_back(&drive_side[i]);
    }
    server = std::make_unique<DriveServer>(drives, clock, ports, DriveServerSettings{});
  }
  void mark(std::size_t bus, std::uint32_t tick) {
    const CanFrame frame = encode_lock_step(LockStepMark::kSent, tick);
    (void)host[bus].send({&frame, 1});
  }
  /// What the host hears on a bus, and what its last frame marks.
  std::pair<std::size_t, std::int64_t> heard(std::size_t bus) {
    const std::size_t count = host[bus].inbox.size();
    std::uint32_t tick = 0;
    const bool done =
        count > 0 && decode_lock_step(host[bus].inbox.back().frame, tick) == LockStepMark::kDone;
    host[bus].inbox.clear();
    return {count, done ? static_cast<std::int64_t>(tick) : -1};
  }

  BusMap map = test::shipped_map("coman_mit.yaml");
  BenchPlant plant{std::vector<BenchJoint>(23)};
  VirtualDrives drives{map, plant};
  Number clock;
  std::array<Pipe, 5> host;
  std::array<Pipe, 5> drive_side;
  std::vector<FramePort*> ports;
  std::unique_ptr<DriveServer> server;
};

TEST_F(Server, ATickPassesWhenEveryBusHasSaidSo) {
  for (std::size_t b = 0; b < 5; ++b) mark(b, 0);
  (void)server->serve(clock.now + 1);
  for (std::size_t b = 0; b < 5; ++b)
    EXPECT_EQ(heard(b), std::pair(std::size_t{1}, std::int64_t{0}));
  const std::uint64_t steps = drives.steps();
  const CanFrame off =
      encode_mit_special(mit_drive(map.buses[0], map.buses[0].drives[0]), MitSpecial::kDisable);
  (void)host[0].send({&off, 1});
  for (std::size_t b = 0; b < 4; ++b) mark(b, 1);
  EXPECT_FALSE(server->serve(clock.now + 1000));
  EXPECT_EQ(heard(0).first, 0u);  // its answer waits for the end of the tick
  mark(4, 1);
  EXPECT_TRUE(server->serve(clock.now + 1000));
  EXPECT_EQ(drives.steps(), steps + 1);
  EXPECT_EQ(heard(0), std::pair(std::size_t{2}, std::int64_t{1}));
  mark(2, 1);  // asked again, answered again; nothing passes
  (void)server->serve(clock.now + 1000);
  EXPECT_EQ(heard(2).second, 1);
  EXPECT_EQ(drives.steps(), steps + 1);
}

TEST_F(Server, AHostThatIsGoneLeavesTimeToTheClock) {
  for (std::size_t b = 0; b < 5; ++b) mark(b, 0);
  (void)server->serve(clock.now + 1);
  const std::uint64_t steps = drives.steps();
  const std::int64_t start = clock.now;
  while (clock.now < start + 499'000'000) (void)server->serve(start + 499'000'000);
  EXPECT_EQ(drives.steps(), steps);
  while (clock.now < start + 1'000'000'000) (void)server->serve(start + 1'000'000'000);
  EXPECT_NEAR(static_cast<double>(drives.steps() - steps), 500.0, 25.0);
  EXPECT_TRUE(server->host_silent());
}

}  // namespace
}  // namespace clamber
