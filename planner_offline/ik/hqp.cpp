#include "planner_offline/ik/hqp.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

// Directions a level does not need are held by this weight (squared in the cost): the level's
// residual stays exact to the square of it while the Hessian stays definite.
constexpr double kFreeWeight = 1e-5;
// Share of a task row's length below which its remainder counts as decided by earlier levels.
constexpr double kRankTolerance = 1e-9;
// Rows of unit length act on the free space by rounding only below this.
constexpr double kNoEffect = 1e-12;
// Feasibility asked of a sharpened step, along rows of unit length.
constexpr double kFeasibility = 1e-9;

bool bound_fits(const Eigen::VectorXd& bound, Eigen::Index n) {
  return (bound.size() == 0 || bound.size() == n) && !bound.hasNaN();
}

bool is_valid(const HqpProblem& p) {
  const auto level_fits = [&](const TaskLevel& level) {
    return level.A.rows() == level.b.size() && (level.b.size() == 0 || level.A.cols() == p.n) &&
           level.A.allFinite() && level.b.allFinite();
  };
  return p.n >= 0 && std::all_of(p.levels.begin(), p.levels.end(), level_fits) &&
         bound_fits(p.lower, p.n) && bound_fits(p.upper, p.n) && p.C.rows() == p.d.size() &&
         (p.d.size() == 0 || p.C.cols() == p.n) && p.C.allFinite() && !p.d.hasNaN();
}

HqpStatus to_hqp_status(QpStatus status) {
  switch (status) {
    case QpStatus::optimal:
      return HqpStatus::optimal;
    case QpStatus::infeasible:
      return HqpStatus::infeasible;
    default:
      return HqpStatus::iteration_limit;
  }
}

}  // namespace

const char* to_string(HqpStatus status) noexcept {
  switch (status) {
    case HqpStatus::optimal:
      return "optimal";
    case HqpStatus::infeasible:
      return "infeasible";
    case HqpStatus::iteration_limit:
      return "iteration limit";
    case HqpStatus::invalid_problem:
      return "invalid problem";
  }
  return "unknown";
}

HqpStatus Hqp::solve(const HqpProblem& problem, Eigen::VectorXd& x) {
  x.setZero(std::max(problem.n, 0));
  if (!is_valid(problem)) return HqpStatus::invalid_problem;
  start(problem);
  QpStatus status = QpStatus::optimal;
  for (const TaskLevel& level : problem.levels) {
    status = solve_level(level);
    if (status != QpStatus::optimal) break;
  }
  if (status == QpStatus::optimal) status = shrink_free_part();
  finish(problem, x);
  return to_hqp_status(status);
}

void Hqp::start(const HqpProblem& problem) {
  n_ = problem.n;
  first_free_ = 0;
  has_feasible_point_ = false;
  iterations_ = 0;
  level_ranks_.clear();
  const Eigen::Index rows = problem.C.rows();
  values_.setZero(n_ + rows);
  lower_.setConstant(n_ + rows, -kInfinity);
  upper_.setConstant(n_ + rows, kInfinity);
  if (problem.lower.size() > 0) lower_.head(n_) = problem.lower;
  if (problem.upper.size() > 0) upper_.head(n_) = problem.upper;
  MatrixMap D = directions();
  D.topRows(n_).setIdentity();
  D.bottomRows(rows) = problem.C;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double length = D.row(n_ + i).norm();
    const double scale = length > 0.0 ? 1.0 / length : 1.0;
    D.row(n_ + i) *= scale;
    lower_[n_ + i] = problem.d[i] * scale;
  }
}

QpStatus Hqp::solve_level(const TaskLevel& level) {
  level_ranks_.push_back(0);
  if (first_free_ == n_) return QpStatus::optimal;
  split_free_space(level);
  const Eigen::Index rank = row_space_.rank();
  level_ranks_.back() = static_cast<int>(rank);
  if (rank == 0 && has_feasible_point_) return QpStatus::optimal;
  const QpStatus status = move_along_split(rank, target_.vector(level.b.size()));
  if (status != QpStatus::optimal) return status;
  first_free_ += rank;
  freeze_pushing_constraints();
  return QpStatus::optimal;
}

/// Turns the free directions so that the first `rank` of them change the level's residual, each by
/// one unit along its own axis, and the others do not change it. `target` becomes the steps along
/// the first that the level asks for.
void Hqp::split_free_space(const TaskLevel& level) {
  const Eigen::Index m = level.b.size();
  const Eigen::Index free = n_ - first_free_;
  auto S = free_directions();
  MatrixMap M_transposed = reduced_.matrix(free, m);
  if (first_free_ == 0) {
    M_transposed = level.A.transpose();  // nothing is decided yet: S is the identity
  } else {
    M_transposed.noalias() = S.topRows(n_).transpose() * level.A.transpose();
  }
  const double longest_row = m > 0 ? std::sqrt(level.A.rowwise().squaredNorm().maxCoeff()) : 0.0;
  row_space_.compute(M_transposed, kRankTolerance * longest_row);
  const Eigen::Index rank = row_space_.rank();
  row_space_.apply_q_on_the_right(S);
  VectorMap target = target_.vector(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const Eigen::Index row = row_space_.permutation()[static_cast<std::size_t>(i)];
    target[i] = level.b[row] - level.A.row(row).dot(values_.head(n_));
  }
  auto range = S.leftCols(rank);
  const auto R = row_space_.R();
  if (rank == m) {
    R.leftCols(rank).triangularView<Eigen::Upper>().transpose().solveInPlace<Eigen::OnTheRight>(
        range);
    return;
  }
  MatrixMap L = reduced_.matrix(m, rank);
  L = R.transpose();
  L.triangularView<Eigen::StrictlyUpper>().setZero();
  column_space_.compute(L, 0.0, false);
  column_space_.R().triangularView<Eigen::Upper>().solveInPlace<Eigen::OnTheRight>(range);
  column_space_.apply_q_transpose(target);
}

/// Solves min |y - target|^2 + kFreeWeight^2 |w|^2 over steps (y, w) along the free directions,
/// then removes the effect of the weight.
QpStatus Hqp::move_along_split(Eigen::Index rank, const VectorMap& target) {
  const Eigen::Index free = n_ - first_free_;
  auto S = free_directions();
  core_.start(free);
  MatrixMap J = core_.J();
  J.setIdentity();
  J.diagonal().tail(free - rank).setConstant(1.0 / kFreeWeight);
  VectorMap step = core_.x();
  step.head(rank) = target.head(rank);
  step.tail(free - rank).setZero();
  VectorMap lower = step_lower_.vector(values_.size());
  VectorMap upper = step_upper_.vector(values_.size());
  lower = lower_ - values_;
  upper = upper_ - values_;
  if (has_feasible_point_) {
    // The step zero is feasible but for the rounding of the levels before.
    lower = lower.cwiseMin(0.0);
    upper = upper.cwiseMax(0.0);
  }
  static const Eigen::MatrixXd no_rows;
  static const Eigen::VectorXd none;
  const QpStatus status = core_.run({no_rows, none, S, lower, upper, none, none});
  iterations_ += core_.iterations();
  has_feasible_point_ = status == QpStatus::optimal;
  pushing_known_ =
      has_feasible_point_ && rank < free && !core_.active().empty() && sharpen(rank, target);
  values_.noalias() += S * core_.x();
  return status;
}

bool Hqp::sharpen(Eigen::Index rank, const VectorMap& target) {
  const auto& active = core_.active();
  const VectorMap lower = step_lower_.vector(values_.size());
  const VectorMap upper = step_upper_.vector(values_.size());
  VectorMap sides = sides_.vector(static_cast<Eigen::Index>(active.size()));
  for (Eigen::Index j = 0; j < sides.size(); ++j) {
    const ActiveConstraint& a = active[static_cast<std::size_t>(j)];
    sides[j] = a.upper ? upper[a.index] : lower[a.index];
  }
  const auto S = free_directions();
  VectorMap step = core_.x();
  VectorMap sharp = sharp_.vector(step.size());
  sharp.head(rank) = target.head(rank);
  sharp.tail(step.size() - rank) = step.tail(step.size() - rank);
  if (!strict_step_.compute(S, active, sides, rank, sharp)) return false;
  VectorMap reached = reached_.vector(values_.size());
  reached.noalias() = S * sharp;
  if (((reached - lower).array() >= -kFeasibility).all() &&
      ((upper - reached).array() >= -kFeasibility).all()) {
    step = sharp;
  }
  return true;
}

/// A constraint that pushes on a level's residual stays active in every optimum of that level: the
/// levels below may not move along it.
void Hqp::freeze_pushing_constraints() {
  auto S = free_directions();
  for (Eigen::Index i = 0; i < S.rows(); ++i) {
    if (S.row(i).squaredNorm() < kNoEffect * kNoEffect) S.row(i).setZero();
  }
  if (!pushing_known_ || strict_step_.pushing_rows().cols() == 0) return;
  row_space_.compute(strict_step_.pushing_rows(), kRankTolerance);
  row_space_.apply_q_on_the_right(S);
  first_free_ += row_space_.rank();
}

/// The last level: x itself towards zero. The free directions are orthonormal in x.
QpStatus Hqp::shrink_free_part() {
  const Eigen::Index free = n_ - first_free_;
  if (free == 0) return QpStatus::optimal;
  VectorMap target = target_.vector(free);
  target.noalias() = -free_directions().topRows(n_).transpose() * values_.head(n_);
  return move_along_split(free, target);
}

void Hqp::finish(const HqpProblem& problem, Eigen::VectorXd& x) {
  // Last roundings: bounds hold exactly.
  x = values_.head(n_).cwiseMax(lower_.head(n_)).cwiseMin(upper_.head(n_));
  residual_norms_.resize(static_cast<Eigen::Index>(problem.levels.size()));
  for (std::size_t k = 0; k < problem.levels.size(); ++k) {
    const TaskLevel& level = problem.levels[k];
    double squared = 0.0;
    for (Eigen::Index i = 0; i < level.b.size(); ++i) {
      const double error = level.A.row(i).dot(x) - level.b[i];
      squared += error * error;
    }
    residual_norms_[static_cast<Eigen::Index>(k)] = std::sqrt(squared);
  }
}

}  // namespace clamber
