// Who may see the telemetry: DDS Security, and the interfaces that packets appear on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "robot_model/loader.hpp"
#include "telemetry/publisher.hpp"
#include "tests/telemetry/made_stream.hpp"
#include "tests/telemetry/processes.hpp"

namespace clamber {
namespace {

using namespace std::chrono_literals;
using test::Child;
using test::config;
using test::description;
using test::frame;
using test::next_domain;
using testing::HasSubstr;

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
        "/usr/bin/tshark", "-i", on,       "-a", "duration:3", "-Y", "rtps", "-T",
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
