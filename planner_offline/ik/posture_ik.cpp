#include "planner_offline/ik/posture_ik.hpp"

#include <algorithm>

namespace clamber {

Eigen::VectorXd shortened(const Eigen::VectorXd& e, double most) {
  const double largest = e.size() > 0 ? e.cwiseAbs().maxCoeff() : 0.0;
  return largest > most ? Eigen::VectorXd(e * (most / largest)) : e;
}

void PostureIk::bound(const Configuration& x, bool may_recover, HqpProblem& problem) const {
  const int n = model_.joint_count();
  problem.lower.resize(problem.n);
  problem.upper.resize(problem.n);
  problem.upper.head<3>().setConstant(settings_.base_step);
  problem.upper.segment<3>(3).setConstant(settings_.base_turn);
  for (int i = 0; i < n; ++i) {
    const Joint& joint = model_.joints[static_cast<std::size_t>(i)];
    const double step = settings_.joint_step;
    const double room = joint.upper - settings_.limit_margin - x.q[i];
    problem.upper[6 + i] = std::clamp(room, may_recover ? -step : 0.0, step);
    const double below = joint.lower + settings_.limit_margin - x.q[i];
    problem.lower[6 + i] = std::clamp(below, -step, may_recover ? step : 0.0);
  }
  problem.lower.head<6>() = -problem.upper.head<6>();
}

void PostureIk::keep_in_region(const RobotData& data, const IkConstraints& constraints,
                               bool may_recover, Inequalities& rows) const {
  if (constraints.region == nullptr) {
    return;
  }
  Jacobian3 J;
  com_jacobian(model_, data, J);
  for (const HalfPlane& h : constraints.region->half_planes()) {
    const double gap = h.normal.dot(data.com.head<2>()) - h.offset - constraints.region_margin;
    constexpr double kMayUse = 0.5, kRecover = 0.3, kMostRecovered = 0.004;
    const double d = gap >= 0.0    ? -kMayUse * gap
                     : may_recover ? std::min(-kRecover * gap, kMostRecovered)
                                   : 0.0;
    append(rows, h.normal.transpose() * J.topRows<2>(), d);
  }
}

HqpStatus PostureIk::step(const Configuration& x, const RobotData& data, const TaskStack& stack,
                          const IkConstraints& constraints, VelocityVector& dv) {
  HqpProblem problem;
  problem.n = model_.velocity_count();
  for (const Task& task : stack) {
    if (task.e.size() > 0) {
      problem.levels.push_back({task.J, task.e});
    }
  }
  Eigen::VectorXd solution;
  HqpStatus status = HqpStatus::infeasible;
  for (const bool may_recover : {true, false}) {
    Inequalities rows{Eigen::MatrixXd(0, problem.n), Eigen::VectorXd(0)};
    if (constraints.collisions) {
      clearance_.constrain(data, *constraints.contacts, constraints.landing, may_recover, rows);
    }
    keep_in_region(data, constraints, may_recover, rows);
    problem.C = std::move(rows.C);
    problem.d = std::move(rows.d);
    bound(x, may_recover, problem);
    status = hqp_.solve(problem, solution);
    if (status == HqpStatus::optimal) {
      break;
    }
  }
  if (status != HqpStatus::optimal) {
    solution.setZero(problem.n);
  }
  dv = solution;
  return status;
}

std::string PostureIk::binding(const Configuration& x, const RobotData& data,
                               const IkConstraints& constraints) const {
  constexpr double kAtLimit = 0.01;    // rad
  constexpr double kAtMargin = 0.001;  // m
  std::string out;
  const auto add = [&](const std::string& text) { out += (out.empty() ? " (" : ", ") + text; };
  for (int i = 0; i < model_.joint_count(); ++i) {
    const Joint& joint = model_.joints[static_cast<std::size_t>(i)];
    const double room = std::min(x.q[i] - joint.lower, joint.upper - x.q[i]);
    if (room < settings_.limit_margin + kAtLimit) {
      add(joint.name + " at its limit");
    }
  }
  const ClearanceReport clear = clearance_.report(data, *constraints.contacts, constraints.landing);
  if (clear.obstacle_excess < kAtMargin) {
    add(clear.worst_obstacle_pair + " at its clearance");
  }
  if (clear.self_excess < kAtMargin) {
    add(clear.worst_self_pair + " at theirs");
  }
  return out.empty() ? out : out + ")";
}

}  // namespace clamber
