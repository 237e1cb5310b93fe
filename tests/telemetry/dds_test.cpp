// The publisher against subscribers in other processes: another vendor's DDS, and our monitor.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "robot_model/loader.hpp"
#include "telemetry/publisher.hpp"

extern char** environ;

namespace clamber {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr int kJoints = 23;
constexpr double kLimit = 30.0;

// Domains whose ports stay below Linux's ephemeral ones; the process id keeps parallel runs apart.
int next_domain() {
  static int domain = static_cast<int>(getpid());
  return 1 + ++domain % 100;
}

double torque(std::uint64_t tick, int joint) {
  return 20.0 * std::sin(0.001 * static_cast<double>(tick) + joint);
}
double angle(std::uint64_t tick, int joint) {
  return std::cos(0.002 * static_cast<double>(tick) - joint);
}

TelemetryFrame frame(std::uint64_t tick) {
  TelemetryFrame f;
  f.sequence = tick;
  f.time = static_cast<double>(tick) * 1e-3;
  f.plan_time = f.time;
  f.joint_count = kJoints;
  f.phase = static_cast<std::uint32_t>(tick / 1000);
  for (int j = 0; j < kJoints; ++j) {
    const auto i = static_cast<std::size_t>(j);
    f.tau_meas[i] = torque(tick, j);
    f.q[i] = angle(tick, j);
    f.dq[i] = 0.5 * angle(tick, j);
  }
  return f;
}

std::string joint_name(int joint) { return "Joint" + std::to_string(joint); }

TelemetryDescription description() {
  TelemetryDescription d;
  for (int j = 0; j < kJoints; ++j) d.joint_names.push_back(joint_name(j));
  d.torque_limits.assign(kJoints, kLimit);
  d.contact_names = {"l_wrist", "r_wrist"};
  return d;
}

TelemetryConfig config(int domain) {
  TelemetryConfig c;
  c.domain = domain;
  c.robot = "test_robot";
  return c;
}

/// Another process with its standard output in a file.
class Child {
 public:
  explicit Child(std::vector<std::string> arguments)
      : output_(
            std::filesystem::temp_directory_path() /
            ("clamber_telemetry_" + std::to_string(getpid()) + "_" + std::to_string(++started_))) {
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output_.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0600);
    const int error = posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error("cannot start " + arguments[0]);
  }
  ~Child() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      static_cast<void>(wait());
    }
    std::filesystem::remove(output_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  [[nodiscard]] bool running() const {
    siginfo_t info{};
    waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
    return info.si_pid == 0;
  }
  /// Its exit code, or -1 when it did not exit by itself.
  int wait() {
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] std::string output() const {
    std::ostringstream text;
    text << std::ifstream(output_).rdbuf();
    return text.str();
  }

 private:
  static inline int started_ = 0;
  std::filesystem::path output_;
  pid_t pid_ = -1;
};

/// Writer and reader learn of each other at different times: both must have. The frames' reader
/// is the peer's last, and discovery keeps the order, so the others are known by then.
void wait_until_matched(const Publisher& publisher, const Child& peer) {
  for (int i = 0; i < 1000; ++i) {
    if (publisher.frame_readers() == 1 && peer.output().find("MATCHED") != std::string::npos)
      return;
    std::this_thread::sleep_for(10ms);
  }
  FAIL() << "discovery took longer than 10 s";
}

void push_at(FrameRing& ring, std::uint64_t frames, std::chrono::nanoseconds period) {
  auto next = std::chrono::steady_clock::now();
  for (std::uint64_t tick = 0; tick < frames; ++tick) {
    ASSERT_TRUE(ring.try_push(frame(tick)));
    next += period;
    std::this_thread::sleep_until(next);
  }
}

#ifdef CYCLONE_PEER

/// Reads back what cyclone_peer wrote, judging line by line.
class PeerLog {
 public:
  explicit PeerLog(const std::string& text) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream fields(line);
      char kind = 0;
      fields >> kind;
      if (kind == 'F') frame_line(fields);
      if (kind == 'J') joint_state_line(fields);
      if (kind == 'D') description_ = line;
      if (kind == 'U') user_data_ = line;
    }
  }

  std::uint64_t frames_ = 0;
  std::uint64_t frames_out_of_order_ = 0;
  std::uint64_t frames_wrong_ = 0;
  std::uint64_t joint_states_ = 0;
  std::uint64_t joint_states_wrong_ = 0;
  std::string description_;
  std::string user_data_;

 private:
  void frame_line(std::istringstream& fields) {
    std::uint64_t tick = 0;
    double time = -1.0;
    std::uint32_t phase = 0;
    int count = 0;
    fields >> tick >> time >> phase >> count;
    if (tick != frames_) ++frames_out_of_order_;
    ++frames_;
    bool right = time == frame(tick).time && phase == tick / 1000 && count == kJoints;
    for (int field = 0; field < 2; ++field) {
      for (int j = 0; j < kJoints; ++j) {
        double value = NAN;
        fields >> value;
        const double sent = field == 0 ? torque(tick, j) : angle(tick, j);
        right = right && std::abs(value - sent) < 2e-6;
      }
    }
    if (!right) ++frames_wrong_;
  }

  void joint_state_line(std::istringstream& fields) {
    const std::uint64_t tick = 10 * joint_states_++;
    int count = 0;
    fields >> count;
    bool right = count == kJoints;
    for (int j = 0; j < kJoints && right; ++j) {
      std::string text;
      fields >> text;
      std::replace(text.begin(), text.end(), ':', ' ');
      std::istringstream parts(text);
      std::string name;
      double q = NAN;
      double dq = NAN;
      double tau = NAN;
      parts >> name >> q >> dq >> tau;
      right = name == joint_name(j) && q == angle(tick, j) && dq == 0.5 * angle(tick, j) &&
              tau == torque(tick, j);
    }
    if (!right) ++joint_states_wrong_;
  }
};

/// Loopback without multicast, as Linux brings it up.
void configure_cyclone() {
  setenv("CYCLONEDDS_URI",
         "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\" "
         "multicast=\"false\"/></Interfaces><AllowMulticast>false</AllowMulticast></General>"
         "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
         "<Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery></Domain></CycloneDDS>",
         1);
}

PeerLog publish_to_peer(std::uint64_t frames, std::chrono::nanoseconds period,
                        PublisherCounters& counters) {
  configure_cyclone();
  const int domain = next_domain();
  Child peer({CYCLONE_PEER, std::to_string(domain), std::to_string(frames), "20"});
  {
    FrameRing ring;
    Publisher publisher(config(domain), description(), ring);
    wait_until_matched(publisher, peer);
    push_at(ring, frames, period);
    publisher.stop();
    counters = publisher.counters();
  }  // gone before the subscriber has read everything: what was sent must still count
  EXPECT_EQ(peer.wait(), 0);
  return PeerLog(peer.output());
}

TEST(PublisherToCyclone, EveryFrameArrivesAtOneKilohertz) {
  constexpr std::uint64_t kFrames = 3000;
  PublisherCounters counters;
  const PeerLog log = publish_to_peer(kFrames, 1ms, counters);

  EXPECT_EQ(counters.frames, kFrames);
  EXPECT_EQ(counters.joint_states, kFrames / 10);
  EXPECT_EQ(counters.refused, 0U);
  EXPECT_EQ(counters.ring_drops, 0U);
  EXPECT_LE(counters.batches, kFrames / 2) << "frames are not batched";

  EXPECT_EQ(log.frames_, kFrames);
  EXPECT_EQ(log.frames_out_of_order_, 0U);
  EXPECT_EQ(log.frames_wrong_, 0U);
  EXPECT_EQ(log.joint_states_, kFrames / 10);
  EXPECT_EQ(log.joint_states_wrong_, 0U);
  EXPECT_THAT(log.description_, testing::StartsWith("D test_robot Joint0:30 Joint1:30 "));
  EXPECT_THAT(log.user_data_, HasSubstr("typehash=RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd3"
                                        "3a0350f11c5882bc9179260e;"));
}

TEST(PublisherToCyclone, EveryFrameArrivesFromASimulationFiveTimesFaster) {
  constexpr std::uint64_t kFrames = 5000;
  PublisherCounters counters;
  const PeerLog log = publish_to_peer(kFrames, 200us, counters);
  EXPECT_EQ(counters.ring_drops, 0U);
  EXPECT_EQ(log.frames_, kFrames);
  EXPECT_EQ(log.frames_out_of_order_, 0U);
  EXPECT_EQ(log.frames_wrong_, 0U);
}

#else

TEST(PublisherToCyclone, EveryFrameArrivesAtOneKilohertz) {
  GTEST_SKIP() << "skipped: built without Cyclone DDS (cyclonedds-dev cyclonedds-tools)";
}

#endif

TEST(Monitor, ShowsFromAnotherProcessTheTorquesThatWereSent) {
  const int domain = next_domain();
  FrameRing ring;
  Publisher publisher(config(domain), description(), ring);
  Child monitor({MONITOR_PROCESS, std::to_string(domain), "1.5", "10"});
  for (std::uint64_t tick = 0; tick < 8000 && monitor.running(); ++tick) {
    TelemetryFrame f = frame(tick);
    f.tau_meas.fill(1.5);
    f.tau_meas[7] = tick % 500 == 250 ? -27.25 : 3.0;
    ASSERT_TRUE(ring.try_push(f));
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_EQ(monitor.wait(), 0);
  const std::string output = monitor.output();
  EXPECT_THAT(output, HasSubstr("Joint7 -27.25/30.0 N m, margin 9.2 %, peak -27.25"));
  EXPECT_THAT(output, HasSubstr("Joint0 1.50/30.0 N m, margin 95.0 %"));
  EXPECT_THAT(output, HasSubstr("lost 0"));
  EXPECT_THAT(output, HasSubstr("least margin: Joint7 -27.25 N m of 30.00"));
}

TEST(Monitor, FailsWhenNothingComes) {
  Child monitor({MONITOR_PROCESS, std::to_string(next_domain()), "1", "0.3"});
  EXPECT_EQ(monitor.wait(), 1);
  EXPECT_THAT(monitor.output(), HasSubstr("no telemetry from test_robot"));
}

TEST(Publisher, WorksWithoutSubscribersAndStopsTwice) {
  FrameRing ring(64);
  Publisher publisher(config(next_domain()), description(), ring);
  for (std::uint64_t tick = 0; tick < 25; ++tick) ASSERT_TRUE(ring.try_push(frame(tick)));
  publisher.stop();
  publisher.stop();
  EXPECT_EQ(publisher.counters().frames, 25U);
  EXPECT_EQ(publisher.counters().joint_states, 3U);
}

TEST(Publisher, RefusesToStartItsThreadsFromARealTimeThread) {
  std::thread([] {
    const sched_param priority{.sched_priority = 1};
    if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) {
      GTEST_SKIP() << "skipped: no permission for SCHED_FIFO";
    }
    FrameRing ring(64);
    EXPECT_THROW(Publisher(config(next_domain()), description(), ring), std::logic_error);
  }).join();
}

TEST(Publisher, RefusesWhatItCannotDescribe) {
  FrameRing ring(64);
  TelemetryDescription bad = description();
  bad.torque_limits.pop_back();
  EXPECT_THROW(Publisher(config(next_domain()), bad, ring), InputError);
  TelemetryConfig elsewhere = config(next_domain());
  elsewhere.interfaces = {"203.0.113.1"};
  EXPECT_THROW(Publisher(elsewhere, description(), ring), InputError);
}

}  // namespace
}  // namespace clamber
