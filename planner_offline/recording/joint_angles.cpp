#include "planner_offline/recording/joint_angles.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {

Eigen::Vector3d mvn_joint_angle(const Eigen::Matrix3d& R_parent, const Eigen::Matrix3d& R_child,
                                std::string_view label) noexcept {
  const Eigen::Matrix3d R = R_parent.transpose() * R_child;
  // ISB axes are x forward, y up, z right: x = x, y = z_mvn, z = -y_mvn.
  Eigen::Matrix3d B;
  B << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const Eigen::Matrix3d isb = B.transpose() * R * B;
  const double a = std::asin(std::clamp(isb(2, 1), -1.0, 1.0));
  const double b = std::atan2(-isb(2, 0), isb(2, 2));
  const double c = std::atan2(-isb(0, 1), isb(1, 1));

  const bool right = label.starts_with("jRight");
  const bool left = label.starts_with("jLeft");
  if (!right && !left) return {a, b, -c};
  const bool flexes_backward = label.ends_with("Knee") || label.ends_with("BallFoot");
  return {right ? -a : a, left ? -b : b, flexes_backward ? -c : c};
}

}  // namespace clamber
