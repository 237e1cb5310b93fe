#include "planner_offline/certify/contact_forces.hpp"

#include <cmath>
#include <limits>

namespace clamber {
namespace {

/// Pyramid rows of one contact point: mu / sqrt(2) f_z -+ f_x >= 0, likewise f_y.
void friction_rows(Eigen::Index point, double mu, Eigen::MatrixXd& C) {
  const double slope = mu / std::sqrt(2.0);
  for (Eigen::Index k = 0; k < 4; ++k) {
    const Eigen::Index row = 4 * point + k;
    C(row, 3 * point + k / 2) = (k % 2 == 0) ? 1.0 : -1.0;
    C(row, 3 * point + 2) = slope;
  }
}

}  // namespace

void ContactForces::gather_points(const RobotData& data, const ContactSet& contacts) {
  contact_of_point_.clear();
  is_point_.clear();
  std::vector<Jacobian3> blocks;
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    const int body = model_.contacts[static_cast<std::size_t>(contacts[c].link)].body;
    for (const Eigen::Vector3d& p : contact_points(model_, data, contacts[c])) {
      blocks.emplace_back();
      point_jacobian(model_, data, body, p, blocks.back());
      contact_of_point_.push_back(static_cast<int>(c));
      is_point_.push_back(contacts[c].mode == ContactMode::kPoint);
    }
  }
  J_.resize(3 * static_cast<Eigen::Index>(blocks.size()), model_.velocity_count());
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    J_.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = blocks[i];
  }
}

bool ContactForces::solve_program(const VelocityVector& g, double torque_share, double least_normal,
                                  Eigen::VectorXd& f) {
  const int n = model_.joint_count();
  const Eigen::Index variables = J_.rows(), points = variables / 3;
  const bool limited = std::isfinite(torque_share);
  const auto J_joint = J_.rightCols(n);
  Eigen::VectorXd limit(n);
  for (int i = 0; i < n; ++i) {
    limit[i] = model_.joints[static_cast<std::size_t>(i)].torque_limit;
  }
  const Eigen::MatrixXd weighted = J_joint * limit.cwiseInverse().asDiagonal();
  QpProblem qp;
  qp.H = weighted * weighted.transpose();
  // Forces are some hundred newtons: a small pull towards an even distribution makes it unique.
  qp.H.diagonal().array() += 1e-6;
  qp.g = -weighted * (g.tail(n).cwiseQuotient(limit));
  qp.A_eq = J_.leftCols<6>().transpose();
  qp.b_eq = g.head<6>();
  const Eigen::Index torque_rows = limited ? 2 * n : 0;
  qp.C = Eigen::MatrixXd::Zero(4 * points + torque_rows, variables);
  qp.d = Eigen::VectorXd::Zero(4 * points + torque_rows);
  for (Eigen::Index p = 0; p < points; ++p) {
    friction_rows(p, settings_.friction, qp.C);
  }
  if (limited) {
    // |g_joint - J^T f| <= share * limit.
    qp.C.middleRows(4 * points, n) = J_joint.transpose();
    qp.d.segment(4 * points, n) = g.tail(n) - torque_share * limit;
    qp.C.bottomRows(n) = -J_joint.transpose();
    qp.d.tail(n) = -g.tail(n) - torque_share * limit;
  }
  qp.lower = Eigen::VectorXd::Constant(variables, -std::numeric_limits<double>::infinity());
  qp.upper = Eigen::VectorXd::Constant(variables, std::numeric_limits<double>::infinity());
  for (Eigen::Index p = 0; p < points; ++p) {
    qp.lower[3 * p + 2] = is_point_[static_cast<std::size_t>(p)] ? least_normal : 0.0;
  }
  if (qp_.solve(qp) != QpStatus::optimal) {
    return false;
  }
  f = qp_.x();
  return true;
}

ForceSolution ContactForces::solve(const RobotData& data, const ContactSet& contacts) {
  const int n = model_.joint_count();
  ForceSolution solution;
  solution.forces.assign(contacts.size(), Eigen::Vector3d::Zero());
  gather_points(data, contacts);
  VelocityVector g;
  gravity_torque(model_, data, g);
  Eigen::VectorXd f;
  bool feasible = false;
  // In small steps, so that the forces do not jump where a contact's least load goes out of reach.
  for (const double share : {1.0, 0.75, 0.5, 0.25, 0.0}) {
    feasible = solve_program(g, settings_.torque_share, share * settings_.least_normal, f);
    if (feasible) {
      break;
    }
  }
  if (feasible) {
    solution.status = Equilibrium::kFeasible;
  } else if (solve_program(g, std::numeric_limits<double>::infinity(), 0.0, f)) {
    solution.status = Equilibrium::kTorque;
  } else {
    solution.tau = JointVector::Zero(n);
    return solution;
  }
  const Eigen::VectorXd balance = g - VelocityVector(J_.transpose() * f);
  solution.residual = balance.head<6>().norm();
  solution.tau = balance.tail(n);
  solution.torque_margin = std::numeric_limits<double>::infinity();
  for (int i = 0; i < n; ++i) {
    const double tau = std::abs(solution.tau[i]);
    const double limit = model_.joints[static_cast<std::size_t>(i)].torque_limit;
    solution.torque_margin = std::min(solution.torque_margin, limit - tau);
    if (tau / limit > solution.peak_share) {
      solution.peak_share = tau / limit;
      solution.peak_torque = tau;
      solution.peak_joint = i;
    }
  }
  solution.least_friction_slack = std::numeric_limits<double>::infinity();
  for (std::size_t p = 0; p < contact_of_point_.size(); ++p) {
    const Eigen::Vector3d fp = f.segment<3>(3 * static_cast<Eigen::Index>(p));
    solution.forces[static_cast<std::size_t>(contact_of_point_[p])] += fp;
    solution.least_friction_slack =
        std::min(solution.least_friction_slack, settings_.friction * fp.z() - fp.head<2>().norm());
  }
  return solution;
}

}  // namespace clamber
