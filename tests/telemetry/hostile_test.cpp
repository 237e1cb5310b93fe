// Whatever happens on the network and to the publisher, the tick sends the same commands: its log
// is byte for byte that of a run without telemetry, and counters tell what was lost.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sys/mount.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <iostream>
#include <random>
#include <thread>

#include "apps/executor.hpp"
#include "apps/run_log.hpp"
#include "telemetry/publisher.hpp"
#include "telemetry/publisher_process.hpp"
#include "tests/apps/plant_bus.hpp"
#include "tests/telemetry/processes.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
using test::Child;
using test::next_domain;
using testing::HasSubstr;

constexpr std::uint32_t kJoints = 3;
constexpr std::size_t kKeyframes = 14;  // 1.3 s, and half a second before and after
constexpr const char* kPublisherRole = "telemetry-publisher";
constexpr const char* kFullRole = "run-with-full-shm";

std::string self() { return std::filesystem::read_symlink("/proc/self/exe"); }

TelemetryConfig config(int domain) {
  TelemetryConfig c;
  c.domain = domain;
  c.robot = "test_robot";
  return c;
}

TelemetryDescription description() {
  TelemetryDescription d;
  d.joint_names = {"a", "b", "c"};
  d.torque_limits.assign(kJoints, 30.0);
  return d;
}

std::filesystem::path temporary(const std::string& name) {
  return std::filesystem::path(testing::TempDir()) /
         ("clamber_hostile_" + std::to_string(getpid()) + "_" + name);
}

/// Runs the plan; @return the log's bytes.
std::string run_plan(bool realtime, TelemetryPort* port, ExecutorReport& report) {
  static int runs = 0;
  const std::filesystem::path file = temporary(std::to_string(++runs) + ".log");
  const ControllerConfig control = test::make_config(kJoints);
  const std::vector<std::byte> image =
      test::make_image(kJoints, test::smooth_keyframes(kJoints, kKeyframes));
  std::vector<double> workspace(Controller::workspace_size(kKeyframes));
  Controller controller;
  EXPECT_EQ(controller.load(control, test::kRobotHash, image, workspace).status, LoadStatus::kOk);
  test::PlantBus bus(kJoints);
  RunLogHeader header;
  header.joint_names = description().joint_names;
  RunLogWriter log(file, header, log_capacity(controller, realtime));
  ExecutorOptions options{.realtime = realtime};
  options.log = &log;
  options.telemetry = port;
  report = execute(controller, bus, options);
  std::ostringstream bytes;
  bytes << std::ifstream(file, std::ios::binary).rdbuf();
  std::filesystem::remove(file);
  return bytes.str();
}

const std::string& undisturbed() {
  static const std::string bytes = [] {
    ExecutorReport report;
    return run_plan(false, nullptr, report);
  }();
  return bytes;
}

struct Outcome {
  std::string log;
  ExecutorReport report;
  PublisherCounters counters;
};

/// A paced run with the publisher in a process of its own; `disturb` goes on beside it.
using Disturbance = std::function<void(const PublisherProcess&, const std::stop_token& over)>;
Outcome run_disturbed(int domain, const Disturbance& disturb) {
  TelemetryMemory memory(TelemetryMemory::Kind::kShared);
  TelemetryPort port(memory.block());
  PublisherProcess publisher(config(domain), description(), memory, {self(), kPublisherRole});
  std::jthread beside([&](const std::stop_token& over) { disturb(publisher, over); });
  Outcome outcome;
  outcome.log = run_plan(true, &port, outcome.report);
  beside.request_stop();
  beside.join();
  publisher.stop();
  outcome.counters = counters_of(memory.block());
  return outcome;
}

void expect_same_commands(const Outcome& outcome) {
  EXPECT_EQ(outcome.report.status, TickStatus::kFinished);
  EXPECT_TRUE(outcome.log == undisturbed()) << "the tick did something else";
  // Every tick was published or is counted as lost.
  EXPECT_EQ(outcome.counters.frames + outcome.counters.gaps, outcome.report.ticks);
}

std::vector<std::string> subscriber(int domain, const char* seconds) {
#ifdef CYCLONE_PEER
  test::configure_cyclone();
  return {CYCLONE_PEER, std::to_string(domain), "1000000", seconds};
#else
  return {MONITOR_PROCESS, std::to_string(domain), seconds, "20"};
#endif
}

TEST(Hostile, SubscribersThatStallDawdleCrashAndComeLate) {
  const int domain = next_domain();
  Child stalled(subscriber(domain, "20"));
  Child slow(subscriber(domain, "20"));
  Child crashing(subscriber(domain, "20"));
  std::this_thread::sleep_for(500ms);
  const Outcome outcome = run_disturbed(
      domain, [&](const PublisherProcess& /*publisher*/, const std::stop_token& over) {
        std::this_thread::sleep_for(300ms);
        stalled.send(SIGSTOP);
        std::this_thread::sleep_for(200ms);
        crashing.send(SIGKILL);
        Child late(subscriber(domain, "20"));
        while (!over.stop_requested()) {  // awake for a tenth of its time
          slow.send(SIGSTOP);
          std::this_thread::sleep_for(90ms);
          slow.send(SIGCONT);
          std::this_thread::sleep_for(10ms);
        }
      });
  expect_same_commands(outcome);
  EXPECT_EQ(outcome.counters.frames, outcome.report.ticks) << "a subscriber held the others up";
  EXPECT_EQ(outcome.counters.ring_drops, 0U);
  EXPECT_EQ(outcome.counters.restarts, 0U);
}

TEST(Hostile, PublisherProcessIsKilledTwice) {
  const int domain = next_domain();
  const Outcome outcome =
      run_disturbed(domain, [&](const PublisherProcess& publisher, const std::stop_token& over) {
        for (int killed = 0; killed < 2 && !over.stop_requested(); ++killed) {
          std::this_thread::sleep_for(200ms);
          const int process = publisher.process_id();
          ASSERT_GT(process, 0);
          kill(process, SIGKILL);
          while (!over.stop_requested() &&
                 (publisher.process_id() < 0 || publisher.process_id() == process))
            std::this_thread::sleep_for(1ms);
          std::this_thread::sleep_for(200ms);
        }
      });
  expect_same_commands(outcome);
  EXPECT_GE(outcome.counters.restarts, 2U);
  EXPECT_EQ(outcome.counters.ring_drops, 0U) << "four seconds of frames have room";
  EXPECT_LE(outcome.counters.gaps, 20U) << "more than what it had in its hands";
}

// The events: mode, phases, and that it was started again, also for who comes only now.
TEST(Hostile, WhoComesLateLearnsThatThePublisherWasRestarted) {
  const int domain = next_domain();
  TelemetryMemory memory(TelemetryMemory::Kind::kShared);
  TelemetryPort port(memory.block());
  PublisherProcess publisher(config(domain), description(), memory, {self(), kPublisherRole});
  ExecutorReport report;
  static_cast<void>(run_plan(false, &port, report));
  std::this_thread::sleep_for(200ms);
  kill(publisher.process_id(), SIGKILL);
  while (memory.block().publisher.starts < 2) std::this_thread::sleep_for(1ms);
  Child monitor({MONITOR_PROCESS, std::to_string(domain), "0.7", "10", "", "max(fault) == 0",
                 "max(|tau|) < 0.001"});
  TelemetryFrame frame;
  frame.sequence = report.ticks;
  frame.joint_count = kJoints;
  frame.tau_meas[1] = 0.5;
  for (; monitor.running() && frame.sequence < report.ticks + 10'000; ++frame.sequence) {
    static_cast<void>(port.push(frame, {}));
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_EQ(monitor.wait(), 2) << "MonitorOutcome::kCheckFailed";
  EXPECT_THAT(monitor.output(), HasSubstr("mode: moving to start -> executing"));
  EXPECT_THAT(monitor.output(), HasSubstr("phase: phase 2"));
  EXPECT_THAT(monitor.output(),
              HasSubstr("telemetry: the publisher's process died and was started"));
  EXPECT_THAT(monitor.output(), HasSubstr("check passed: max(fault) == 0"));
  EXPECT_THAT(monitor.output(), HasSubstr("check FAILED: max(|tau|) < 0.001: 0.5 at b in "));
}

// ---- malformed datagrams

using Datagram = std::vector<std::uint8_t>;

/// RTPS standard, 9.6.2.3.
int port_of(int domain, int offset) { return 7400 + 250 * domain + offset; }

/// Looks at everything on the loopback; where that is not allowed, at what is sent to a participant
/// that does not exist: announcements only.
class Listener {
 public:
  explicit Listener(int domain) : domain_(domain) {
    socket_ = socket(AF_PACKET, SOCK_DGRAM | SOCK_NONBLOCK, htons(ETH_P_IP));
    raw_ = socket_ >= 0;
    if (raw_) return;
    socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port_of(domain, 10 + 2 * 9)));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  }
  ~Listener() { close(socket_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  std::vector<Datagram> hear(std::chrono::milliseconds time, std::size_t at_most) {
    std::vector<Datagram> heard;
    const auto until = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < until && heard.size() < at_most) {
      Datagram packet(65536);
      const ssize_t size = recv(socket_, packet.data(), packet.size(), 0);
      if (size <= 0) {
        std::this_thread::sleep_for(1ms);
        continue;
      }
      packet.resize(static_cast<std::size_t>(size));
      if (raw_ && !strip_headers(packet)) continue;
      if (packet.size() > 20 && std::equal(packet.begin(), packet.begin() + 4, "RTPS"))
        heard.push_back(std::move(packet));
    }
    return heard;
  }

 private:
  /// @return it was UDP, to a port of the domain
  bool strip_headers(Datagram& packet) const {
    if (packet.size() < 28 || packet[9] != IPPROTO_UDP) return false;
    const std::size_t ip = 4U * (packet[0] & 15U);
    if (packet.size() < ip + 8) return false;
    const int port = packet[ip + 2] * 256 + packet[ip + 3];
    packet.erase(packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(ip + 8));
    return port >= port_of(domain_, 0) && port < port_of(domain_ + 1, 0);
  }

  int domain_;
  int socket_ = -1;
  bool raw_ = false;
};

/// Changes, cuts or lengthens a real datagram, most often behind the header that gets it looked at.
Datagram mutated(Datagram datagram, std::mt19937& random) {
  const auto pick = [&random](std::size_t below) {
    return std::uniform_int_distribution<std::size_t>(0, below - 1)(random);
  };
  const std::size_t changes = 1 + pick(8);
  const std::size_t first = pick(8) == 0 ? 0 : 20;
  for (std::size_t i = 0; i < changes; ++i)
    datagram[first + pick(datagram.size() - first)] = static_cast<std::uint8_t>(pick(256));
  if (pick(4) == 0) datagram.resize(4 + pick(datagram.size() - 4));
  if (pick(8) == 0)
    datagram.insert(datagram.end(), pick(2000), static_cast<std::uint8_t>(pick(256)));
  return datagram;
}

/// To all of the first participants' ports, multicast's among them.
void send_to_all(const std::vector<Datagram>& datagrams, int domain) {
  const int out = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  for (const Datagram& datagram : datagrams)
    for (const int offset : {0, 1, 10, 11, 12, 13, 14, 15}) {
      address.sin_port = htons(static_cast<std::uint16_t>(port_of(domain, offset)));
      static_cast<void>(sendto(out, datagram.data(), datagram.size(), 0,
                               reinterpret_cast<sockaddr*>(&address), sizeof address));
    }
  close(out);
}

TEST(Hostile, AThousandMalformedDatagrams) {
  constexpr std::size_t kDatagrams = 1000;
  const int domain = next_domain();
  Child peer(subscriber(domain, "20"));
  std::size_t real = 0;
  std::vector<Datagram> malformed;
  const Outcome outcome = run_disturbed(
      domain, [&](const PublisherProcess& /*publisher*/, const std::stop_token& /*over*/) {
        Listener listener(domain);
        const std::vector<Datagram> heard = listener.hear(600ms, 2000);
        real = heard.size();
        if (heard.empty()) return;
        std::mt19937 random(20261122);
        for (std::size_t i = 0; i < kDatagrams; ++i)
          malformed.push_back(mutated(heard[random() % heard.size()], random));
        send_to_all(malformed, domain);
      });
  ASSERT_GT(real, 0U) << "nothing was heard that could be mutated";
  EXPECT_EQ(malformed.size(), kDatagrams);
  expect_same_commands(outcome);
  // Debian's Fast DDS 2.9.1 dies of it (an assertion about a statistics submessage) and is started
  // again, which is the point of its own process.
  std::cout << real << " real datagrams heard; the publisher was restarted "
            << outcome.counters.restarts << " times, " << outcome.counters.gaps << " frames lost\n";
}

// ---- full /dev/shm

/// In a mount namespace of its own. @return 0: as it should be; 77: not allowed here
int run_with_full_shm() {
  if (mount("tmpfs", "/dev/shm", "tmpfs", 0, "size=64k") != 0) return 77;
  {
    std::ofstream filler("/dev/shm/filler");
    const std::string block(4096, 'x');
    while (filler.write(block.data(), 4096).flush()) {
    }
  }
  const auto entries = [] {
    return std::distance(std::filesystem::directory_iterator("/dev/shm"), {});
  };
  if (entries() != 1) return 3;
  const Outcome outcome = run_disturbed(next_domain(), [](const auto&, const auto&) {});
  if (outcome.log != undisturbed()) return 4;
  if (outcome.counters.frames != outcome.report.ticks) return 5;
  return entries() == 1 ? 0 : 6;
}

TEST(Hostile, FullSharedMemory) {
  Child run({"/usr/bin/unshare", "--mount", "--propagation", "private", self(), kFullRole});
  const int result = run.wait();
  // unshare itself ends with 1 where it is not allowed.
  if (result == 77 || result == 1) GTEST_SKIP() << "skipped: no mount namespaces here";
  EXPECT_EQ(result, 0);
}

TEST(PublisherProcess, LeavesNothingBehindWhenItsParentIsGone) {
  // What Fast DDS or we would leave there; other programs come and go.
  const auto in_shm = [] {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator("/dev/shm")) {
      const std::string name = entry.path().filename();
      if (name.starts_with("fast") || name.starts_with("clamber-telemetry")) names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    return names;
  };
  const auto before = in_shm();
  int process = -1;
  {
    TelemetryMemory memory(TelemetryMemory::Kind::kShared);
    PublisherProcess publisher(config(next_domain()), description(), memory,
                               {self(), kPublisherRole});
    process = publisher.process_id();
    EXPECT_EQ(kill(process, 0), 0);
    // Ctrl-C reaches the whole group, and is none of its business.
    kill(process, SIGINT);
    std::this_thread::sleep_for(50ms);
    EXPECT_EQ(publisher.process_id(), process);
  }
  EXPECT_NE(kill(process, 0), 0) << "it still runs";
  EXPECT_EQ(in_shm(), before);
}

TEST(PublisherProcess, SaysWhyItCannotBeStarted) {
  TelemetryMemory memory(TelemetryMemory::Kind::kShared);
  EXPECT_THROW(PublisherProcess(config(next_domain()), description(), memory, {"/no/such/program"}),
               std::runtime_error);
  EXPECT_THROW(PublisherProcess(config(next_domain()), description(), memory, {"/bin/true"}),
               std::runtime_error);
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  const std::string role = argc > 1 ? argv[1] : "";
  if (role == clamber::kPublisherRole) {
    clamber::run_publisher_process();
    return 0;
  }
  if (role == clamber::kFullRole) return clamber::run_with_full_shm();
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
