// Where a posture goes when the drives give up their torque slowly: FailurePolicy::kLower foreseen.
// Any thread; allocates; never blocks; deterministic.
//
// A coarse simulation of the planner's own, on the robot model's dynamics: implicit steps of 10 ms,
// contacts of every link with floor and obstacles as damped springs with friction, velocity
// products left out (it ends where they would count). It shares nothing with the simulation that
// plans are run in, but for the robot.
#pragma once

#include "control/failure_policy.hpp"
#include "planner_offline/clearance/signed_distance.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

struct Sinking {
  double fastest = 0.0;     ///< m/s, of the centre of mass, horizontally and down
  double last_speed = 0.0;  ///< m/s, when the foresight ends
  double depth = 0.0;       ///< m that the centre of mass has come down
  double body_above = 0.0;  ///< m, least distance of torso and pelvis to floor and obstacles
};

/// From rest at x, the joints under tau (N m).
[[nodiscard]] Sinking foresee_sinking(const RobotModel& model, const Scenario& scenario,
                                      const Configuration& x, const JointVector& tau,
                                      const DrivesAlone& drives = {});

}  // namespace clamber
