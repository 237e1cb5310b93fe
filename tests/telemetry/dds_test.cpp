// The publisher against subscribers in other processes: another vendor's DDS, and our monitor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <sstream>
#include <thread>

#include "robot_model/loader.hpp"
#include "telemetry/publisher.hpp"
#include "tests/telemetry/made_stream.hpp"
#include "tests/telemetry/processes.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
using namespace test;
using testing::HasSubstr;

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

/// One event each second, the rest of which is frames.
void push_at(TelemetryPort& port, std::uint64_t frames, std::chrono::nanoseconds period) {
  auto next = std::chrono::steady_clock::now();
  for (std::uint64_t tick = 0; tick < frames; ++tick) {
    ASSERT_TRUE(port.push(frame(tick), {.tick_ns = 20'000, .overruns = tick / 100}));
    if (tick % 1000 == 0) {
      TelemetryEvent event;
      event.tick = tick;
      event.kind = EventKind::kPhase;
      event.append("second " + std::to_string(tick / 1000));
      ASSERT_TRUE(port.push(event));
    }
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
      if (kind == 'U' || kind == 'E' || kind == 'G' || kind == 'X' || line.starts_with("URDF") ||
          kind == 'R')
        others_ += line + '\n';
      if (kind == 'S') numbered_line(fields);
    }
  }

  std::uint64_t frames_ = 0;
  std::uint64_t frames_out_of_order_ = 0;
  std::uint64_t frames_wrong_ = 0;
  std::uint64_t joint_states_ = 0;
  std::uint64_t joint_states_wrong_ = 0;
  std::string description_;
  std::string others_;
  std::map<std::string, std::uint64_t> samples_;  ///< per topic
  std::uint64_t samples_out_of_order_ = 0;

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

  void numbered_line(std::istringstream& fields) {
    std::string topic;
    std::uint64_t number = 0;
    fields >> topic >> number;
    if (number != samples_[topic]++) ++samples_out_of_order_;
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

PeerLog publish_to_peer(std::uint64_t frames, std::chrono::nanoseconds period,
                        PublisherCounters& counters) {
  configure_cyclone();
  const int domain = next_domain();
  Child peer({CYCLONE_PEER, std::to_string(domain), std::to_string(frames), "80"});
  {
    TelemetryMemory memory;
    TelemetryPort port(memory.block());
    Publisher publisher(config(domain), description(), memory.block());
    wait_until_matched(publisher, peer);
    push_at(port, frames, period);
    publisher.stop();
    counters = counters_of(memory.block());
  }  // gone before the subscriber has read everything: what was sent must still count
  EXPECT_EQ(peer.wait(), 0);
  return PeerLog(peer.output());
}

TEST(PublisherToCyclone, EveryFrameArrivesAtOneKilohertz) {
  // docs/telemetry.md states the figures of a minute.
  const char* asked = std::getenv("CLAMBER_TELEMETRY_SECONDS");
  const std::uint64_t seconds = asked != nullptr ? std::strtoull(asked, nullptr, 10) : 3;
  const std::uint64_t frames = 1000 * seconds;
  PublisherCounters counters;
  const PeerLog log = publish_to_peer(frames, 1ms, counters);
  std::cout << log.frames_ << " of " << frames << " frames, " << log.joint_states_ << " of "
            << frames / 10 << " joint states\n";

  EXPECT_EQ(counters.frames, frames);
  EXPECT_EQ(counters.joint_states, frames / 10);
  EXPECT_EQ(counters.refused, 0U);
  EXPECT_EQ(counters.ring_drops, 0U);
  EXPECT_LE(counters.batches, frames / 2) << "frames are not batched";

  EXPECT_EQ(log.frames_, frames);
  EXPECT_EQ(log.frames_out_of_order_, 0U);
  EXPECT_EQ(log.frames_wrong_, 0U);
  EXPECT_EQ(log.joint_states_, frames / 10);
  EXPECT_EQ(log.joint_states_wrong_, 0U);
  EXPECT_THAT(log.description_, testing::StartsWith("D test_robot Joint0:30 Joint1:30 "));
  for (const char* hash :
       {"joint_states "
        "typehash=RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e;",
        "tf typehash=RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087;",
        "robot_description "
        "typehash=RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18;",
        "diagnostics "
        "typehash=RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e;"})
    EXPECT_THAT(log.others_, HasSubstr(hash));

  // The slower topics: every so manieth tick, in order.
  EXPECT_EQ(log.samples_out_of_order_, 0U);
  EXPECT_EQ(log.samples_.at("torque_margins"), frames / 50);
  EXPECT_EQ(log.samples_.at("contacts"), frames / 20);
  EXPECT_EQ(log.samples_.at("timing"), frames / 100);
  EXPECT_EQ(log.samples_.at("bus"), frames / 100);
  EXPECT_EQ(counters.events, frames / 1000);
  for (const char* event : {"E 0 0 2 0 -1 second 0", "E 1 1000 2 0 -1 second 1"})
    EXPECT_THAT(log.others_, HasSubstr(event));
  EXPECT_THAT(log.others_, HasSubstr("X 1 imu:pelvis:1:0.5"));
  EXPECT_THAT(log.others_, HasSubstr("X 24 pelvis:world:1:0 Link0:pelvis:"));
  EXPECT_THAT(log.others_, HasSubstr("G 5 [test_robot: controller]=0"));
  EXPECT_THAT(log.others_, HasSubstr("[test_robot: loop]=1")) << "overruns are a warning";
  EXPECT_THAT(log.others_, HasSubstr("URDF 100000"));
  EXPECT_THAT(log.others_, testing::Not(HasSubstr("READER")))
      << "whoever publishes listens to somebody";
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
  TelemetryMemory memory;
  TelemetryPort port(memory.block());
  Publisher publisher(config(domain), description(), memory.block());
  Child monitor({MONITOR_PROCESS, std::to_string(domain), "1.5", "10"});
  for (std::uint64_t tick = 0; tick < 8000 && monitor.running(); ++tick) {
    TelemetryFrame f = frame(tick);
    f.tau_meas.fill(1.5);
    f.tau_meas[7] = tick % 500 == 250 ? -27.25 : 3.0;
    ASSERT_TRUE(port.push(f, {}));
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
  TelemetryMemory memory;
  TelemetryPort port(memory.block());
  Publisher publisher(config(next_domain()), description(), memory.block());
  for (std::uint64_t tick = 0; tick < 25; ++tick) ASSERT_TRUE(port.push(frame(tick), {}));
  publisher.stop();
  publisher.stop();
  EXPECT_EQ(counters_of(memory.block()).frames, 25U);
  EXPECT_EQ(counters_of(memory.block()).joint_states, 3U);
}

TEST(Publisher, RefusesToStartItsThreadsFromARealTimeThread) {
  std::thread([] {
    const sched_param priority{.sched_priority = 1};
    if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) {
      GTEST_SKIP() << "skipped: no permission for SCHED_FIFO";
    }
    TelemetryMemory memory;
    EXPECT_THROW(Publisher(config(next_domain()), description(), memory.block()), std::logic_error);
  }).join();
}

TEST(Publisher, RefusesWhatItCannotDescribe) {
  TelemetryMemory memory;
  TelemetryDescription bad = description();
  bad.torque_limits.pop_back();
  EXPECT_THROW(Publisher(config(next_domain()), bad, memory.block()), InputError);
  TelemetryConfig elsewhere = config(next_domain());
  elsewhere.interfaces = {"203.0.113.1"};
  EXPECT_THROW(Publisher(elsewhere, description(), memory.block()), InputError);
}

}  // namespace
}  // namespace clamber
