// Whatever happens on the network and to the publisher, the tick sends the same commands: its log
// is byte for byte that of a run without telemetry, and counters tell what was lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <iostream>
#include <map>
#include <random>
#include <thread>

#include "apps/executor.hpp"
#include "apps/run_log.hpp"
#include "telemetry/publisher.hpp"
#include "telemetry/publisher_process.hpp"
#include "tests/apps/plant_bus.hpp"
#include "tests/telemetry/malformed.hpp"
#include "tests/telemetry/processes.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
using test::Child;
using test::Datagram;
using test::Listener;
using test::mutated;
using test::next_domain;
using test::send_to_all;
using testing::HasSubstr;

constexpr std::uint32_t kJoints = 3;
constexpr std::size_t kKeyframes = 9;  // 0.8 s, and half a second before and after
// As long as it takes to find out that a publisher hangs, and to start one twice.
constexpr std::size_t kManyKeyframes = 40;
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

/// Runs a plan of so many keyframes; @return the log's bytes.
std::string run_plan(std::size_t keyframes, bool realtime, TelemetryPort* port,
                     ExecutorReport& report) {
  static int runs = 0;
  const std::filesystem::path file = temporary(std::to_string(++runs) + ".log");
  const ControllerConfig control = test::make_config(kJoints);
  const std::vector<std::byte> image =
      test::make_image(kJoints, test::smooth_keyframes(kJoints, keyframes));
  std::vector<double> workspace(Controller::workspace_size(keyframes));
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

const std::string& undisturbed(std::size_t keyframes) {
  static std::map<std::size_t, std::string> logs;
  std::string& log = logs[keyframes];
  ExecutorReport report;
  if (log.empty()) log = run_plan(keyframes, false, nullptr, report);
  return log;
}

struct Outcome {
  std::size_t keyframes = kKeyframes;
  std::string log;
  ExecutorReport report;
  PublisherCounters counters;
  std::vector<std::string> events;  ///< the last ones
};

/// A paced run with the publisher in a process of its own; `disturb` goes on beside it.
using Disturbance = std::function<void(const PublisherProcess&, const std::stop_token& over)>;
Outcome run_disturbed(int domain, const Disturbance& disturb, std::size_t keyframes = kKeyframes) {
  TelemetryMemory memory(TelemetryMemory::Kind::kShared);
  TelemetryPort port(memory.block());
  PublisherProcess publisher(config(domain), description(), memory, {self(), kPublisherRole});
  std::jthread beside([&](const std::stop_token& over) { disturb(publisher, over); });
  Outcome outcome;
  outcome.keyframes = keyframes;
  outcome.log = run_plan(keyframes, true, &port, outcome.report);
  beside.request_stop();
  beside.join();
  publisher.stop();
  outcome.counters = counters_of(memory.block());
  const PublisherState& state = memory.block().publisher;
  for (std::size_t i = 0; i < std::min<std::size_t>(state.events, state.kept.size()); ++i)
    outcome.events.emplace_back(state.kept[i].view());
  return outcome;
}

void expect_same_commands(const Outcome& outcome) {
  EXPECT_EQ(outcome.report.status, TickStatus::kFinished);
  EXPECT_TRUE(outcome.log == undisturbed(outcome.keyframes)) << "the tick did something else";
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

TEST(Hostile, PublisherProcessHangsAndIsKilled) {
  const Outcome outcome = run_disturbed(
      next_domain(),
      [&](const PublisherProcess& publisher, const std::stop_token& over) {
        for (const int signal : {SIGSTOP, SIGKILL}) {
          std::this_thread::sleep_for(200ms);
          const int process = publisher.process_id();
          ASSERT_GT(process, 0);
          kill(process, signal);
          while (!over.stop_requested() &&
                 (publisher.process_id() < 0 || publisher.process_id() == process))
            std::this_thread::sleep_for(1ms);
        }
      },
      kManyKeyframes);
  expect_same_commands(outcome);
  EXPECT_GE(outcome.counters.restarts, 2U);
  EXPECT_EQ(outcome.counters.hangs, 1U);
  EXPECT_EQ(outcome.counters.ring_drops, 0U) << "four seconds of frames have room";
  EXPECT_LE(outcome.counters.gaps, 20U) << "more than what it had in its hands";
  EXPECT_THAT(outcome.events,
              testing::Contains(HasSubstr("started again: 1 times so far, 1 hung")));
}

// The events: mode, phases, and that it was started again, also for who comes only now.
TEST(Hostile, WhoComesLateLearnsThatThePublisherWasRestarted) {
  const int domain = next_domain();
  TelemetryMemory memory(TelemetryMemory::Kind::kShared);
  TelemetryPort port(memory.block());
  PublisherProcess publisher(config(domain), description(), memory, {self(), kPublisherRole});
  ExecutorReport report;
  static_cast<void>(run_plan(kKeyframes, false, &port, report));
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
              HasSubstr("telemetry: the publisher died and was started again: 1 times"));
  EXPECT_THAT(monitor.output(), HasSubstr("check passed: max(fault) == 0"));
  EXPECT_THAT(monitor.output(), HasSubstr("check FAILED: max(|tau|) < 0.001: 0.5 at b in "));
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
  if (outcome.log != undisturbed(kKeyframes)) return 4;
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

// Too late to be replaced: what it never published is counted.
TEST(PublisherProcess, HangsAtTheEnd) {
  TelemetryMemory memory(TelemetryMemory::Kind::kShared);
  TelemetryPort port(memory.block());
  PublisherProcess publisher(config(next_domain()), description(), memory,
                             {self(), kPublisherRole});
  kill(publisher.process_id(), SIGSTOP);
  std::this_thread::sleep_for(20ms);
  TelemetryFrame frame;
  for (; frame.sequence < 100; ++frame.sequence) static_cast<void>(port.push(frame, {}));
  publisher.stop();
  const PublisherCounters counters = counters_of(memory.block());
  EXPECT_EQ(counters.frames, 0U);
  EXPECT_EQ(counters.gaps, 100U);
  EXPECT_EQ(counters.hangs, 1U);
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
