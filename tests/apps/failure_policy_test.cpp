// A slice of bench/failure_policy: the recorded climb, its host killed while the robot stands and
// when its hands are on the obstacle.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/controller_config.hpp"
#include "bench/failure_policy/tables.hpp"
#include "planner_offline/plan_image.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

KillInputs recorded_climb() {
  const std::filesystem::path configs = std::filesystem::path(CLAMBER_SOURCE_DIR) / "configs";
  const std::filesystem::path robot = configs / "robots/coman";
  KillInputs inputs;
  inputs.model = load_robot(robot / "robot.yaml");
  inputs.scenario = load_scenario(configs / "scenarios/box_0.275.yaml");
  inputs.plan = load_plan(std::filesystem::path(CLAMBER_CLIMB_FOLDER) / "plan.json");
  inputs.control = load_controller_config(configs / "control/default.yaml", inputs.model,
                                          robot / "control.yaml");
  inputs.control.accept_uncertified = true;  // certified when it was recorded
  inputs.image = plan_to_image(inputs.plan);
  return inputs;
}

TEST(FailurePolicy, OnlyLimpDrivesLetAStandingRobotFall) {
  const KillInputs inputs = recorded_climb();
  KillOptions options;
  options.first = 1.5;
  options.stride = 6.5;
  options.last = 8.0;
  options.watch = 3.0;
  const std::vector<Kill> kills = kill_everywhere(inputs, options);
  ASSERT_EQ(kills.size(), 2u);
  EXPECT_EQ(kills[0].planned, FailurePolicy::kHold);  // on its feet alone
  EXPECT_TRUE(kills[0].by(FailurePolicy::kLimp).fell);
  EXPECT_LT(kills[0].by(FailurePolicy::kLimp).after, 1.0);
  for (const Kill& kill : kills) {
    EXPECT_FALSE(kill.by(FailurePolicy::kHold).fell);
    EXPECT_NEAR(kill.by(FailurePolicy::kHold).sunk, 0.0, 0.01);
    EXPECT_FALSE(kill.by(kill.planned).fell);
  }
  // The same again: a copy of the process begins where the climb is.
  const std::vector<Kill> again = kill_everywhere(inputs, options);
  EXPECT_EQ(kills_csv(again, inputs.plan), kills_csv(kills, inputs.plan));
}

TEST(FailurePolicyTables, CountFallsUnderThePlansOwnPolicy) {
  Plan plan;
  plan.phases = {{"stand", 0.0, FailurePolicy::kHold}, {"kneel", 1.0, FailurePolicy::kLower}};
  std::vector<Kill> kills(4);
  for (std::size_t i = 0; i < kills.size(); ++i) {
    Kill& kill = kills[i];
    kill.time = static_cast<double>(i);
    kill.phase = i < 2 ? 0 : 1;
    kill.planned = plan.phases[kill.phase].failure_policy;
    kill.of[static_cast<std::size_t>(FailurePolicy::kHold)].effort = 16.0;
    kill.of[static_cast<std::size_t>(FailurePolicy::kLower)] = {.fell = i == 0, .effort = 1.0};
    kill.of[static_cast<std::size_t>(FailurePolicy::kLimp)].fell = true;
  }
  EXPECT_EQ(tally(kills, FailurePolicy::kHold).falls, 0u);
  EXPECT_EQ(tally(kills, FailurePolicy::kHold).torque, 4.0);
  EXPECT_EQ(tally(kills, FailurePolicy::kLower).falls, 1u);
  EXPECT_EQ(tally(kills, FailurePolicy::kLimp).falls, 4u);
  EXPECT_EQ(tally(kills, std::nullopt).falls, 0u);
  EXPECT_EQ(tally(kills, std::nullopt).torque, std::sqrt(8.5));
  const std::string text = kills_markdown(kills, plan, {}, "command");
  EXPECT_THAT(text, testing::HasSubstr("| limp | 4 of 4 | 100.0 % |"));
  EXPECT_THAT(text, testing::HasSubstr("| stand | 0.0 | hold | 2 | 0 | 1 | 2 |"));
  EXPECT_THAT(text, testing::HasSubstr("| kneel | 1.0 | lower | 2 | 0 | 0 | 2 |"));
  EXPECT_THAT(kills_svg(kills, plan), testing::HasSubstr("1 of 4"));
}

}  // namespace
}  // namespace clamber
