#include "planner_offline/retarget/chain_solver.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "robot_model/kinematics.hpp"

namespace clamber {
namespace {
using Columns = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>;
using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;
constexpr int kMaxIterations = 100;
constexpr double kConverged = 1e-12;    // rad
constexpr double kSameResidual = 1e-6;  // rad
constexpr double kMinDamping = 1e-12;
constexpr double kMaxDamping = 1e6;
}  // namespace

ChainSolver::ChainSolver(const RobotModel& model, std::vector<int> joints, ChainMatch match,
                         const Eigen::Vector3d& axis)
    : joints_(std::move(joints)), match_(match), axis_(axis) {
  for (const int j : joints_) {
    const auto& body = model.bodies[static_cast<std::size_t>(j) + 1];
    const auto& joint = model.joints[static_cast<std::size_t>(j)];
    links_.push_back({body.X_PJ.R, body.axis, joint.lower, joint.upper});
  }
}

Eigen::Matrix3d ChainSolver::rotation(const Angles& q) const noexcept {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  for (int i = 0; i < size(); ++i) {
    const auto& link = links_[static_cast<std::size_t>(i)];
    R = R * link.R_PJ * Eigen::AngleAxisd(q[i], link.axis).toRotationMatrix();
  }
  return R;
}

/// Rotation vector from R to the target, in the frame of the body before the chain.
Eigen::Vector3d ChainSolver::error(const Eigen::Matrix3d& target,
                                   const Eigen::Matrix3d& R) const noexcept {
  if (match_ == ChainMatch::kRotation) return rotation_log(target * R.transpose());
  const Eigen::Vector3d from = R * axis_;
  const Eigen::Vector3d to = target * axis_;
  const Eigen::Vector3d normal = from.cross(to);
  const double sine = normal.norm();
  if (sine < 1e-15) return Eigen::Vector3d::Zero();
  return normal * (std::atan2(sine, from.dot(to)) / sine);
}

ChainSolver::Angles ChainSolver::solve(const Eigen::Matrix3d& target, const Angles& start,
                                       double& residual) const noexcept {
  Angles q = start;
  Eigen::Vector3d remaining = error(target, rotation(q));
  double damping = 1e-6;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Columns J(3, size());
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    for (int i = 0; i < size(); ++i) {
      const auto& link = links_[static_cast<std::size_t>(i)];
      R = R * link.R_PJ;
      J.col(i) = R * link.axis;
      R = R * Eigen::AngleAxisd(q[i], link.axis).toRotationMatrix();
    }
    if (match_ == ChainMatch::kLongAxis) {
      const Eigen::Vector3d along = R * axis_;
      J -= (along * (along.transpose() * J)).eval();
    }
    Normal A = J.transpose() * J;
    A.diagonal().array() += damping;
    const Angles step = A.llt().solve(J.transpose() * remaining);
    const Angles trial = q + step;
    const Eigen::Vector3d trial_error = error(target, rotation(trial));
    if (trial_error.squaredNorm() <= remaining.squaredNorm()) {
      q = trial;
      remaining = trial_error;
      damping = std::max(damping * 0.1, kMinDamping);
      if (step.cwiseAbs().maxCoeff() < kConverged) break;
    } else {
      damping *= 10.0;
      if (damping > kMaxDamping) break;
    }
  }
  residual = remaining.norm();
  return q;
}

ChainSolver::Angles ChainSolver::solve_anywhere(const Eigen::Matrix3d& target,
                                                double& residual) const noexcept {
  const auto excess = [this](const Angles& q) {
    double sum = 0.0;
    for (int i = 0; i < size(); ++i) {
      const auto& link = links_[static_cast<std::size_t>(i)];
      sum += std::max({0.0, q[i] - link.upper, link.lower - q[i]});
    }
    return sum;
  };
  Angles best = Angles::Zero(size());
  residual = std::numeric_limits<double>::infinity();
  const int starts = size() == 1 ? 3 : 1 + (1 << size());
  for (int s = 0; s < starts; ++s) {
    Angles q = Angles::Zero(size());
    for (int i = 0; s > 0 && i < size(); ++i) {
      const auto& link = links_[static_cast<std::size_t>(i)];
      const double share = ((s - 1) >> i) % 2 == 0 ? 0.25 : 0.75;
      q[i] = link.lower + share * (link.upper - link.lower);
    }
    double r = 0.0;
    q = solve(target, q, r);
    const bool nearer = r < residual - kSameResidual;
    const bool equal = std::abs(r - residual) <= kSameResidual;
    const double gain = equal ? excess(best) - excess(q) : 0.0;
    if (nearer || (equal && (gain > kSameResidual ||
                             (std::abs(gain) <= kSameResidual && q.norm() < best.norm())))) {
      best = q;
      residual = r;
    }
  }
  return best;
}

}  // namespace clamber
