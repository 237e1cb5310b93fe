#include "planner_offline/ik/task.hpp"

#include <utility>

namespace clamber {

Task operator+(const Task& a, const Task& b) {
  if (a.e.size() == 0) {
    return b;
  }
  Task sum;
  sum.J.resize(a.J.rows() + b.J.rows(), a.J.cols());
  sum.e.resize(a.e.size() + b.e.size());
  sum.J << a.J, b.J;
  sum.e << a.e, b.e;
  return sum;
}

TaskStack operator/(TaskStack high, const Task& low) {
  high.push_back(low);
  return high;
}

TaskStack operator/(const Task& high, const Task& low) { return TaskStack{high, low}; }

Task empty_task(const RobotModel& model) {
  return {Eigen::MatrixXd(0, model.velocity_count()), Eigen::VectorXd(0)};
}

Task scaled(Task task, double weight) {
  task.J *= weight;
  task.e *= weight;
  return task;
}

Task point_task(const RobotModel& model, const RobotData& data, int body,
                const Eigen::Vector3d& p_W, const Eigen::Vector3d& error) {
  Jacobian3 J;
  point_jacobian(model, data, body, p_W, J);
  return {J, error};
}

Task pose_task(const RobotModel& model, const RobotData& data, int body, const Pose& X_WB_desired) {
  const Pose& X_WB = data.X_WB[static_cast<std::size_t>(body)];
  Jacobian6 J;
  frame_jacobian(model, data, body, X_WB.p, J);
  Task task{J, Eigen::VectorXd(6)};
  task.e << X_WB_desired.p - X_WB.p, rotation_log(X_WB_desired.R * X_WB.R.transpose());
  return task;
}

Task relative_point_task(const RobotModel& model, const RobotData& data, int support, int body,
                         const Eigen::Vector3d& p_W, const Eigen::Vector3d& error) {
  // Velocity of the point less that of the same point carried along by the support link.
  Jacobian3 J_point, J_carried;
  point_jacobian(model, data, body, p_W, J_point);
  point_jacobian(model, data, support, p_W, J_carried);
  return {J_point - J_carried, error};
}

Task com_task(const RobotModel& model, const RobotData& data, const Eigen::Vector2d& error) {
  Jacobian3 J;
  com_jacobian(model, data, J);
  return {J.topRows<2>(), error};
}

Task posture_task(const RobotModel& model, const JointVector& q, const JointVector& q_desired,
                  const JointVector& weight) {
  const int n = model.joint_count();
  Task task{Eigen::MatrixXd::Zero(n, model.velocity_count()), Eigen::VectorXd(n)};
  task.J.rightCols(n) = weight.asDiagonal();
  task.e = weight.cwiseProduct(q_desired - q);
  return task;
}

}  // namespace clamber
