#include "planner_offline/ik/strict_step.hpp"

#include <algorithm>

namespace clamber {
namespace {

// Rows have unit length: a remainder below this is dependence.
constexpr double kDependence = 1e-9;
// Multipliers below this share of the largest one, or of the step, are rounding.
constexpr double kNoForce = 1e-9;

}  // namespace

bool StrictStep::compute(const Eigen::Ref<const Eigen::MatrixXd>& directions,
                         const std::vector<ActiveConstraint>& active,
                         const Eigen::Ref<const Eigen::VectorXd>& sides, Eigen::Index y_size,
                         Eigen::Ref<Eigen::VectorXd> step) {
  y_size_ = y_size;
  w_size_ = directions.cols() - y_size;
  count_ = static_cast<Eigen::Index>(active.size());
  pushing_count_ = 0;
  gather(directions, active, sides, step);
  if (!push_y(step.head(y_size_))) return false;
  collect_pushing_rows(directions, active);
  follow_with_w(step);
  return true;
}

void StrictStep::gather(const Eigen::Ref<const Eigen::MatrixXd>& directions,
                        const std::vector<ActiveConstraint>& active,
                        const Eigen::Ref<const Eigen::VectorXd>& sides,
                        const Eigen::Ref<const Eigen::VectorXd>& step) {
  MatrixMap N_transposed = N_transposed_.matrix(w_size_, count_);
  for (Eigen::Index j = 0; j < count_; ++j) {
    N_transposed.col(j) =
        directions.row(active[static_cast<std::size_t>(j)].index).tail(w_size_).transpose();
  }
  w_space_.compute(N_transposed, kDependence);
  yielding_ = w_space_.rank();
  MatrixMap B_transposed = B_transposed_.matrix(y_size_, count_);
  VectorMap errors = errors_.vector(count_);
  for (Eigen::Index j = 0; j < count_; ++j) {
    const int row = active[static_cast<std::size_t>(original(j))].index;
    B_transposed.col(j) = directions.row(row).head(y_size_).transpose();
    errors[j] = sides[original(j)] - directions.row(row).dot(step);
  }
}

bool StrictStep::push_y(Eigen::Ref<Eigen::VectorXd> y) {
  const Eigen::Index rigid = count_ - yielding_;
  VectorMap forces = forces_.vector(count_);
  forces.setZero();
  if (rigid == 0) return true;
  // Z = P [-K; I], K = R11^-1 R12 of the pivoted N' = Q R P'.
  const auto R = w_space_.R();
  MatrixMap K = combination_.matrix(yielding_, rigid);
  K = R.rightCols(rigid);
  R.leftCols(yielding_).triangularView<Eigen::Upper>().solveInPlace(K);
  const MatrixMap B_transposed = B_transposed_.matrix(y_size_, count_);
  MatrixMap Z_B_transposed = rigid_.matrix(y_size_, rigid);
  Z_B_transposed = B_transposed.rightCols(rigid);
  Z_B_transposed.noalias() -= B_transposed.leftCols(yielding_) * K;
  y_space_.compute(Z_B_transposed, kDependence);
  if (y_space_.rank() < rigid) return false;

  VectorMap errors = errors_.vector(count_);
  VectorMap push = push_.vector(std::max(y_size_, rigid));
  push.setZero();
  for (Eigen::Index j = 0; j < rigid; ++j) {
    const Eigen::Index column = y_space_.permutation()[static_cast<std::size_t>(j)];
    push[j] = errors[yielding_ + column] - K.col(column).dot(errors.head(yielding_));
  }
  const auto triangle = y_space_.R().leftCols(rigid).triangularView<Eigen::Upper>();
  auto multipliers = push.head(rigid);
  triangle.transpose().solveInPlace(multipliers);
  VectorMap y_step = move_.vector(y_size_);
  y_step.setZero();
  y_step.head(rigid) = multipliers;
  y_space_.apply_q(y_step);
  y += y_step;
  errors.noalias() -= B_transposed.transpose() * y_step;
  triangle.solveInPlace(multipliers);
  for (Eigen::Index j = 0; j < rigid; ++j) {
    forces[yielding_ + y_space_.permutation()[static_cast<std::size_t>(j)]] = multipliers[j];
  }
  forces.head(yielding_).noalias() = -K * forces.tail(rigid);
  return true;
}

void StrictStep::collect_pushing_rows(const Eigen::Ref<const Eigen::MatrixXd>& directions,
                                      const std::vector<ActiveConstraint>& active) {
  const VectorMap forces = forces_.vector(count_);
  const double largest = forces.cwiseAbs().maxCoeff();
  for (Eigen::Index j = 0; j < count_; ++j) {
    const ActiveConstraint& constraint = active[static_cast<std::size_t>(original(j))];
    const double push = constraint.upper ? -forces[j] : forces[j];
    if (push > kNoForce * (1.0 + largest)) ++pushing_count_;
  }
  MatrixMap rows = pushing_.matrix(w_size_, pushing_count_);
  Eigen::Index next = 0;
  for (Eigen::Index j = 0; j < count_; ++j) {
    const ActiveConstraint& constraint = active[static_cast<std::size_t>(original(j))];
    const double push = constraint.upper ? -forces[j] : forces[j];
    if (push > kNoForce * (1.0 + largest)) {
      rows.col(next++) = directions.row(constraint.index).tail(w_size_).transpose();
    }
  }
}

void StrictStep::follow_with_w(Eigen::Ref<Eigen::VectorXd> step) {
  if (yielding_ == 0) return;
  VectorMap move = move_.vector(w_size_);
  move.setZero();
  auto along_rows = move.head(yielding_);
  along_rows = errors_.vector(count_).head(yielding_);
  w_space_.R().leftCols(yielding_).triangularView<Eigen::Upper>().transpose().solveInPlace(
      along_rows);
  w_space_.apply_q(move);
  step.tail(w_size_) += move;
}

}  // namespace clamber
