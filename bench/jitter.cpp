// Wake-up lateness of the executor against cyclictest (rt-tests): the same priority, interval and
// time in one run, in slices that take turns, so that both meet the same machine.
// Usage: jitter [--seconds 60] [--slice 5] [--priority 80] [--stress] [--processor N]
// --stress: under `stress-ng` with two processors, memory, files and timers busy.
// Both are told in cyclictest's microseconds, rounded down. See docs/realtime.md.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "apps/executor.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

constexpr std::uint32_t kJoints = 23;
constexpr int kHistogram = 100'000;  // us; cyclictest counts what is beyond and keeps the maximum

struct Options {
  double seconds = 60.0;
  double slice = 5.0;
  int priority = 80;
  int processor = -1;
  bool stress = false;
};

/// us, rounded down, and how often.
using Counts = std::map<std::int64_t, std::uint64_t>;

std::int64_t percentile(const Counts& counts, double share) {
  std::uint64_t all = 0;
  for (const auto& [us, count] : counts) all += count;
  std::uint64_t seen = 0;
  for (const auto& [us, count] : counts) {
    seen += count;
    if (static_cast<double>(seen) >= share * static_cast<double>(all)) return us;
  }
  return 0;
}

/// Drives that are where they are told to be.
class PerfectBus final : public MotorBus {
 public:
  int joint_count() const noexcept override { return kJoints; }
  BusStatus enable() override { return BusStatus::kOk; }
  BusStatus exchange(std::span<const JointCommand> commands, std::span<JointState> states,
                     std::int64_t /*deadline_ns*/) noexcept override {
    std::copy(commands.begin(), commands.end(), robot_.commands.begin());
    robot_.step(1e-3);
    std::copy(robot_.states.begin(), robot_.states.end(), states.begin());
    return BusStatus::kOk;
  }
  void disable() noexcept override {}
  BusCounters counters() const noexcept override { return {}; }

 private:
  test::PlantRobot robot_{kJoints};
};

/// A run of the executor as long as a slice: 23 joints along a plan, then held.
ExecutorReport run_ours(const Options& options, Counts& counts) {
  const auto image = test::make_image(kJoints, test::smooth_keyframes(kJoints, 11));
  ControllerConfig config = test::make_config(kJoints);
  config.hold_time = std::max(0.1, options.slice - 1.2);
  std::vector<double> workspace(Controller::workspace_size(11));
  Controller controller;
  if (controller.load(config, test::kRobotHash, image, workspace).status != LoadStatus::kOk)
    throw std::runtime_error("the benchmark's plan is refused");
  PerfectBus bus;
  std::atomic<bool> stop{false};
  ExecutorOptions execution;
  execution.realtime = true;
  execution.runtime.priority = options.priority;
  if (options.processor >= 0) execution.runtime.processors = {options.processor};
  execution.runtime.guards = parse_guards("malloc,faults");
  execution.bus_calls = BusCalls::kNone;
  execution.stop = &stop;
  ExecutorReport report = execute(controller, bus, execution);
  report.timing.wakeup.each(
      [&](std::int64_t ns, std::uint64_t count) { counts[ns / 1000] += count; });
  return report;
}

/// A slice of cyclictest, its histogram added.
void run_theirs(const Options& options, Counts& counts) {
  std::string command = "cyclictest --quiet --mlockall --threads=1 --policy=fifo --priority=" +
                        std::to_string(options.priority) + " --interval=1000 --loops=" +
                        std::to_string(static_cast<int>(1000 * options.slice)) +
                        " --histogram=" + std::to_string(kHistogram) + " --default-system";
  if (options.processor >= 0) command += " --affinity=" + std::to_string(options.processor);
  FILE* pipe = popen((command + " 2>/dev/null").c_str(), "r");
  char line[512];
  while (pipe != nullptr && std::fgets(line, sizeof line, pipe) != nullptr) {
    long us = 0;
    unsigned long count = 0;
    if (std::sscanf(line, "%ld %lu", &us, &count) == 2 && count > 0) counts[us] += count;
  }
  if (pipe == nullptr || pclose(pipe) != 0)
    throw std::runtime_error("cyclictest failed: install rt-tests, run as root");
}

/// A busy machine for as long as it lives.
class Stress {
 public:
  explicit Stress(bool on) {
    if (!on) return;
    child_ = fork();
    if (child_ == 0) {
      (void)!freopen("/dev/null", "w", stdout);
      (void)!freopen("/dev/null", "w", stderr);
      execlp("stress-ng", "stress-ng", "--cpu", "2", "--vm", "1", "--vm-bytes", "128M", "--hdd",
             "1", "--hdd-bytes", "16M", "--timer", "1", "--switch", "1", "--temp-path", "/tmp",
             static_cast<char*>(nullptr));
      _exit(127);
    }
    sleep(1);
    if (waitpid(child_, nullptr, WNOHANG) == child_)
      throw std::runtime_error("stress-ng did not start: install it");
  }
  ~Stress() {
    if (child_ <= 0) return;
    kill(child_, SIGINT);
    waitpid(child_, nullptr, 0);
  }
  Stress(const Stress&) = delete;
  Stress& operator=(const Stress&) = delete;

 private:
  pid_t child_ = -1;
};

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string key = argv[i];
    if (key == "--stress") {
      options.stress = true;
      continue;
    }
    if (++i == argc) throw std::runtime_error(key + " needs a value");
    if (key == "--seconds")
      options.seconds = std::atof(argv[i]);
    else if (key == "--slice")
      options.slice = std::max(2.0, std::atof(argv[i]));
    else if (key == "--priority")
      options.priority = std::atoi(argv[i]);
    else if (key == "--processor")
      options.processor = std::atoi(argv[i]);
    else
      throw std::runtime_error("unknown option " + key);
  }
  return options;
}

void print(const char* name, const Counts& counts) {
  std::uint64_t all = 0;
  for (const auto& [us, count] : counts) all += count;
  std::printf("%-11s %8llu %6lld %6lld %7lld %7lld %7lld\n", name,
              static_cast<unsigned long long>(all), static_cast<long long>(percentile(counts, 0.5)),
              static_cast<long long>(percentile(counts, 0.99)),
              static_cast<long long>(percentile(counts, 0.999)),
              static_cast<long long>(percentile(counts, 0.9999)),
              static_cast<long long>(counts.empty() ? 0 : counts.rbegin()->first));
}

int run(const Options& options) {
  Counts ours;
  Counts theirs;
  std::uint64_t overruns = 0;
  std::uint64_t skipped = 0;
  GuardReport guards;
  std::vector<std::string> refused;
  const Stress stress(options.stress);
  const int slices = std::max(1, static_cast<int>(options.seconds / options.slice));
  for (int i = 0; i < slices; ++i) {
    // Now one first, now the other.
    if (i % 2 == 1) run_theirs(options, theirs);
    const ExecutorReport report = run_ours(options, ours);
    if (i % 2 == 0) run_theirs(options, theirs);
    overruns += report.overruns;
    skipped += report.skipped;
    guards.malloc_calls += report.guards.malloc_calls;
    guards.page_faults += report.guards.page_faults;
    refused = report.refused;
  }
  for (const std::string& what : refused) std::printf("not granted: %s\n", what.c_str());
  std::printf("wake-up lateness (us), %s, SCHED_FIFO %d, 1 kHz, slices of %.0f s in turn\n",
              options.stress ? "under stress-ng" : "no load added", options.priority,
              options.slice);
  std::printf("%-11s %8s %6s %6s %7s %7s %7s\n", "", "ticks", "p50", "p99", "p99.9", "p99.99",
              "max");
  print("executor", ours);
  print("cyclictest", theirs);
  std::printf(
      "p99.9 ratio %.2f; executor: %llu ticks late, %llu grid points lost, %llu heap calls, "
      "%llu page faults after warm-up\n",
      static_cast<double>(percentile(ours, 0.999)) /
          static_cast<double>(std::max<std::int64_t>(1, percentile(theirs, 0.999))),
      static_cast<unsigned long long>(overruns), static_cast<unsigned long long>(skipped),
      static_cast<unsigned long long>(guards.malloc_calls),
      static_cast<unsigned long long>(guards.page_faults));
  return refused.empty() ? 0 : 1;
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  try {
    return clamber::run(clamber::parse(argc, argv));
  } catch (const std::exception& error) {
    std::cerr << "jitter: " << error.what() << '\n';
    return 2;
  }
}
