// From the tick to a subscriber in another process, and what it costs: our path (ring, publisher,
// batches of what 10 ms bring) beside a bare Fast DDS writer of the same bytes that the tick's
// thread calls itself. Both in turn, in slices, at 1 kHz.
//
//   bench_telemetry_latency [seconds in all] [seconds a slice]
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/core/status/PublicationMatchedStatus.hpp>
#include <fastdds/dds/core/status/SubscriptionMatchedStatus.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "clamber_telemetryPubSubTypes.h"
#include "telemetry/dds_participant.hpp"
#include "telemetry/publisher.hpp"
#include "telemetry/topics.hpp"
#include "telemetry/wire.hpp"

namespace clamber {
namespace {

namespace dds = eprosima::fastdds::dds;

constexpr int kDomain = 91;
constexpr std::uint32_t kJoints = 23;

double now() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void sleep_until(double time) {
  const auto whole = static_cast<time_t>(time);
  const timespec t{.tv_sec = whole,
                   .tv_nsec = static_cast<long>(1e9 * (time - static_cast<double>(whole)))};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}

TelemetryConfig config() {
  TelemetryConfig c;
  c.domain = kDomain;
  c.robot = "bench";
  return c;
}

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// The other process: writes the age of every frame, in seconds, to `out`, until the writer has
/// gone.
int subscribe(int out) {
  DdsParticipant participant(config(), "bench_subscriber");
  dds::DataReader& reader = participant.create_reader(
      topics::own("bench", "frames"), dds::TypeSupport(new msg::dds_::Batch_PubSubType()),
      topics::read_measured(128));
  msg::dds_::Batch_ batch;
  dds::SampleInfo info;
  std::vector<double> ages;
  for (bool was_matched = false;;) {
    reader.wait_for_unread_message(eprosima::fastrtps::Duration_t(0, 100'000'000));
    while (reader.take_next_sample(&batch, &info) == ReturnCode_t::RETCODE_OK) {
      const double arrived = now();
      if (!info.valid_data) continue;
      for (std::uint32_t i = 0; i < batch.count(); ++i)
        ages.push_back(arrived - batch.frames()[i].time());
    }
    dds::SubscriptionMatchedStatus status;
    reader.get_subscription_matched_status(status);
    was_matched = was_matched || status.current_count > 0;
    if (was_matched && status.current_count == 0) break;
  }
  const auto bytes = static_cast<std::size_t>(ages.size() * sizeof(double));
  for (std::size_t done = 0; done < bytes;) {
    const ssize_t n = write(out, reinterpret_cast<const char*>(ages.data()) + done, bytes - done);
    if (n <= 0) return 1;
    done += static_cast<std::size_t>(n);
  }
  return 0;
}

struct Path {
  std::vector<double> ages;   // s
  std::vector<double> calls;  // s, what the tick's thread spent
  double cpu = 0.0, wall = 0.0;
  std::uint64_t sent = 0;
};

class Subscriber {
 public:
  explicit Subscriber(const char* program) {
    if (pipe(ends_) != 0) std::abort();
    child_ = fork();
    if (child_ == 0) {
      const std::string out = std::to_string(ends_[1]);
      execl("/proc/self/exe", program, "--subscribe", out.c_str(), nullptr);
      _exit(1);
    }
    close(ends_[1]);
  }
  void collect(std::vector<double>& ages) {
    double age = 0.0;
    while (read(ends_[0], &age, sizeof age) == sizeof age) ages.push_back(age);
    close(ends_[0]);
    waitpid(child_, nullptr, 0);
  }

 private:
  int ends_[2] = {-1, -1};
  pid_t child_ = -1;
};

void tick(Path& path, double seconds, const std::function<void(const TelemetryFrame&)>& hand_over) {
  TelemetryFrame frame;
  frame.joint_count = kJoints;
  const double cpu = cpu_seconds();
  const double start = now();
  for (double next = start; next < start + seconds; next += 1e-3) {
    sleep_until(next);
    frame.time = now();
    hand_over(frame);
    path.calls.push_back(now() - frame.time);
    ++frame.sequence;
    ++path.sent;
  }
  path.cpu += cpu_seconds() - cpu;
  path.wall += now() - start;
}

void our_slice(Path& path, double seconds, const char* program) {
  Subscriber subscriber(program);
  {
    TelemetryMemory memory;
    TelemetryPort port(memory.block());
    TelemetryDescription description;
    for (std::uint32_t j = 0; j < kJoints; ++j)
      description.joint_names.push_back("joint" + std::to_string(j));
    description.torque_limits.assign(kJoints, 30.0);
    Publisher publisher(config(), description, memory.block());
    while (publisher.frame_readers() == 0) usleep(10'000);
    usleep(300'000);
    tick(path, seconds, [&port](const TelemetryFrame& frame) { (void)port.push(frame, {}); });
    usleep(200'000);
  }
  subscriber.collect(path.ages);
}

void bare_slice(Path& path, double seconds, const char* program) {
  Subscriber subscriber(program);
  {
    DdsParticipant participant(config(), "bench_bare");
    dds::DataWriter& writer = participant.create_writer(
        topics::own("bench", "frames"), dds::TypeSupport(new msg::dds_::Batch_PubSubType()),
        topics::measured(topics::kFramesDepth));
    dds::PublicationMatchedStatus status;
    do {
      usleep(10'000);
      writer.get_publication_matched_status(status);
    } while (status.current_count == 0);
    usleep(300'000);
    msg::dds_::Batch_ batch;
    std::uint32_t used = 0;
    TelemetryRecord record;
    tick(path, seconds, [&](const TelemetryFrame& frame) {
      record.frame = frame;
      to_wire(record, 0, batch.frames()[used++]);
      if (used < kMaxBatch) return;
      batch.count(used);
      writer.write(&batch);
      used = 0;
    });
    usleep(200'000);
  }
  subscriber.collect(path.ages);
}

double at(std::vector<double>& values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1,
                         static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

void print(const char* name, Path& path) {
  std::printf("%-6s %8.2f %8.2f %8.2f   %8.2f %8.2f %8.1f   %6.2f %%   %zu of %llu\n", name,
              1e3 * at(path.ages, 0.5), 1e3 * at(path.ages, 0.99), 1e3 * at(path.ages, 1.0),
              1e6 * at(path.calls, 0.5), 1e6 * at(path.calls, 0.99), 1e6 * at(path.calls, 1.0),
              100.0 * path.cpu / path.wall, path.ages.size(),
              static_cast<unsigned long long>(path.sent));
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--subscribe") return clamber::subscribe(atoi(argv[2]));
  const double seconds = argc > 1 ? std::atof(argv[1]) : 40.0;
  const double slice = argc > 2 ? std::atof(argv[2]) : 5.0;
  clamber::Path ours;
  clamber::Path bare;
  for (double done = 0.0; done < seconds; done += 2.0 * slice) {
    clamber::our_slice(ours, slice, argv[0]);
    clamber::bare_slice(bare, slice, argv[0]);
  }
  std::puts(
      "       tick to subscriber (ms)      call in the tick (us)         CPU of the publishing\n"
      "            p50      p99      max        p50      p99      max   process   frames");
  clamber::print("ours", ours);
  clamber::print("bare", bare);
  return 0;
}
