// `clamber climb` on the shipped demonstration, twice: the robot arrives, within its limits, and
// both times to the same byte.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <future>
#include <nlohmann/json.hpp>

#include "robot_model/sha256.hpp"
#include "tests/apps/command_line.hpp"

namespace clamber {
namespace {

using nlohmann::json;

class ClimbEndToEnd : public testing::Test {
 protected:
  /// The two climbs run at the same time, each in its own folder.
  static void SetUpTestSuite() {
    first_ = new test::TemporaryFolder("climb_first");
    second_ = new test::TemporaryFolder("climb_second");
    const auto climb = [](const test::TemporaryFolder* folder) {
      return test::clamber("climb --quick --no-dds --out climb", folder->path());
    };
    auto other = std::async(std::launch::async, climb, second_);
    result_ = new test::CommandResult(climb(first_));
    EXPECT_EQ(other.get().exit_code, 0);
    EXPECT_EQ(result_->exit_code, 0) << result_->error;
    keep();
  }
  /// Other tests begin where a climb ends.
  static void keep() {
    const std::filesystem::path kept = CLAMBER_CLIMB_FOLDER;
    std::filesystem::create_directories(kept);
    for (const char* name :
         {"plan.json", "plan.cert", "plan.img", "climb.log", "summary.json", "climb.html"})
      // Without npm there is no climb.html.
      if (std::filesystem::exists(file(name)))
        std::filesystem::copy_file(file(name), kept / name,
                                   std::filesystem::copy_options::overwrite_existing);
  }
  static void TearDownTestSuite() {
    delete first_;
    delete second_;
    delete result_;
  }
  static std::filesystem::path file(const char* name) { return first_->path() / "climb" / name; }
  static std::filesystem::path again(const char* name) { return second_->path() / "climb" / name; }
  static json summary() { return json::parse(test::text_of(file("summary.json"))); }

  static test::TemporaryFolder* first_;
  static test::TemporaryFolder* second_;
  static test::CommandResult* result_;
};
test::TemporaryFolder* ClimbEndToEnd::first_ = nullptr;
test::TemporaryFolder* ClimbEndToEnd::second_ = nullptr;
test::CommandResult* ClimbEndToEnd::result_ = nullptr;

TEST_F(ClimbEndToEnd, TheJudgeSeesTheRobotOnTop) {
  const json s = summary();
  EXPECT_EQ(s.at("success"), true);
  EXPECT_THAT(s.at("judge").at("final_contacts").get<std::vector<std::string>>(),
              testing::UnorderedElementsAre("Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"));
  EXPECT_TRUE(s.at("judge").at("floor_contacts").empty());
  EXPECT_TRUE(s.at("judge").at("forbidden_contacts").empty());
  EXPECT_GE(s.at("judge").at("weight_on_obstacle").get<double>(), 0.95);
  EXPECT_EQ(s.at("obstacle_height_m"), 0.275);
  EXPECT_EQ(s.at("synthetic_recording"), true);
  EXPECT_THAT(result_->out, testing::HasSubstr("SUCCESS"));
}

TEST_F(ClimbEndToEnd, StaysWithinTheTorqueLimits) {
  const json s = summary();
  EXPECT_LE(s.at("peak_torque_nm").at("plan").at("value").get<double>(), 30.0);
  EXPECT_LE(s.at("peak_torque_after_hands_nm").get<double>(), 20.0);
  EXPECT_GT(s.at("peak_torque_nm").at("playback").at("value").get<double>(), 0.0);
}

TEST_F(ClimbEndToEnd, ThePlanIsCertifiedAndNothingElseRuns) {
  const json certificate = summary().at("certificate");
  EXPECT_EQ(certificate.at("valid"), true);
  EXPECT_GE(certificate.at("samples").get<std::size_t>(), 4000u);
  EXPECT_EQ(certificate.at("sha256"), sha256_file(file("plan.cert")));
  const std::string climb = file("").string();
  EXPECT_EQ(test::clamber("verify '" + climb + "plan.json' --image '" + climb + "plan.img'",
                          first_->path())
                .exit_code,
            0);
  const test::CommandResult asked =
      test::clamber("verify '" + climb + "plan.json' --json", first_->path());
  EXPECT_EQ(json::parse(asked.out).at("margins").size(), 24u);

  std::string plan = test::text_of(file("plan.json"));
  plan.replace(plan.find("0.8"), 3, "0.7");
  std::ofstream(first_->path() / "tampered.json") << plan;
  const std::string with = "tampered.json --certificate '" + climb + "plan.cert'";
  EXPECT_EQ(test::clamber("verify " + with, first_->path()).exit_code, 1);
  const test::CommandResult run = test::clamber("run --no-dds " + with, first_->path());
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.error, testing::HasSubstr("its certificate is refused"));
  const test::CommandResult bare = test::clamber("run --no-dds tampered.json", first_->path());
  EXPECT_EQ(bare.exit_code, 2);
  EXPECT_THAT(bare.error, testing::HasSubstr("the plan has no certificate"));
}

/// Even with a certificate made to fit, a plan does not claim more than its certificate holds for.
TEST_F(ClimbEndToEnd, ThePlanSaysWhatUncertaintyItIsCertifiedFor) {
  std::string plan = test::text_of(file("plan.json"));
  const json stated = json::parse(plan).at("certified_for");
  const json certified = summary().at("certificate").at("uncertainty");
  ASSERT_EQ(stated.size(), certified.size());
  for (std::size_t i = 0; i < stated.size(); ++i)
    EXPECT_EQ(stated[i].at("holds"), certified[i].at("holds")) << stated[i].at("what");

  const std::string digest = sha256_hex(plan);
  const std::size_t at = plan.find("\"holds\": ", plan.find("obstacle height"));
  plan.replace(at, plan.find('\n', at) - at, "\"holds\": 0.05");
  std::string certificate = test::text_of(file("plan.cert"));
  certificate.replace(certificate.find(digest), digest.size(), sha256_hex(plan));
  std::ofstream(first_->path() / "boast.json") << plan;
  std::ofstream(first_->path() / "boast.cert") << certificate;
  const test::CommandResult boast = test::clamber("verify boast.json", first_->path());
  EXPECT_EQ(boast.exit_code, 1);
  EXPECT_THAT(boast.out + boast.error, testing::HasSubstr("certified_for"));
}

TEST_F(ClimbEndToEnd, TwoClimbsGiveTheSameBytes) {
  for (const char* name : {"motion.csv", "contacts.yaml", "plan.json", "plan.cert", "plan.img",
                           "trajectory.csv", "costs.csv", "climb.log", "playback.log"})
    EXPECT_EQ(sha256_file(file(name)), sha256_file(again(name))) << name;
  EXPECT_EQ(summary().at("plan_sha256"), sha256_file(file("plan.json")));
  EXPECT_EQ(summary().at("log_sha256"), sha256_file(file("climb.log")));
}

TEST_F(ClimbEndToEnd, TheStepsOneByOneGiveTheSamePlan) {
  const std::string folder = file("").string();
  EXPECT_EQ(test::clamber("contacts '" + folder + "motion.csv' -o contacts.yaml", first_->path())
                .exit_code,
            0);
  EXPECT_EQ(test::clamber("plan contacts.yaml -o plan.json", first_->path()).exit_code, 0);
  EXPECT_EQ(sha256_file(first_->path() / "contacts.yaml"), sha256_file(file("contacts.yaml")));
  EXPECT_EQ(sha256_file(first_->path() / "plan.json"), sha256_file(file("plan.json")));
}

TEST_F(ClimbEndToEnd, TheReportIsThere) {
  const std::string page = test::text_of(file("report.html"));
  EXPECT_THAT(page, testing::HasSubstr("climb_table_synthetic.mvnx"));
  for (const char* stage : {"import", "playback analysis", "reference optimisation", "search",
                            "timing and torques", "total"})
    EXPECT_TRUE(summary().at("planning_s").contains(stage)) << stage;
}

/// The same plan over both drive protocols, on simulated buses: judged by the simulated contacts.
TEST_F(ClimbEndToEnd, ClimbsOnVirtualDrivesOfBothProtocols) {
  const auto rehearse = [](const test::TemporaryFolder* folder, const std::string& map) {
    return test::clamber("run climb/plan.json --rehearse --hal configs/hal/" + map, folder->path());
  };
  auto other = std::async(std::launch::async, rehearse, second_, "coman_cia402.yaml");
  const test::CommandResult mit = rehearse(first_, "coman_mit.yaml");
  const test::CommandResult cia402 = other.get();
  for (const test::CommandResult& result : {mit, cia402}) {
    EXPECT_EQ(result.exit_code, 0) << result.error;
    EXPECT_THAT(result.out, testing::HasSubstr("0 replies missing"));
    EXPECT_THAT(result.out, testing::HasSubstr("judge:       success"));
  }
}

}  // namespace
}  // namespace clamber
