// Xsens MVN's joint angles from segment orientations (user manual MV0319P rev. N, 19.8).
// Any thread; allocates: never; blocks: never; throws: never.
#pragma once

#include <Eigen/Core>
#include <string_view>

namespace clamber {

/// The triple that MVNX stores as jointAngle for the joint `label` (jRightKnee ...): x abduction
/// (spine: lean right), y internal rotation (spine: turn left), z flexion; rad; extracted in the
/// order flexion, abduction, rotation (ISB Z-X-Y).
/// @param R_parent, R_child anatomical segment frames in the world (HumanMotion's convention)
[[nodiscard]] Eigen::Vector3d mvn_joint_angle(const Eigen::Matrix3d& R_parent,
                                              const Eigen::Matrix3d& R_child,
                                              std::string_view label) noexcept;

}  // namespace clamber
