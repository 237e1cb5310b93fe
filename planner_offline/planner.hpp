// The planner: from a contact sequence to a statically stable, torque-feasible plan (paper IV).
// Start-up only: allocates; one plan_climb() per thread; deterministic.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "planner_offline/contacts/contact_sequence.hpp"
#include "planner_offline/plan.hpp"
#include "planner_offline/planning_failed.hpp"
#include "planner_offline/references/reference_optimiser.hpp"
#include "planner_offline/settings.hpp"

namespace clamber {

/// What the planner tried.
struct PlanningLog {
  std::vector<CostSample> costs;      ///< every iteration of the reference optimisation
  std::vector<std::string> rejected;  ///< why each candidate that failed was given up
  std::size_t candidates = 0;
  std::size_t backtracks = 0;
  /// Stages "reference optimisation", "search", "after all fours", "timing and torques", "checks of
  /// plans found", "failure policies", those that there were: s of wall time each.
  std::vector<std::pair<std::string, double>> stages;
};

struct PlanningResult : PlanningLog {
  Plan plan;
};

/// Called as the work goes on: share done (0..1) and what is being done.
using PlanningProgress = std::function<void(double share, const std::string& what)>;

/// Why a plan that was found does not do after all (it gets no certificate); empty: it does, and
/// the plan says what it is certified for.
using PlanCheck = std::function<std::string(Plan&)>;

/// A plan without phases and keyframes: what it is made for and from.
[[nodiscard]] Plan plan_header(const RobotModel& model, const Scenario& scenario,
                               const std::string& recording, bool synthetic_recording);

/// Plans the climb of the scenario's first obstacle from its start pose. Where `check` is given, a
/// climb it has something against is not taken and the search goes on.
/// @throws InputError     a sequence or scenario that does not fit the robot
/// @throws PlanningFailed no statically stable, torque-feasible motion was found; with the log of
///                        what was tried, or contacts that make no climb
[[nodiscard]] PlanningResult plan_climb(const RobotModel& model, const Scenario& scenario,
                                        const ContactSequence& sequence,
                                        const PlannerSettings& settings,
                                        const PlanningProgress& progress,
                                        const PlanCheck& check = nullptr);

/// The same without a demonstration: which links touch where and in which order is searched for.
/// @throws as plan_climb()
[[nodiscard]] PlanningResult plan_without_recording(const RobotModel& model,
                                                    const Scenario& scenario,
                                                    const PlannerSettings& settings,
                                                    const PlanningProgress& progress,
                                                    const PlanCheck& check = nullptr);

/// The links that land, in their order; those that land together joined by '+'.
[[nodiscard]] std::vector<std::string> contact_order(const Plan& plan);

}  // namespace clamber
