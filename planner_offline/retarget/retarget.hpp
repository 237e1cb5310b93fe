// Maps a human motion to the robot by joint angles (paper III-A, Eq. (1)).
// Start-up only: allocates, throws InputError, never blocks.
#pragma once

#include "planner_offline/motion.hpp"
#include "planner_offline/recording/human_motion.hpp"
#include "planner_offline/retarget/retarget_config.hpp"
#include "robot_model/model.hpp"

namespace clamber {

/// Every chain's rotation is re-extracted in the robot's own axis order, kept continuous over time
/// and then clamped to the joint limits; joints that no chain names stay at their neutral angle.
/// The base keeps the base segment's orientation; its path is the human hip centre's, scaled by
/// robot leg / human hip height. The world of the result: +x is the direction of the climb
/// (motion.heading), z = 0 the floor, and in frame 0 the mid-point between the soles is at
/// x = y = 0 with the lower sole on the floor.
/// @throws InputError when the motion lacks a segment, the robot a joint, or the human's hip
///         height is not known
[[nodiscard]] RobotMotion retarget(const HumanMotion& motion, const RobotModel& model,
                                   const RetargetConfig& config);

}  // namespace clamber
