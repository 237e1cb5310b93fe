// Two-link limbs: segment orientations from where the joints shall be.
// Any thread; allocates: never; blocks: never.
#pragma once

#include <Eigen/Core>

namespace clamber::tools {

/// Orientations of an upper and a lower limb segment that share their hinge axis y.
struct LimbPose {
  Eigen::Matrix3d R_upper;
  Eigen::Matrix3d R_lower;
};

enum class Hinge { kElbow, kKnee };  ///< which way the limb bends: forearm forward, shank backward

/// The middle joint of a limb from `root` to `end`, bent towards `hint`.
/// @throws std::invalid_argument when `end` is out of reach
[[nodiscard]] Eigen::Vector3d middle_joint(const Eigen::Vector3d& root, const Eigen::Vector3d& end,
                                           double upper, double lower, const Eigen::Vector3d& hint);

/// Frames of both segments from the three joint positions; the limb must not be straight.
[[nodiscard]] LimbPose limb_from_points(const Eigen::Vector3d& root, const Eigen::Vector3d& middle,
                                        const Eigen::Vector3d& end, Hinge hinge);

/// Angles (s, l, y) with R = Ry(s) Rx(l) Rz(y).
[[nodiscard]] Eigen::Vector3d sag_lat_yaw(const Eigen::Matrix3d& R);
[[nodiscard]] Eigen::Matrix3d from_sag_lat_yaw(const Eigen::Vector3d& angles);

}  // namespace clamber::tools
