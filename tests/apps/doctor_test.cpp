// What the preflight says of computers, links and zeros that are fit, and of those that are not.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/doctor/can_checks.hpp"
#include "apps/doctor/machine_checks.hpp"
#include "tests/apps/command_line.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;

/// A computer as its kernel shows it.
class Machine : public testing::Test {
 protected:
  void set(const std::string& file, const std::string& text) {
    const std::filesystem::path path = root_.path / file;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text << '\n';
  }
  test::TemporaryFolder folder_{"doctor_test"};
  MachineRoot root_{folder_.path()};
};

TEST_F(Machine, RealTimeKernelIsToldFromAnOrdinaryOne) {
  set("proc/version", "Linux version 6.1.0 #1 SMP PREEMPT_DYNAMIC");
  EXPECT_EQ(check_kernel(root_).verdict, Verdict::kAdvice);
  EXPECT_THAT(check_kernel(root_).remedy, HasSubstr("linux-image-rt"));
  set("sys/kernel/realtime", "1");
  EXPECT_EQ(check_kernel(root_).verdict, Verdict::kFine);
}

TEST_F(Machine, EveryProcessorMustRunAtFullSpeed) {
  EXPECT_EQ(check_governor(root_).verdict, Verdict::kSkipped);
  set("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance");
  EXPECT_EQ(check_governor(root_).verdict, Verdict::kFine);
  set("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave");
  EXPECT_EQ(check_governor(root_).verdict, Verdict::kAdvice);
  EXPECT_THAT(check_governor(root_).seen, HasSubstr("powersave"));
}

TEST_F(Machine, SlowClockIsNamed) {
  const std::string file = "sys/devices/system/clocksource/clocksource0/current_clocksource";
  set(file, "tsc");
  EXPECT_EQ(check_clocksource(root_).verdict, Verdict::kFine);
  set(file, "hpet");
  EXPECT_EQ(check_clocksource(root_).verdict, Verdict::kAdvice);
}

TEST_F(Machine, ControlThreadBelongsOnAnIsolatedProcessor) {
  RuntimeSettings settings;
  set("sys/devices/system/cpu/online", "0-3");
  set("sys/devices/system/cpu/isolated", "");
  EXPECT_THAT(check_isolation(root_, settings).remedy, HasSubstr("isolcpus=managed_irq,domain,3"));
  set("sys/devices/system/cpu/isolated", "2-3");
  EXPECT_THAT(check_isolation(root_, settings).remedy, HasSubstr("processors: [2,3]"));
  settings.processors = {1};
  EXPECT_EQ(check_isolation(root_, settings).verdict, Verdict::kAdvice);
  settings.processors = {3};
  EXPECT_EQ(check_isolation(root_, settings).verdict, Verdict::kFine);
}

TEST_F(Machine, SharedMemoryOfTheDeadIsToldFromThatOfTheLiving) {
  EXPECT_EQ(check_shared_memory(root_).verdict, Verdict::kFine);
  set("dev/shm/fastrtps_0123", std::string(4096, 'x'));
  set("dev/shm/fastrtps_0123_el", "");
  set("dev/shm/something_else_el", "");
  const Finding found = check_shared_memory(root_);
  EXPECT_EQ(found.verdict, Verdict::kAdvice);
  EXPECT_THAT(found.seen, HasSubstr("1 segments of dead DDS processes, 4 kB"));
  const int living = open((root_.path / "dev/shm/fastrtps_0123_el").c_str(), O_RDONLY);
  ASSERT_EQ(flock(living, LOCK_SH), 0);
  EXPECT_EQ(check_shared_memory(root_).verdict, Verdict::kFine);
  close(living);
}

TEST_F(Machine, PermissionsAreThoseTheControlThreadWillAskFor) {
  RuntimeSettings settings = ordinary_thread();
  EXPECT_EQ(check_permissions(settings).front().verdict, Verdict::kFine);
  settings.processors = {1023};
  const Findings refused = check_permissions(settings);
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].verdict, Verdict::kAdvice);
  EXPECT_THAT(refused[0].seen, HasSubstr("processors: [1023] not granted"));
  EXPECT_THAT(refused[0].remedy, HasSubstr("/sys/devices/system/cpu/online"));
  settings.required = true;
  EXPECT_EQ(check_permissions(settings).front().verdict, Verdict::kProblem);
}

TEST_F(Machine, DiskIsLookedAtWhereTheLogsWillBe) {
  EXPECT_NE(check_disk(root_.path / "not/made/yet").verdict, Verdict::kSkipped);
  EXPECT_THAT(check_disk(root_.path).seen, HasSubstr(root_.path.string()));
}

std::string cyclictest(int first, int second) {
  return R"({"thread": {"0": {"cycles": 100, "max": )" + std::to_string(first) +
         R"(}, "1": {"cycles": 100, "max": )" + std::to_string(second) + "}}}";
}

TEST(Latency, WorstThreadCounts) {
  EXPECT_EQ(judge_cyclictest(cyclictest(20, 99)).verdict, Verdict::kFine);
  EXPECT_EQ(judge_cyclictest(cyclictest(20, 101)).verdict, Verdict::kAdvice);
  EXPECT_EQ(judge_cyclictest(cyclictest(1000, 20)).verdict, Verdict::kProblem);
  for (const char* broken : {"", "{", "[]", R"({"thread": {"0": {}}})", R"({"thread": 3})"})
    EXPECT_EQ(judge_cyclictest(broken).verdict, Verdict::kProblem) << broken;
}

/// `ip -json -details link show` of one interface, as iproute2 6.1 writes it.
nlohmann::json can_link() {
  return nlohmann::json::parse(R"([{"ifname": "lo", "txqlen": 1000}, {
    "ifname": "can0", "flags": ["NOARP", "UP", "LOWER_UP"], "mtu": 72, "txqlen": 64,
    "linkinfo": {"info_kind": "can", "info_data": {
      "ctrlmode": ["FD"], "state": "ERROR-ACTIVE", "berr_counter": {"tx": 0, "rx": 0},
      "restart_ms": 100,
      "bittiming": {"bitrate": 1000000, "sample_point": "0.800"},
      "data_bittiming": {"bitrate": 5000000, "sample_point": "0.750"}}}}])");
}

class Link : public testing::Test {
 protected:
  Link() {
    bus_.name = "right_leg";
    bus_.interface = "can0";
    bus_.data_bitrate = 5'000'000;
    bus_.drives.resize(6);
  }
  [[nodiscard]] Finding judge() const { return judge_link(bus_, links_.dump()); }
  nlohmann::json& data() { return links_[1]["linkinfo"]["info_data"]; }

  Bus bus_;
  nlohmann::json links_ = can_link();
};

TEST_F(Link, AsTheMapSays) {
  EXPECT_EQ(judge().verdict, Verdict::kFine);
  EXPECT_EQ(judge().check, "can.right_leg");
}

TEST_F(Link, WrongBitRatesAreProblemsWithTheCommandThatSetsThem) {
  data()["data_bittiming"]["bitrate"] = 2000000;
  EXPECT_EQ(judge().verdict, Verdict::kProblem);
  EXPECT_THAT(judge().seen, HasSubstr("data bitrate 2000000, the map says 5000000"));
  EXPECT_THAT(judge().remedy, HasSubstr("up type can bitrate 1000000 dbitrate 5000000 fd on"));
  data().erase("data_bittiming");  // an interface set to classic CAN
  EXPECT_EQ(judge().verdict, Verdict::kProblem);
  bus_.data_bitrate = 0;
  EXPECT_EQ(judge().verdict, Verdict::kFine);
}

TEST_F(Link, BusStatesAreWeighed) {
  for (const auto& [state, verdict] :
       {std::pair{"ERROR-WARNING", Verdict::kAdvice}, std::pair{"ERROR-PASSIVE", Verdict::kProblem},
        std::pair{"BUS-OFF", Verdict::kProblem}}) {
    data()["state"] = state;
    EXPECT_EQ(judge().verdict, verdict) << state;
    EXPECT_THAT(judge().seen, HasSubstr(state));
  }
}

TEST_F(Link, ShortQueueOddSamplePointAndNoRestartAreAdvice) {
  links_[1]["txqlen"] = 10;
  EXPECT_EQ(judge().verdict, Verdict::kAdvice);
  EXPECT_THAT(judge().remedy, HasSubstr("ip link set can0 txqueuelen 64"));
  links_ = can_link();
  data()["bittiming"]["sample_point"] = 0.95;
  EXPECT_THAT(judge().seen, HasSubstr("sample point of bitrate at 95 %"));
  links_ = can_link();
  data()["restart_ms"] = 0;
  EXPECT_EQ(judge().verdict, Verdict::kAdvice);
}

TEST_F(Link, AbsentOrUnreadableIsAProblem) {
  bus_.interface = "can7";
  EXPECT_EQ(judge().verdict, Verdict::kProblem);
  for (const char* text : {"", "{", "[3]", "{}"})
    EXPECT_EQ(judge_link(bus_, text).verdict, Verdict::kProblem) << text;
}

TEST(Calibration, AgeOfTheZeros) {
  BusMap map;
  map.file = "map.yaml";
  EXPECT_EQ(check_calibration(map, 20'000).verdict, Verdict::kAdvice);
  map.calibrated = 19'990;
  EXPECT_EQ(check_calibration(map, 20'000).verdict, Verdict::kFine);
  EXPECT_THAT(check_calibration(map, 20'000).seen, HasSubstr("10 days ago"));
  EXPECT_EQ(check_calibration(map, 20'200).verdict, Verdict::kAdvice);
  EXPECT_EQ(check_calibration(map, 19'000).verdict, Verdict::kProblem);
}

TEST(Command, ExitCodeAndJsonAgree) {
  const test::TemporaryFolder folder("doctor_command");
  const auto fine = test::clamber("doctor --json", folder.path());
  EXPECT_EQ(fine.exit_code, 0) << fine.error;
  const auto said = nlohmann::json::parse(fine.out);
  EXPECT_TRUE(said["ready"].get<bool>());
  for (const auto& finding : said["findings"]) EXPECT_NE(finding["verdict"], "problem");

  const auto ill = test::clamber("doctor missing/plan.json --json", folder.path());
  EXPECT_EQ(ill.exit_code, 1);
  const auto findings = nlohmann::json::parse(ill.out)["findings"];
  EXPECT_TRUE(std::any_of(findings.begin(), findings.end(), [](const auto& finding) {
    return finding["check"] == "plan" && finding["verdict"] == "problem";
  }));
  EXPECT_EQ(test::clamber("doctor --latency minus", folder.path()).exit_code, 2);
}

}  // namespace
}  // namespace clamber
