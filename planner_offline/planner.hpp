// The planner: from a contact sequence to a statically stable, torque-feasible plan (paper IV).
// Start-up only: allocates; one plan_climb() per thread; deterministic.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "planner_offline/contacts/contact_sequence.hpp"
#include "planner_offline/plan.hpp"
#include "planner_offline/references/reference_optimiser.hpp"
#include "planner_offline/settings.hpp"

namespace clamber {

/// The inputs are usable and the climb is not possible with them: the message says which move and
/// which constraint. Exit code 1, not 2.
class PlanningFailed : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct PlanningResult {
  Plan plan;
  std::vector<CostSample> costs;      ///< every iteration of the reference optimisation
  std::vector<std::string> rejected;  ///< why each candidate that failed was given up
  std::size_t candidates = 0;
  std::size_t backtracks = 0;
  /// Stages "reference optimisation", "search", "timing and torques": s of wall time each.
  std::vector<std::pair<std::string, double>> stages;
};

/// Called as the work goes on: share done (0..1) and what is being done.
using PlanningProgress = std::function<void(double share, const std::string& what)>;

/// Plans the climb of the scenario's first obstacle from its start pose.
/// @throws InputError     a sequence or scenario that does not fit the robot
/// @throws PlanningFailed no statically stable, torque-feasible motion was found
[[nodiscard]] PlanningResult plan_climb(const RobotModel& model, const Scenario& scenario,
                                        const ContactSequence& sequence,
                                        const PlannerSettings& settings,
                                        const PlanningProgress& progress);

}  // namespace clamber
