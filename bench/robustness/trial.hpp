// One climb of a plan in a perturbed world, and its record.
// One thread and one OdeWorld at a time; allocates; throws InputError.
#pragma once

#include <nlohmann/json.hpp>

#include "apps/simulated_run.hpp"
#include "planner_offline/plan.hpp"

namespace clamber {

struct TrialInputs {
  RobotModel model;
  Scenario scenario;
  Plan plan;
  std::vector<std::byte> image;
  ControllerConfig control;
  PerturbationRange range;
  std::vector<std::string> left_out;  ///< parts of the perturbation, by name
};

[[nodiscard]] Perturbation perturbation_of(const TrialInputs& inputs, std::uint64_t seed);

/// seed, success, perturbation, verdict, events and figures. The same inputs and seed give the
/// same record, whatever ran before.
[[nodiscard]] nlohmann::ordered_json run_trial(const TrialInputs& inputs, std::uint64_t seed);

}  // namespace clamber
