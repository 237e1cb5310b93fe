// Forward kinematics, Jacobians and dynamics over a const model and mutable data.
// Any thread (one RobotData each); allocates: never; blocks: never; throws: never.
#pragma once

#include <array>

#include "robot_model/model.hpp"

namespace clamber {

/// Results of forward_kinematics() for one configuration.
struct RobotData {
  std::array<Pose, kMaxBodies> X_WB;               ///< body frames in the world
  std::array<Eigen::Vector3d, kMaxBodies> axis_W;  ///< joint axes in the world (index = body)
  std::array<Eigen::Vector3d, kMaxBodies> com_W;   ///< body centres of mass in the world, m
  Eigen::Vector3d com = Eigen::Vector3d::Zero();   ///< the robot's centre of mass, m
};

/// Fills X_WB, axis_W, com_W and com.
void forward_kinematics(const RobotModel& model, const Configuration& x, RobotData& data) noexcept;

/// Jacobian (3 x nv) of a point fixed to `body`, given in world coordinates.
void point_jacobian(const RobotModel& model, const RobotData& data, int body,
                    const Eigen::Vector3d& p_W, Jacobian3& J) noexcept;

/// Jacobian (6 x nv) of a frame fixed to `body` with its origin at p_W.
void frame_jacobian(const RobotModel& model, const RobotData& data, int body,
                    const Eigen::Vector3d& p_W, Jacobian6& J) noexcept;

/// Jacobian (3 x nv) of the centre of mass.
void com_jacobian(const RobotModel& model, const RobotData& data, Jacobian3& J) noexcept;

/// Generalised gravity force g (nv): what the actuators and contacts must supply at rest,
/// S^T tau + sum J^T f = g.
void gravity_torque(const RobotModel& model, const RobotData& data, VelocityVector& g) noexcept;

/// Inverse dynamics: M(x) a + h(x, v), gravity included; reflected inertia added on the joints.
/// v and a as VelocityVector (a: time derivative of v).
void inverse_dynamics(const RobotModel& model, const RobotData& data, const VelocityVector& v,
                      const VelocityVector& a, VelocityVector& tau) noexcept;

/// Mass matrix (nv x nv), reflected inertia on the joint diagonal.
void mass_matrix(const RobotModel& model, const RobotData& data, MassMatrix& M) noexcept;

/// x integrated by the displacement dv (nv): base rotation by the exponential map.
void integrate(const RobotModel& model, const Configuration& x, const VelocityVector& dv,
               Configuration& out) noexcept;

/// Rotation vector of R (the logarithm map), rad.
[[nodiscard]] Eigen::Vector3d rotation_log(const Eigen::Matrix3d& R) noexcept;
/// Rotation matrix of the rotation vector w.
[[nodiscard]] Eigen::Matrix3d rotation_exp(const Eigen::Vector3d& w) noexcept;

}  // namespace clamber
