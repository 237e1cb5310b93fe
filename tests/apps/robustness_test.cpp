// A slice of bench/robustness: the shipped climb in two perturbed worlds, and how trials are
// counted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/steps.hpp"
#include "bench/robustness/tables.hpp"
#include "bench/robustness/trial.hpp"
#include "planner_offline/contacts/playback.hpp"
#include "planner_offline/plan_image.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

TrialInputs planned_climb() {
  TrialInputs inputs;
  inputs.model = load_robot(RobotOptions{});
  inputs.scenario = load_scenario(ScenarioOptions{});
  const LoadedMotion motion = load_motion("configs/recordings/climb_table_synthetic.mvnx", {},
                                          RobotOptions{}, inputs.model);
  Progress quiet(true);
  const ContactSequence contacts =
      extract_contacts(inputs.model, motion.motion, inputs.scenario, {});
  inputs.plan =
      make_plan(inputs.model, inputs.scenario, &contacts, "configs/planner/default.yaml", {}, quiet)
          .plan;
  inputs.control = load_control("configs/control/default.yaml", {}, inputs.model);
  inputs.control.accept_uncertified = true;  // certified while it was planned; no file is written
  inputs.image = plan_to_image(inputs.plan, {});
  return inputs;
}

TEST(Robustness, ClimbsInPerturbedWorlds) {
  TrialInputs inputs = planned_climb();
  // Whatever the seeds draw: the simulator's coarse step, so that this stays short.
  inputs.left_out = {"stepper"};
  int springs = 0, rigid = 0;
  for (std::uint64_t seed = 1; springs + rigid < 2; ++seed) {
    const Perturbation p = perturbation_of(inputs, seed);
    if (p.step < 2e-3 || (p.springs ? springs : rigid) > 0) continue;
    (p.springs ? springs : rigid) += 1;
    const Json trial = run_trial(inputs, seed);
    EXPECT_TRUE(trial.at("success").get<bool>()) << trial.dump(1);
    EXPECT_EQ(trial.at("perturbation").at("friction").get<double>(), p.friction);
    EXPECT_GT(trial.at("farthest_m").get<double>(), 1e-3);
    EXPECT_LT(trial.at("farthest_m").get<double>(), 0.05);
  }
}

Json trial(std::uint64_t seed, bool success, double friction) {
  Json events = Json::array();
  if (!success)
    events.push_back({{"time", 12.3}, {"phase", "swing Lknee"}, {"what", "Lknee never loaded"}});
  return {{"seed", seed},
          {"success", success},
          {"perturbation",
           {{"friction", friction},
            {"height_m", 0.004},
            {"start_x_m", 0.01},
            {"start_y_m", -0.01},
            {"start_yaw_rad", 0.0},
            {"springs", seed % 2 == 0},
            {"delay_s", 0.001},
            {"encoder_resolution_rad", 5e-5},
            {"encoder_noise_rad", 5e-5},
            {"step_s", 1e-3},
            {"stepper", "quick"}}},
          {"failure", success ? "" : "not on the obstacle: Lknee"},
          {"events", events},
          {"peak_torque_nm", 20.0},
          {"farthest_m", 0.01},
          {"most_tilted_deg", 2.0}};
}

TEST(RobustnessTables, WilsonsInterval) {
  // From the formula by hand: 9 of 10, and all of 1000.
  EXPECT_NEAR(wilson(9, 10).low, 0.5958, 1e-4);
  EXPECT_NEAR(wilson(9, 10).high, 0.9821, 1e-4);
  EXPECT_NEAR(wilson(1000, 1000).low, 0.99617, 1e-5);
  EXPECT_EQ(wilson(1000, 1000).high, 1.0);
  EXPECT_EQ(wilson(0, 0).low, 0.0);
}

TEST(RobustnessTables, CountByParameterAndTellFailures) {
  std::vector<Json> trials;
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    trials.push_back(trial(seed, seed != 7, seed == 7 ? 0.5 : 0.5 + 0.025 * double(seed)));
  for (const Breakdown& parameter : break_down(trials)) {
    std::size_t all = 0, good = 0;
    for (const Breakdown::Bin& bin : parameter.bins) {
      all += bin.trials;
      good += bin.successes;
    }
    EXPECT_EQ(all, 20u) << parameter.parameter;
    EXPECT_EQ(good, 19u) << parameter.parameter;
  }
  const std::string text = robustness_markdown(trials, "command");
  EXPECT_THAT(text, testing::HasSubstr("**19 of 20 climbs: 95.0 (76.4 to 99.1) %**"));
  EXPECT_THAT(text,
              testing::HasSubstr("| 7 | mu 0.50, height 4.0, start 10 -10 mm 0.0 deg, rigid"));
  EXPECT_THAT(text, testing::HasSubstr("12.3 s (swing Lknee) Lknee never loaded"));
  EXPECT_EQ(robustness_json(trials).at("failures").size(), 1u);
  EXPECT_THAT(robustness_svg(trials), testing::HasSubstr("19 of 20"));
}

}  // namespace
}  // namespace clamber
