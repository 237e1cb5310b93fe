// Joint-sized linear algebra with a compile-time maximum, so that nothing allocates.
// Any thread; allocates: never; blocks: never.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace clamber {

inline constexpr int kMaxJoints = 32;
inline constexpr int kMaxVelocities = 6 + kMaxJoints;
inline constexpr int kMaxBodies = 1 + kMaxJoints;
inline constexpr double kGravity = 9.81;  ///< m/s^2, along -z of the world

using JointVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;
/// Generalised velocity or force: [linear of base origin; angular; joints], both base parts
/// expressed in the world frame. Size 6 + joints.
using VelocityVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxVelocities, 1>;
using Jacobian3 = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxVelocities>;
/// Rows: linear velocity of the point, then angular velocity; both in the world frame.
using Jacobian6 = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxVelocities>;
using MassMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxVelocities, kMaxVelocities>;

/// A rigid transform as rotation and origin; X_AB maps coordinates in B to coordinates in A.
struct Pose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return R * x + p; }
  [[nodiscard]] Pose operator*(const Pose& other) const { return {R * other.R, R * other.p + p}; }
  [[nodiscard]] Pose inverse() const { return {R.transpose(), -(R.transpose() * p)}; }
};

/// Where the robot is: base (root body) in the world and joint angles in the model's joint order.
struct Configuration {
  Pose X_WB;
  JointVector q;  ///< rad
};

}  // namespace clamber
