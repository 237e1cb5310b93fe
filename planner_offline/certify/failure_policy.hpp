// What the drives shall do if the host falls silent in a phase of a plan, computed from the plan.
// Any thread; allocates; never blocks; deterministic.
//
// Of the reactions after which the robot does not fall, the one that leaves the least torque:
//   limp   only where it needs no torque at all: every joint's is within the dry friction of its
//          drive, at every keyframe. It then stays where it is.
//   lower  where sinking ends gently: foreseen (sinking.hpp) from keyframes at most half a second
//          apart, the centre of mass stays slower than half of what a fall is judged by, it has
//          come to rest, and torso and pelvis have touched nothing.
//   hold   everywhere else. Every keyframe is in static equilibrium within friction cones and
//          torque limits, or there would be no plan: what freezes, stays. But the drives stay
//          loaded, and warm, until somebody comes.
#pragma once

#include "planner_offline/certify/sinking.hpp"
#include "planner_offline/plan.hpp"

namespace clamber {

/// What decides a phase's policy: the worst over it, its beginning included.
struct FailureCase {
  double needed =
      0.0;          ///< N m, largest |tau| beyond a drive's dry friction; at most 0: none needed
  Sinking sinking;  ///< the fastest, the least distance
};
[[nodiscard]] FailurePolicy failure_policy(const FailureCase& worst) noexcept;

/// One a phase.
[[nodiscard]] std::vector<FailureCase> failure_cases(const RobotModel& model,
                                                     const Scenario& scenario, const Plan& plan);

/// Sets every phase's policy.
void state_failure_policies(const RobotModel& model, const Scenario& scenario, Plan& plan);

}  // namespace clamber
