// SocketCAN ports and the motor bus on real AF_CAN sockets.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <thread>

#include "firmware_hal/socketcan/interface_check.hpp"
#include "firmware_hal/socketcan/socketcan_bus.hpp"
#include "robot_model/loader.hpp"
#include "tests/control/allocation_guard.hpp"
#include "tests/firmware_hal/bench_drives.hpp"
#include "tests/firmware_hal/coman_map.hpp"
#include "tests/firmware_hal/random_frame.hpp"
#include "tests/vcan/vcan.hpp"

namespace clamber {
namespace {

constexpr const char* kInterface = "can0";

SocketCanSettings settings(const std::string& interface, bool fd = true) {
  return {interface, fd, "map.yaml: bus 'test'", "bitrate 1000000 dbitrate 5000000 fd on"};
}

bool shell(const std::string& command) { return std::system(command.c_str()) == 0; }

std::vector<ReceivedFrame> receive(SocketCanPort& port) {
  std::vector<ReceivedFrame> frames(4096);
  frames.resize(port.receive(frames));
  return frames;
}

TEST(VcanPort, CarriesClassicAndFdFramesWithTheirTimes) {
  CLAMBER_NEEDS_VCAN(kInterface);
  SocketCanPort a(settings(kInterface));
  SocketCanPort b(settings(kInterface));
  SocketCanClock clock({&b});
  std::mt19937_64 random(4);
  for (int i = 0; i < 2000; ++i) {
    CanFrame frame = test::random_frame(random, i % 2 == 0, i % 3 == 0);
    if (frame.remote) frame.data = {};
    const std::int64_t before = clock.now_ns();
    ASSERT_EQ(a.send({&frame, 1}).status, SendStatus::kOk);
    clock.wait(before + 1'000'000'000);
    const auto received = receive(b);
    ASSERT_EQ(received.size(), 1u);
    ASSERT_EQ(received[0].frame, frame);
    ASSERT_GE(received[0].time_ns, before - 2'000'000);  // the clocks are compared once a second
    ASSERT_LE(received[0].time_ns, clock.now_ns() + 2'000'000);
  }
  EXPECT_TRUE(receive(a).empty());  // not its own
  EXPECT_FALSE(a.has_unsent());
  EXPECT_TRUE(a.discard_unsent());
}

TEST(VcanPort, BurstsKeepTheirOrderAndWhatIsLostIsCounted) {
  CLAMBER_NEEDS_VCAN(kInterface);
  SocketCanPort a(settings(kInterface));
  SocketCanPort b(settings(kInterface));
  (void)stay_on_this_processor();
  std::vector<CanFrame> burst;
  for (std::uint32_t id = 0; id < 500; ++id) burst.push_back(make_frame(id, {}));
  ASSERT_EQ(a.send(burst).sent, burst.size());
  const auto received = receive(b);
  ASSERT_EQ(received.size(), burst.size());
  for (std::uint32_t id = 0; id < 500; ++id) ASSERT_EQ(received[id].frame.id, id);
  // Nobody reads: the receive queue overflows, and the kernel says by how much.
  for (int i = 0; i < 2000 && a.send(burst).sent > 0; ++i) {
  }
  std::uint64_t read = 0;
  for (auto frames = receive(b); !frames.empty(); frames = receive(b)) read += frames.size();
  ASSERT_EQ(a.send({burst.data(), 1}).sent, 1u);
  read += receive(b).size();
  EXPECT_GT(b.counters().overruns, 0u);
  EXPECT_EQ(read + b.counters().overruns, a.counters().sent - burst.size());
}

TEST(VcanPort, ErrorFramesOfTheInterfaceAreItsState) {
  CLAMBER_NEEDS_VCAN(kInterface);
  SocketCanPort port(settings(kInterface));
  const int other = ::socket(PF_CAN, SOCK_RAW, CAN_RAW);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(kInterface));
  ASSERT_EQ(bind(other, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const auto report = [&](canid_t classes, std::uint8_t controller) {
    can_frame raw{};
    raw.can_id = CAN_ERR_FLAG | classes;
    raw.can_dlc = 8;
    raw.data[1] = controller;
    EXPECT_EQ(write(other, &raw, sizeof raw), static_cast<ssize_t>(sizeof raw));
    EXPECT_TRUE(receive(port).empty());
    return port.state();
  };
  EXPECT_EQ(report(0x4, 0x08), PortState::kWarning);
  EXPECT_EQ(report(0x4, 0x20), PortState::kPassive);
  EXPECT_EQ(report(0x40, 0), PortState::kBusOff);
  EXPECT_EQ(report(0x100, 0), PortState::kActive);
  EXPECT_EQ(port.counters().bus_offs, 1u);
  close(other);
}

/// Frames are received when they leave the queue, not when they enter it (module parameter of
/// vcan).
bool vcan_echoes() {
  std::ifstream in("/sys/module/vcan/parameters/echo");
  return in.get() == 'Y';
}

/// A queueing discipline that holds everything back is a bus on which nobody acknowledges.
TEST(VcanPort, AStuckQueueIsSeenFillsUpAndIsThrownAway) {
  CLAMBER_NEEDS_VCAN(kInterface);
  if (!shell("tc qdisc add dev can0 root plug limit 7000 2>/dev/null"))
    GTEST_SKIP() << "this kernel has no sch_plug, or no privilege";
  SocketCanPort a(settings(kInterface));
  SocketCanPort b(settings(kInterface));
  const CanFrame frame = make_frame(0x55, std::array<std::uint8_t, 8>{});
  EXPECT_EQ(a.send({&frame, 1}).sent, 1u);
  EXPECT_TRUE(a.has_unsent());
  SendResult result{1, SendStatus::kOk};
  for (int i = 0; result.status == SendStatus::kOk && i < 10000; ++i) result = a.send({&frame, 1});
  EXPECT_EQ(result.status, SendStatus::kFull);  // ENOBUFS
  EXPECT_EQ(a.state(), PortState::kActive);
  const std::size_t before = receive(b).size();
  EXPECT_TRUE(before == 0 || !vcan_echoes());
  EXPECT_TRUE(a.discard_unsent());
  EXPECT_FALSE(a.has_unsent());
  EXPECT_EQ(a.counters().discarded, 1u);
  ASSERT_TRUE(shell("tc qdisc del dev can0 root"));
  // b saw the interface go down and takes it back. Of all that was queued nothing ever comes out.
  std::size_t seen = 0;
  for (std::int64_t now = 1; now < 3'000'000'000; now += 20'000'000) {
    b.maintain(now);
    seen += receive(b).size();
  }
  EXPECT_EQ(seen, 0u);
  EXPECT_EQ(b.state(), PortState::kActive);
  EXPECT_EQ(a.send({&frame, 1}).status, SendStatus::kOk);
  EXPECT_EQ(receive(b).size(), 1u);
}

TEST(VcanPort, AnInterfaceThatGoesAwayIsTakenBack) {
  CLAMBER_NEEDS_VCAN(kInterface);
  if (!shell("ip link add can77 type vcan 2>/dev/null && ip link set can77 mtu 72 up"))
    GTEST_SKIP() << "no privilege to make interfaces";
  SocketCanPort a(settings("can77"));
  const CanFrame frame = make_frame(1, {});
  std::int64_t now = 1'000'000'000;
  for (const bool unplugged : {false, true}) {
    ASSERT_TRUE(shell(unplugged ? "ip link del can77" : "ip link set can77 down"));
    EXPECT_EQ(a.send({&frame, 1}).status, SendStatus::kDown);
    EXPECT_EQ(a.state(), PortState::kDown);
    for (int i = 0; i < 100; ++i) a.maintain(now += 10'000'000);
    EXPECT_EQ(a.state(), PortState::kDown);
    ASSERT_TRUE(shell(unplugged ? "ip link add can77 type vcan && ip link set can77 mtu 72 up"
                                : "ip link set can77 up"));
    // At most the longest back-off later.
    for (int i = 0; i < 110 && a.state() == PortState::kDown; ++i) a.maintain(now += 10'000'000);
    EXPECT_EQ(a.state(), PortState::kActive);
    EXPECT_EQ(a.send({&frame, 1}).status, SendStatus::kOk);
  }
  EXPECT_EQ(a.counters().losses, 2u);
  EXPECT_EQ(a.counters().reopened, 2u);
  // Noticed by receiving as well.
  ASSERT_TRUE(shell("ip link del can77"));
  EXPECT_TRUE(receive(a).empty());
  EXPECT_EQ(a.state(), PortState::kDown);
}

std::string refusal(const SocketCanSettings& wanted) {
  try {
    const SocketCanPort port(wanted);
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    return error.what();
  }
  return "";
}

TEST(VcanPort, RefusesWhatIsNotFitForTheBus) {
  CLAMBER_NEEDS_VCAN(kInterface);
  EXPECT_EQ(refusal(settings(kInterface)), "");
  EXPECT_NE(refusal(settings("can55")).find("'can55': does not exist"), std::string::npos);
  EXPECT_NE(refusal(settings("can55")).find("there are can0"), std::string::npos);
  EXPECT_NE(refusal(settings("lo")).find("is no CAN interface"), std::string::npos);
  EXPECT_NE(refusal(settings("a_name_that_is_too_long")).find("at most 15"), std::string::npos);
  if (!shell("ip link add can78 type vcan 2>/dev/null && ip link set can78 mtu 16")) return;
  EXPECT_NE(refusal(settings("can78")).find("is set to classic CAN (MTU 16), the bus is CAN FD"),
            std::string::npos);
  EXPECT_NE(refusal(settings("can78", false)).find("is down: ip link set can78 up"),
            std::string::npos);
  EXPECT_TRUE(shell("ip link set can78 up"));
  EXPECT_EQ(refusal(settings("can78", false)), "");
  EXPECT_TRUE(shell("ip link del can78"));
}

/// Bench drives for every joint of the shipped map, in a thread of their own.
class BenchThread {
 public:
  explicit BenchThread(const BusMap& map) : ports_(open_ports(map)) {
    for (const Bus& bus : map.buses)
      for (const JointDrive& drive : bus.drives) {
        test::BenchMitDrive bench;
        bench.codec = mit_drive(bus, drive);
        bench.q = 0.01 * drive.joint;
        drives_.push_back(bench);
        bus_of_.push_back(static_cast<std::size_t>(&bus - map.buses.data()));
      }
    thread_ = std::thread([this] { run(); });
  }
  ~BenchThread() {
    stop_ = true;
    thread_.join();
  }
  int enabled() const {
    return static_cast<int>(std::count_if(drives_.begin(), drives_.end(),
                                          [](const auto& drive) { return drive.enabled; }));
  }

  std::atomic<bool> silent{false};

 private:
  void run() {
    std::vector<ReceivedFrame> frames(64);
    while (!stop_) {
      ports_.clock->wait(ports_.clock->now_ns() + 10'000'000);
      for (std::size_t b = 0; b < ports_.ports.size(); ++b)
        for (std::size_t count = ports_.ports[b]->receive(frames), i = 0; i < count; ++i)
          for (std::size_t d = 0; d < drives_.size(); ++d) {
            if (bus_of_[d] != b || silent) continue;
            drives_[d].heard.clear();
            (void)ports_.ports[b]->send(drives_[d].take(frames[i].frame));
          }
    }
  }

  SocketCanPorts ports_;
  std::vector<test::BenchMitDrive> drives_;
  std::vector<std::size_t> bus_of_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class VcanBus : public testing::Test {
 protected:
  /// A busy machine may not manage five complete ticks in a row at once.
  static bool switched_on(SocketCanBus& buses) {
    for (int i = 0; i < 6; ++i)
      if (buses.bus().enable() == BusStatus::kOk) return true;
    return false;
  }
  /// Ticks of 1 ms on the clock. @return how many were complete
  int ticks(CanMotorBus& bus, int count) {
    int complete = 0;
    std::int64_t next = 0;
    for (int i = 0; i < count; ++i) {
      timespec t{};
      clock_gettime(CLOCK_MONOTONIC, &t);
      const std::int64_t now = t.tv_sec * 1'000'000'000LL + t.tv_nsec;
      next = std::max(next + 1'000'000, now + 1'000'000);
      complete += bus.exchange(commands, states, next) == BusStatus::kOk ? 1 : 0;
      t.tv_sec = next / 1'000'000'000;
      t.tv_nsec = next % 1'000'000'000;
      clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
    }
    return complete;
  }
  std::vector<JointCommand> commands{23};
  std::vector<JointState> states{23};
};

TEST_F(VcanBus, RunsAllJointsSurvivesAnUnpluggedBusAndEndsOff) {
  CLAMBER_NEEDS_VCAN("can4");
  const BusMap map = test::shipped_map("coman_mit.yaml");
  BenchThread bench(map);
  SocketCanBus buses(map);
  ASSERT_TRUE(switched_on(buses)) << buses.trouble();
  EXPECT_EQ(bench.enabled(), 23);
  // A machine that is shared loses ticks; most of them would be another matter.
  EXPECT_GT(ticks(buses.bus(), 300), 60);
  for (std::size_t j = 0; j < states.size(); ++j) {
    EXPECT_NEAR(states[j].q, 0.01 * static_cast<double>(j), 1e-3);
    EXPECT_GT(states[j].sequence, 60u);
  }
  if (shell("ip link set can4 down 2>/dev/null")) {
    (void)ticks(buses.bus(), 50);
    EXPECT_EQ(buses.port(4).state(), PortState::kDown);
    for (const JointDrive& drive : map.buses[4].drives)
      EXPECT_GE(states[static_cast<std::size_t>(drive.joint)].age, 49u);
    for (const JointDrive& drive : map.buses[0].drives)
      EXPECT_LT(states[static_cast<std::size_t>(drive.joint)].age, 49u);
    ASSERT_TRUE(shell("ip link set can4 up"));
  }
  buses.bus().disable();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_LE(bench.enabled(), 3);  // the drives of can4 may have heard nothing since
  EXPECT_NE(buses.table().find("right_leg"), std::string::npos);
}

TEST_F(VcanBus, NamesTheSilentJointAndEnablesNobody) {
  CLAMBER_NEEDS_VCAN("can4");
  const BusMap map = test::shipped_map("coman_mit.yaml");
  SocketCanBus buses(map);
  EXPECT_EQ(buses.bus().enable(), BusStatus::kDown);
  EXPECT_NE(buses.trouble().find("coman_mit.yaml: bus 'right_leg' (can0): joint RHipSag (node 41) "
                                 "does not answer"),
            std::string::npos)
      << buses.trouble();
  EXPECT_EQ(buses.trouble().find('\n'), std::string::npos);
}

/// The path of the control thread: on real sockets, with replies, without, and while an interface
/// is lost and taken back.
TEST_F(VcanBus, ExchangeAllocatesNothing) {
  CLAMBER_NEEDS_VCAN("can4");
  if (!test::allocation_guard_works()) GTEST_SKIP() << "skipped: no guard under a sanitizer";
  const BusMap map = test::shipped_map("coman_mit.yaml");
  BenchThread bench(map);
  SocketCanBus buses(map);
  ASSERT_TRUE(switched_on(buses)) << buses.trouble();
  std::uint64_t calls = 0;
  std::uint64_t missing = 0;
  for (int part = 0; part < 3; ++part) {
    bench.silent = part == 1;
    if (part == 2)
      (void)shell("ip link set can3 down 2>/dev/null; ip link set can3 up 2>/dev/null");
    for (int i = 0; i < 200; ++i) {
      const test::AllocationGuard guard;
      missing += buses.bus().exchange(commands, states, 0) == BusStatus::kOk ? 0 : 1;
      calls += guard.calls();
    }
  }
  EXPECT_EQ(calls, 0u);
  EXPECT_GE(missing, 190u);
  const test::AllocationGuard guard;
  buses.bus().disable();
  EXPECT_EQ(guard.calls(), 0u);
}

}  // namespace
}  // namespace clamber
