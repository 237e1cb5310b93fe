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
#include "tests/telemetry/processes.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
using test::Child;
using test::configure_cyclone;
using test::next_domain;
using testing::HasSubstr;

constexpr int kJoints = 23;
constexpr double kLimit = 30.0;

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
  f.flags = kFrameHasTruth;
  f.contact_count = 2;
  f.base_orientation = {1.0, 0.0, 0.0, 0.0};
  return f;
}

std::string joint_name(int joint) { return "Joint" + std::to_string(joint); }

TelemetryDescription description() {
  TelemetryDescription d;
  for (int j = 0; j < kJoints; ++j) d.joint_names.push_back(joint_name(j));
  d.torque_limits.assign(kJoints, kLimit);
  d.contact_names = {"l_wrist", "r_wrist"};
  d.phases = {{"first", 3}, {"second", 1}};
  d.base = "pelvis";
  for (int j = 0; j < kJoints; ++j)
    d.links.push_back({.name = "Link" + std::to_string(j),
                       .parent = j == 0 ? "pelvis" : "Link" + std::to_string(j - 1),
                       .joint = j,
                       .position = {0.0, 0.0, 0.25}});
  d.links.push_back({.name = "imu", .parent = "pelvis", .position = {0.0, 0.0, 0.5}});
  d.urdf = std::string(100'000, 'u');  // more than one datagram
  return d;
}

TelemetryConfig config(int domain) {
  TelemetryConfig c;
  c.domain = domain;
  c.robot = "test_robot";
  return c;
}

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

TEST(Security, OnlyThoseWithCredentialsSeeAnything) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("clamber_security_" + std::to_string(getpid()));
  const std::string script = std::string(CLAMBER_SOURCE_DIR) + "/scripts/dds_security";
  const int made = Child({script, folder.string()}).wait();
  if (made == 2) GTEST_SKIP() << "skipped: no openssl (Debian: openssl)";
  ASSERT_EQ(made, 0);
  ASSERT_EQ(Child({script, (folder / "other").string()}).wait(), 0);

  TelemetryConfig secured = config(next_domain());
  secured.security = folder / "publisher";
  const TelemetryConfig open = config(next_domain());
  TelemetryMemory secured_memory;
  TelemetryMemory open_memory;
  TelemetryPort secured_port(secured_memory.block());
  TelemetryPort open_port(open_memory.block());
  Publisher secured_publisher(secured, description(), secured_memory.block());
  Publisher open_publisher(open, description(), open_memory.block());
  // Two that know each other need some 3 s to agree on keys.
  const auto monitor = [](const TelemetryConfig& of, const char* timeout, const std::string& with) {
    return std::vector<std::string>{MONITOR_PROCESS, std::to_string(of.domain), "0.3", timeout,
                                    with};
  };
  Child trusted(monitor(secured, "20", folder / "subscriber"));
  Child unknown(monitor(secured, "5", ""));
  Child stranger(monitor(secured, "5", folder / "other" / "subscriber"));
  Child misled(monitor(open, "5", folder / "subscriber"));
  for (std::uint64_t tick = 0; tick < 20'000 && (trusted.running() || unknown.running() ||
                                                 stranger.running() || misled.running());
       ++tick) {
    static_cast<void>(secured_port.push(frame(tick), {}));
    static_cast<void>(open_port.push(frame(tick), {}));
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_EQ(trusted.wait(), 0) << trusted.output();
  EXPECT_EQ(unknown.wait(), 1) << "seen without credentials";
  EXPECT_EQ(stranger.wait(), 1) << "seen with another authority's credentials";
  EXPECT_EQ(misled.wait(), 1)
      << "frames of somebody without credentials were taken for the robot's";
  std::filesystem::remove_all(folder);
}

TEST(Security, NamesTheFileThatIsMissing) {
  TelemetryMemory memory;
  TelemetryConfig secured = config(next_domain());
  secured.security = "/nowhere";
  EXPECT_THAT([&] { Publisher(secured, description(), memory.block()); },
              testing::ThrowsMessage<InputError>(HasSubstr("/nowhere/ca.pem: no such file")));
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

// ---- interfaces

constexpr const char* kInterfacesRole = "publish-in-a-namespace";
constexpr int kNotAllowed = 77;

/// In a network namespace of its own with two interfaces, of which DDS may use one: publishes, and
/// lets tshark look at both. @return kNotAllowed, or 0 with "lo N other0 M" packets on the output
int publish_in_a_namespace(const std::string& interface) {
  if (std::system("ip link set lo up && ip link set lo multicast on && "
                  "ip link add other0 type veth peer name other1 && ip address add 10.99.0.1/24 "
                  "dev other0 && "
                  "ip link set other1 up && ip link set other0 up multicast on") != 0)
    return kNotAllowed;
  const auto capture = [](const std::string& on) {
    return std::vector<std::string>{
        "/usr/bin/tshark", "-i", on,       "-a", "duration:4", "-Y", "rtps", "-T",
        "fields",          "-e", "ip.dst", "-Q", "-l"};
  };
  Child on_loopback(capture("lo"));
  Child on_other(capture("other0"));
  std::this_thread::sleep_for(1500ms);  // until tshark listens
  TelemetryConfig c = config(1);
  c.interfaces = {interface};
  {
    TelemetryMemory memory;
    TelemetryPort port(memory.block());
    Publisher publisher(c, description(), memory.block());
    for (std::uint64_t tick = 0; tick < 1000; ++tick) {
      static_cast<void>(port.push(frame(tick), {}));
      std::this_thread::sleep_for(1ms);
    }
  }
  const int looked = on_loopback.wait() + on_other.wait();
  if (looked != 0) return kNotAllowed;
  const auto packets = [](const Child& child) {
    const std::string lines = child.output();
    return std::count(lines.begin(), lines.end(), '\n');
  };
  std::cout << "lo " << packets(on_loopback) << " other0 " << packets(on_other) << std::endl;
  return 0;
}

TEST(Interfaces, NoPacketOnAnyOther) {
  if (!std::filesystem::exists("/usr/bin/tshark"))
    GTEST_SKIP() << "skipped: no tshark (Debian: tshark)";
  const std::string self = std::filesystem::read_symlink("/proc/self/exe");
  const auto run = [&](const char* interface) {
    return std::vector<std::string>{"/usr/bin/unshare", "--net", self, kInterfacesRole, interface};
  };
  Child loopback(run("127.0.0.1"));
  Child other(run("other0"));
  const int first = loopback.wait();
  const int second = other.wait();
  if (first != 0 || second != 0)
    GTEST_SKIP() << "skipped: no network namespaces, or tshark may not listen (" << first << ", "
                 << second << ")";
  EXPECT_THAT(loopback.output(), testing::MatchesRegex("lo [1-9][0-9]* other0 0\n"));
  // Where it may, it does: what is sent to the own address of other0 passes over lo.
  EXPECT_THAT(other.output(), testing::MatchesRegex("lo [0-9]+ other0 [1-9][0-9]*\n"));
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  if (argc == 3 && argv[1] == std::string(clamber::kInterfacesRole))
    return clamber::publish_in_a_namespace(argv[2]);
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
