#include "tools/limb_ik.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace clamber::tools {

Eigen::Vector3d middle_joint(const Eigen::Vector3d& root, const Eigen::Vector3d& end, double upper,
                             double lower, const Eigen::Vector3d& hint) {
  const Eigen::Vector3d span = end - root;
  const double distance = span.norm();
  if (distance >= upper + lower || distance <= std::abs(upper - lower)) {
    throw std::invalid_argument("limb of " + std::to_string(upper + lower) + " m cannot span " +
                                std::to_string(distance) + " m");
  }
  const Eigen::Vector3d along = span / distance;
  const double a = (upper * upper - lower * lower + distance * distance) / (2.0 * distance);
  const Eigen::Vector3d aside = (hint - hint.dot(along) * along).normalized();
  return root + a * along + std::sqrt(upper * upper - a * a) * aside;
}

LimbPose limb_from_points(const Eigen::Vector3d& root, const Eigen::Vector3d& middle,
                          const Eigen::Vector3d& end, Hinge hinge) {
  const Eigen::Vector3d z_upper = (root - middle).normalized();
  const Eigen::Vector3d z_lower = (middle - end).normalized();
  Eigen::Vector3d y = z_upper.cross(z_lower).normalized();
  // Elbows bring the lower segment forward, which is a negative turn about y; knees a positive one.
  if (hinge == Hinge::kElbow) y = -y;
  LimbPose pose;
  pose.R_upper << y.cross(z_upper), y, z_upper;
  pose.R_lower << y.cross(z_lower), y, z_lower;
  return pose;
}

Eigen::Vector3d sag_lat_yaw(const Eigen::Matrix3d& R) {
  return {std::atan2(R(0, 2), R(2, 2)), std::asin(std::clamp(-R(1, 2), -1.0, 1.0)),
          std::atan2(R(1, 0), R(1, 1))};
}

Eigen::Matrix3d from_sag_lat_yaw(const Eigen::Vector3d& angles) {
  return (Eigen::AngleAxisd(angles[0], Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(angles[1], Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(angles[2], Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

}  // namespace clamber::tools
