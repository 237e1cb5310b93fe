// The direct playback of a motion as a plan: what the paper's planner is compared with (Fig. 4, 7).
// Start-up only: allocates.
#pragma once

#include "planner_offline/motion.hpp"
#include "planner_offline/plan.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// The motion's frames as keyframes without feed-forward, every n-th one where there are more than
/// an image holds. @throws InputError for a motion of fewer than two frames
[[nodiscard]] Plan playback_plan(const RobotModel& model, const RobotMotion& motion,
                                 const Scenario& scenario);

/// The motion's first posture at the scenario's start pose, the lower sole on the floor.
[[nodiscard]] Configuration playback_start(const RobotMotion& motion, const Scenario& scenario);

}  // namespace clamber
