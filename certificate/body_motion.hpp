// Where every body is and how it moves at a sample, and bounds on its motion around it.
// Any thread; allocates: never; blocks: never; throws: never.
#pragma once

#include <array>

#include "certificate/planned_motion.hpp"
#include "robot_model/kinematics.hpp"

namespace clamber {

/// Velocity of the points p of a body: v + w x (p - origin), world axes.
struct Twist {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  Eigen::Vector3d w = Eigen::Vector3d::Zero();
  [[nodiscard]] Eigen::Vector3d at(const Eigen::Vector3d& p) const {
    return v + w.cross(p - origin);
  }
};

/// Upper bounds on a body's motion for some time around a sample.
struct BodyBounds {
  double turn_rate = 0.0;          ///< rad/s
  double turn_acceleration = 0.0;  ///< rad/s^2
  double acceleration = 0.0;       ///< of the body's origin, m/s^2
  /// Of any point of the body within `reach` (m) of its origin, m/s^2.
  [[nodiscard]] double at(double reach) const {
    return acceleration + (turn_acceleration + turn_rate * turn_rate) * reach;
  }
};

/// Twist of every body from the generalised velocity, from the base outwards.
void body_twists(const RobotModel& model, const RobotData& data, const VelocityVector& v,
                 std::array<Twist, kMaxBodies>& twists) noexcept;

/// From the base outwards as well: |a_child| <= |a_parent| + (|alpha| + |w|^2) |offset|,
/// |w_child| <= |w| + |rate|, |alpha_child| <= |alpha| + |joint acceleration| + |w| |rate|.
void body_bounds(const RobotModel& model, const MotionBounds& motion,
                 std::array<BodyBounds, kMaxBodies>& bounds) noexcept;

}  // namespace clamber
