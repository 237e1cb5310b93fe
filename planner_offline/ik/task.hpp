// Tasks T = (J, e) of the inverse kinematics, their aggregation and priority (paper IV-A, Eq.
// (4)-(7)). Any thread; allocates; never blocks.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot_model/kinematics.hpp"

namespace clamber {

/// Eq. (4): J (rows x nv) and the error e (rows) that J dv shall remove.
struct Task {
  Eigen::MatrixXd J;
  Eigen::VectorXd e;
};

/// Eq. (5), (6): both tasks at one level, rows concatenated.
[[nodiscard]] Task operator+(const Task& a, const Task& b);

/// Levels of strictly decreasing priority.
using TaskStack = std::vector<Task>;

/// Eq. (7): `low` is solved only in what `high` leaves free.
[[nodiscard]] TaskStack operator/(TaskStack high, const Task& low);
[[nodiscard]] TaskStack operator/(const Task& high, const Task& low);

[[nodiscard]] Task empty_task(const RobotModel& model);
[[nodiscard]] Task scaled(Task task, double weight);

/// A point fixed to `body` (world coordinates p_W now) shall move by `error` (m).
[[nodiscard]] Task point_task(const RobotModel& model, const RobotData& data, int body,
                              const Eigen::Vector3d& p_W, const Eigen::Vector3d& error);

/// A body shall take the pose X_WB_desired (6 rows: position, rotation vector).
[[nodiscard]] Task pose_task(const RobotModel& model, const RobotData& data, int body,
                             const Pose& X_WB_desired);

/// The same point task with the common support link as frame of reference (paper IV-A): the error
/// and Jacobian are those of the point relative to `support`, so a support that moves during the
/// iteration carries its dependants with it.
[[nodiscard]] Task relative_point_task(const RobotModel& model, const RobotData& data, int support,
                                       int body, const Eigen::Vector3d& p_W,
                                       const Eigen::Vector3d& error);

/// The centre of mass shall move horizontally by `error` (m).
[[nodiscard]] Task com_task(const RobotModel& model, const RobotData& data,
                            const Eigen::Vector2d& error);

/// The joints shall take q_desired (rad), weighted per joint.
[[nodiscard]] Task posture_task(const RobotModel& model, const JointVector& q,
                                const JointVector& q_desired, const JointVector& weight);

}  // namespace clamber
