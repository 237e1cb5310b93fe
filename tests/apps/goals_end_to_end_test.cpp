// `clamber climb` to goals beyond all fours, and a plan without a recording: executed in ODE and
// judged from the simulator's contacts. (Climbing over takes minutes: configs/cases/goals.yaml.)
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/apps/command_line.hpp"

namespace clamber {
namespace {

using nlohmann::json;
using testing::HasSubstr;

std::vector<std::string> contacts(const json& summary, const char* which) {
  return summary.at("judge").at(which).get<std::vector<std::string>>();
}

TEST(GoalsEndToEnd, TheRobotStandsUpOnTop) {
  const test::TemporaryFolder folder("stand_on_top");
  const test::CommandResult result =
      test::clamber("climb --quick --no-dds --goal stand_on_top --out climb", folder.path());
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const json summary = json::parse(test::text_of(folder.path() / "climb/summary.json"));
  EXPECT_EQ(summary.at("success"), true);
  EXPECT_THAT(contacts(summary, "final_contacts"), testing::UnorderedElementsAre("Lfoot", "Rfoot"));
  EXPECT_THAT(contacts(summary, "floor_contacts"), testing::IsEmpty());
  EXPECT_THAT(result.out, HasSubstr("standing on top of the 0.275 m obstacle"));
}

TEST(GoalsEndToEnd, TheRobotClimbsDownAgain) {
  const test::TemporaryFolder folder("back_down");
  const test::CommandResult result =
      test::clamber("climb --quick --no-dds --goal back_down --out climb", folder.path());
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const json summary = json::parse(test::text_of(folder.path() / "climb/summary.json"));
  EXPECT_EQ(summary.at("success"), true);
  EXPECT_THAT(contacts(summary, "final_contacts"), testing::IsEmpty());
  EXPECT_THAT(contacts(summary, "floor_contacts"), testing::SizeIs(2));
}

TEST(GoalsEndToEnd, WithoutARecordingTheRobotClimbsToo) {
  const test::TemporaryFolder folder("no_recording");
  const test::CommandResult plan = test::clamber("plan --no-recording -o plan.json", folder.path());
  ASSERT_EQ(plan.exit_code, 0) << plan.error;
  EXPECT_THAT(plan.out, HasSubstr("order:       Lwrist+Rwrist"));
  const test::CommandResult run = test::clamber("run plan.json --no-dds -o run.log", folder.path());
  EXPECT_EQ(run.exit_code, 0) << run.error;
  EXPECT_THAT(run.out, HasSubstr("judge:       success"));
}

TEST(GoalsEndToEnd, AGoalThatDoesNotExistIsRefused) {
  const test::TemporaryFolder folder("no_goal");
  const test::CommandResult result = test::clamber("climb --goal handstand", folder.path());
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.error, HasSubstr("--goal"));
}

}  // namespace
}  // namespace clamber
