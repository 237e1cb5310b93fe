// Is a leg standing on its foot? Then its knee, at whatever height, rests on nothing.
// Any thread; allocates: never; blocks: never.
#pragma once

#include "robot_model/kinematics.hpp"

namespace clamber {

/// Middle of a foot's sole in the world, m.
[[nodiscard]] Eigen::Vector3d sole_middle(const ContactLink& foot, const RobotData& data);

/// The foot of the same limb; nullptr: it has none.
[[nodiscard]] const ContactLink* foot_of(const RobotModel& model, const ContactLink& link);

/// The link (a knee) is upright over its limb's foot: kneeling, the shank lies. False for limbs
/// without a foot.
[[nodiscard]] bool upright_over_foot(const RobotModel& model, const ContactLink& link,
                                     const RobotData& data);

}  // namespace clamber
