// What disturbances of telemetry cost the tick: how late it wakes up, and how long its push takes,
// at 1 kHz with the publisher in a process of its own, without and with each disturbance in turn.
// The ticks of all cases are taken in short slices, one case after the other and round again, so
// that what else the machine does falls on all of them.
//
//   bench_telemetry_disturbed [seconds a slice] [rounds]
#include <pthread.h>
#include <sched.h>
#include <sys/mount.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "telemetry/frame_subscription.hpp"
#include "telemetry/publisher.hpp"
#include "telemetry/publisher_process.hpp"
#include "tests/telemetry/malformed.hpp"
#include "tests/telemetry/processes.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
using test::Child;

constexpr std::uint32_t kJoints = 23;
constexpr int kPriority = 80;
constexpr const char* kPublisherRole = "--publisher";
constexpr const char* kSubscriberRole = "--subscriber";

std::int64_t now() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
}

std::string self() { return std::filesystem::read_symlink("/proc/self/exe"); }

TelemetryConfig config(int domain) {
  TelemetryConfig c;
  c.domain = domain;
  c.robot = "bench";
  return c;
}

TelemetryDescription description() {
  TelemetryDescription d;
  for (std::uint32_t j = 0; j < kJoints; ++j) d.joint_names.push_back("joint" + std::to_string(j));
  d.torque_limits.assign(kJoints, 30.0);
  return d;
}

/// What a case has measured and lost.
struct Figures {
  std::vector<double> lateness, push;  ///< us
  std::uint64_t ticks = 0, published = 0, gaps = 0, restarts = 0;

  void add(const PublisherCounters& counters) {
    published += counters.frames;
    gaps += counters.gaps;
    restarts += counters.restarts;
  }
};

/// In a thread of its own, real-time where that is allowed.
void tick(double seconds, TelemetryPort& port, Figures& figures) {
  const auto count = static_cast<std::uint64_t>(1e3 * seconds);
  figures.lateness.reserve(figures.lateness.size() + count);
  figures.push.reserve(figures.push.size() + count);
  const sched_param priority{.sched_priority = kPriority};
  static_cast<void>(pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority));
  TelemetryFrame frame;
  frame.joint_count = kJoints;
  const std::int64_t start = now();
  for (; frame.sequence < count; ++frame.sequence) {
    const std::int64_t due = start + static_cast<std::int64_t>(frame.sequence + 1) * 1'000'000;
    const timespec at{.tv_sec = due / 1'000'000'000, .tv_nsec = due % 1'000'000'000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
    const std::int64_t woken = now();
    frame.time = 1e-3 * static_cast<double>(frame.sequence);
    static_cast<void>(port.push(frame, {}));
    figures.push.push_back(1e-3 * static_cast<double>(now() - woken));
    figures.lateness.push_back(1e-3 * static_cast<double>(woken - due));
  }
  figures.ticks += count;
}

/// What goes on beside the ticks until they are over.
using Disturbance =
    std::function<void(int domain, const PublisherProcess&, const std::stop_token& over)>;

std::vector<std::string> subscriber(int domain) {
  return {self(), kSubscriberRole, std::to_string(domain)};
}

void calm(int /*domain*/, const PublisherProcess& /*publisher*/, const std::stop_token& /*over*/) {}

void one_subscriber(int domain, const PublisherProcess& /*publisher*/,
                    const std::stop_token& over) {
  Child reads(subscriber(domain));
  while (!over.stop_requested()) std::this_thread::sleep_for(10ms);
}

void hostile_subscribers(int domain, const PublisherProcess& /*publisher*/,
                         const std::stop_token& over) {
  Child stalls(subscriber(domain));
  Child dawdles(subscriber(domain));
  std::this_thread::sleep_for(700ms);
  stalls.send(SIGSTOP);
  while (!over.stop_requested()) {
    Child crashes(subscriber(domain));
    for (int i = 0; i < 5 && !over.stop_requested(); ++i) {
      dawdles.send(SIGSTOP);
      std::this_thread::sleep_for(90ms);
      dawdles.send(SIGCONT);
      std::this_thread::sleep_for(10ms);
    }
    crashes.send(SIGKILL);
  }
}

void signal_publisher(const PublisherProcess& publisher, const std::stop_token& over, int signal) {
  while (!over.stop_requested()) {
    std::this_thread::sleep_for(500ms);
    if (publisher.process_id() > 0) kill(publisher.process_id(), signal);
  }
}

void malformed_datagrams(int domain, const PublisherProcess& /*publisher*/,
                         const std::stop_token& over) {
  Child reads(subscriber(domain));
  test::Listener listener(domain);
  const std::vector<test::Datagram> heard = listener.hear(700ms, 2000);
  if (heard.empty()) return;
  std::mt19937 random(6);
  std::vector<test::Datagram> malformed;
  for (int i = 0; i < 1000; ++i)
    malformed.push_back(test::mutated(heard[random() % heard.size()], random));
  while (!over.stop_requested()) {
    test::send_to_all(malformed, domain);
    std::this_thread::sleep_for(500ms);
  }
}

/// Fills it for as long as it lives; nobody else's in a mount namespace of its own.
class FullSharedMemory {
 public:
  FullSharedMemory() : file_("/dev/shm/clamber_bench_filler") {
    std::ofstream out(file_);
    const std::string block(1 << 16, 'x');
    while (out.write(block.data(), 1 << 16).flush()) continue;
  }
  ~FullSharedMemory() { std::filesystem::remove(file_); }
  FullSharedMemory(const FullSharedMemory&) = delete;
  FullSharedMemory& operator=(const FullSharedMemory&) = delete;

 private:
  std::filesystem::path file_;
};

struct Case {
  const char* name;
  Disturbance disturb;
  bool full_memory = false;
  Figures figures = {};
};

void run_slice(Case& which, double seconds) {
  std::optional<FullSharedMemory> full;
  if (which.full_memory) full.emplace();
  const int domain = test::next_domain();
  TelemetryMemory memory(TelemetryMemory::Kind::kShared);
  TelemetryPort port(memory.block());
  PublisherProcess publisher(config(domain), description(), memory, {self(), kPublisherRole});
  {
    std::jthread beside(
        [&](const std::stop_token& over) { which.disturb(domain, publisher, over); });
    std::thread(tick, seconds, std::ref(port), std::ref(which.figures)).join();
  }
  publisher.stop();
  which.figures.add(counters_of(memory.block()));
}

void print_spread(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    const auto index = static_cast<std::size_t>(share * static_cast<double>(values.size()));
    return values[std::min(index, values.size() - 1)];
  };
  std::printf("  %7.2f %7.1f %8.1f", at(0.5), at(0.99), at(0.999));
}

void subscribe(int domain) {
  FrameSubscription subscription(config(domain),
                                 {.description = [](const TelemetryDescription&) {},
                                  .frame = [](const TelemetryFrame&) {},
                                  .event = [](const TelemetryEvent&, std::int64_t) {},
                                  .robot_description = {}});
  for (;;) subscription.receive(100ms);
}

int measure(double seconds, int rounds) {
  std::vector<Case> cases = {{"nobody subscribes", calm},
                             {"one subscriber", one_subscriber},
                             {"stalled, slow, crashing subscribers", hostile_subscribers},
                             {"publisher killed every 0.5 s",
                              [](int, const PublisherProcess& p, const std::stop_token& over) {
                                signal_publisher(p, over, SIGKILL);
                              }},
                             {"publisher stopped, replaced",
                              [](int, const PublisherProcess& p, const std::stop_token& over) {
                                signal_publisher(p, over, SIGSTOP);
                              }},
                             {"full /dev/shm", one_subscriber, true},
                             {"1000 malformed datagrams every 0.5 s", malformed_datagrams}};
  // So that nobody else's shared memory is filled.
  const bool own_mounts = unshare(CLONE_NEWNS) == 0 &&
                          mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                          mount("tmpfs", "/dev/shm", "tmpfs", 0, "size=1m") == 0;
  if (!own_mounts) {
    std::puts("full /dev/shm: left out, mount namespaces are not allowed here");
    std::erase_if(cases, [](const Case& c) { return c.full_memory; });
  }
  for (int round = 0; round < rounds; ++round)
    for (Case& each : cases) run_slice(each, seconds);
  std::printf(
      "%-38s  lateness (us)                push (us)\n%-38s      p50     p99    p99.9"
      "      p50     p99    p99.9   ticks  published  lost  restarts\n",
      "", "");
  for (Case& each : cases) {
    Figures& f = each.figures;
    std::printf("%-36s", each.name);
    print_spread(f.lateness);
    print_spread(f.push);
    std::printf("  %6llu  %9llu  %4llu  %8llu\n", static_cast<unsigned long long>(f.ticks),
                static_cast<unsigned long long>(f.published),
                static_cast<unsigned long long>(f.gaps),
                static_cast<unsigned long long>(f.restarts));
  }
  return 0;
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  const std::string role = argc > 1 ? argv[1] : "";
  if (role == clamber::kPublisherRole) {
    clamber::run_publisher_process();
    return 0;
  }
  if (role == clamber::kSubscriberRole && argc > 2) {
    clamber::subscribe(std::atoi(argv[2]));
    return 0;
  }
  return clamber::measure(argc > 1 ? std::atof(argv[1]) : 4.0, argc > 2 ? std::atoi(argv[2]) : 3);
}
