#include "planner_offline/ik/dual_active_set.hpp"

#include <Eigen/Householder>
#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

// A side counts as violated beyond this, in units of its row's norm and relative to its value.
constexpr double kFeasibility = 1e-10;
// A violation below this that nothing can reduce is rounding, not infeasibility.
constexpr double kConsistency = 1e-8;
// Share of a normal outside the span of the active ones below which it counts as inside.
constexpr double kDependence = 1e-11;

bool cross(const Eigen::Ref<const Eigen::VectorXd>& lower,
           const Eigen::Ref<const Eigen::VectorXd>& upper) {
  return lower.size() > 0 && upper.size() > 0 &&
         ((lower - upper).array() > kConsistency * (1.0 + upper.array().abs())).any();
}

bool is_violated(double amount, double side) {
  return amount > kFeasibility * (1.0 + std::abs(side));
}

}  // namespace

const char* to_string(QpStatus status) noexcept {
  switch (status) {
    case QpStatus::optimal:
      return "optimal";
    case QpStatus::infeasible:
      return "infeasible";
    case QpStatus::iteration_limit:
      return "iteration limit";
    case QpStatus::not_convex:
      return "not convex";
    case QpStatus::invalid_problem:
      return "invalid problem";
  }
  return "unknown";
}

void DualActiveSet::start(Eigen::Index n) {
  n_ = n;
  q_ = 0;
  equalities_ = 0;
  iterations_ = 0;
  active_.clear();
}

QpStatus DualActiveSet::run(const LinearConstraints& constraints) {
  prepare(constraints);
  if (cross(constraints.lower, constraints.upper) ||
      cross(constraints.row_lower, constraints.row_upper)) {
    return QpStatus::infeasible;
  }
  if (const QpStatus status = add_equalities(constraints); status != QpStatus::optimal) {
    return status;
  }
  bool refined = false;
  for (;;) {
    ActiveConstraint worst;
    if (find_most_violated(constraints, worst)) {
      const QpStatus status = satisfy(worst, constraints);
      if (status != QpStatus::optimal) return status;
      refined = false;
    } else if (!refined) {
      // Many small steps leave the active sides by some rounding; a caller sees exact sides.
      return_to_active_sides(constraints);
      refined = true;
    } else {
      return QpStatus::optimal;
    }
  }
}

void DualActiveSet::prepare(const LinearConstraints& constraints) {
  const Eigen::Index rows = constraints.C.rows();
  iteration_limit_ = 100 + 10 * static_cast<int>(n_ + rows);
  row_states_.assign(static_cast<std::size_t>(rows), State::inactive);
  bound_states_.assign(static_cast<std::size_t>(n_), State::inactive);
  active_.reserve(static_cast<std::size_t>(n_));
  VectorMap scales = row_scales_.vector(rows);
  scales.setZero();
  for (Eigen::Index j = 0; rows > 0 && j < n_; ++j) {
    scales.array() += constraints.C.col(j).array().square();
  }
  for (Eigen::Index i = 0; i < rows; ++i) {
    scales[i] = scales[i] > 0.0 ? 1.0 / std::sqrt(scales[i]) : 1.0;
  }
}

QpStatus DualActiveSet::add_equalities(const LinearConstraints& constraints) {
  for (Eigen::Index i = 0; i < constraints.A_eq.rows(); ++i) {
    ActiveConstraint row{ActiveConstraint::Kind::equality, static_cast<int>(i), false, 0.0};
    const double zn = compute_directions(row, constraints);
    const double error = normal_.vector(n_).dot(x_.vector(n_)) - constraints.b_eq[i];
    if (zn == 0.0) {
      const double scale = 1.0 + std::abs(constraints.b_eq[i]) + normal_.vector(n_).norm();
      if (std::abs(error) > kConsistency * scale) return QpStatus::infeasible;
      continue;
    }
    const double t = -error / zn;
    x_.vector(n_) += t * z_.vector(n_);
    dual_step(t);
    row.multiplier = t;
    activate(row);
    ++equalities_;
  }
  return QpStatus::optimal;
}

bool DualActiveSet::find_most_violated(const LinearConstraints& constraints,
                                       ActiveConstraint& worst) {
  using Kind = ActiveConstraint::Kind;
  const VectorMap x = x_.vector(n_);
  double worst_amount = 0.0;
  const auto consider = [&](Kind kind, Eigen::Index index, bool upper, double amount, double side) {
    if (amount > worst_amount && is_violated(amount, side)) {
      worst_amount = amount;
      worst = {kind, static_cast<int>(index), upper, 0.0};
    }
  };
  for (Eigen::Index i = 0; i < n_; ++i) {
    if (bound_states_[static_cast<std::size_t>(i)] != State::inactive) continue;
    if (constraints.lower.size() > 0) {
      consider(Kind::bound, i, false, constraints.lower[i] - x[i], constraints.lower[i]);
    }
    if (constraints.upper.size() > 0) {
      consider(Kind::bound, i, true, x[i] - constraints.upper[i], constraints.upper[i]);
    }
  }
  const Eigen::Index rows = constraints.C.rows();
  if (rows == 0) return worst_amount > 0.0;
  VectorMap values = row_values_.vector(rows);
  values.noalias() = constraints.C * x;
  const VectorMap scales = row_scales_.vector(rows);
  const bool has_upper = constraints.row_upper.size() > 0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    if (row_states_[static_cast<std::size_t>(i)] != State::inactive) continue;
    const double low = constraints.row_lower[i];
    consider(Kind::row, i, false, (low - values[i]) * scales[i], low * scales[i]);
    if (!has_upper) continue;
    const double up = constraints.row_upper[i];
    consider(Kind::row, i, true, (values[i] - up) * scales[i], up * scales[i]);
  }
  return worst_amount > 0.0;
}

QpStatus DualActiveSet::satisfy(ActiveConstraint constraint, const LinearConstraints& constraints) {
  for (;;) {
    if (++iterations_ > iteration_limit_) return QpStatus::iteration_limit;
    const double zn = compute_directions(constraint, constraints);
    const double violation =
        signed_side(constraint, constraints) - normal_.vector(n_).dot(x_.vector(n_));
    const VectorMap r = r_.vector(q_);
    double t_dual = kInfinity;
    Eigen::Index blocking = -1;
    for (Eigen::Index j = equalities_; j < q_; ++j) {
      const double u = active_[static_cast<std::size_t>(j)].multiplier;
      if (r[j] > 0.0 && u < t_dual * r[j]) {
        t_dual = u / r[j];
        blocking = j;
      }
    }
    const double t_primal = zn > 0.0 ? violation / zn : kInfinity;
    if (t_primal == kInfinity && blocking < 0) {
      const double scale = normal_.vector(n_).norm() + std::abs(violation);
      if (violation > kConsistency * scale) return QpStatus::infeasible;
      state(constraint) = State::ignored;
      return QpStatus::optimal;
    }
    const double t = std::min(t_primal, t_dual);
    if (zn > 0.0) x_.vector(n_) += t * z_.vector(n_);
    dual_step(t);
    constraint.multiplier += t;
    if (t_primal <= t_dual) {
      activate(constraint);
      return QpStatus::optimal;
    }
    deactivate(blocking);
  }
}

double DualActiveSet::compute_directions(const ActiveConstraint& constraint,
                                         const LinearConstraints& constraints) {
  const MatrixMap J = J_.matrix(n_, n_);
  set_normal(constraint, constraints);
  const VectorMap normal = normal_.vector(n_);
  VectorMap d = d_.vector(n_);
  if (constraint.kind == ActiveConstraint::Kind::bound) {
    d = J.row(constraint.index).transpose() * normal[constraint.index];
  } else {
    d.noalias() = J.transpose() * normal;
  }
  VectorMap r = r_.vector(q_);
  r = d.head(q_);
  const MatrixMap R = R_.matrix(n_, n_);
  R.topLeftCorner(q_, q_).triangularView<Eigen::Upper>().solveInPlace(r);
  const double zn = d.tail(n_ - q_).squaredNorm();
  if (zn <= kDependence * kDependence * d.squaredNorm()) return 0.0;
  z_.vector(n_).noalias() = J.rightCols(n_ - q_) * d.tail(n_ - q_);
  return zn;
}

double DualActiveSet::signed_side(const ActiveConstraint& constraint,
                                  const LinearConstraints& constraints) {
  using Kind = ActiveConstraint::Kind;
  const int i = constraint.index;
  switch (constraint.kind) {
    case Kind::equality:
      return constraints.b_eq[i];
    case Kind::row:
      return constraint.upper ? -constraints.row_upper[i] : constraints.row_lower[i];
    case Kind::bound:
      break;
  }
  return constraint.upper ? -constraints.upper[i] : constraints.lower[i];
}

void DualActiveSet::set_normal(const ActiveConstraint& constraint,
                               const LinearConstraints& constraints) {
  using Kind = ActiveConstraint::Kind;
  VectorMap normal = normal_.vector(n_);
  if (constraint.kind == Kind::bound) {
    normal.setZero();
    normal[constraint.index] = constraint.upper ? -1.0 : 1.0;
    return;
  }
  const auto& block = constraint.kind == Kind::equality ? constraints.A_eq : constraints.C;
  normal = block.row(constraint.index).transpose();
  if (constraint.upper) normal = -normal;
}

void DualActiveSet::dual_step(double t) {
  const VectorMap r = r_.vector(q_);
  for (Eigen::Index j = 0; j < q_; ++j) {
    double& u = active_[static_cast<std::size_t>(j)].multiplier;
    u -= t * r[j];
    if (j >= equalities_) u = std::max(u, 0.0);
  }
}

void DualActiveSet::activate(const ActiveConstraint& constraint) {
  // One reflection of the free columns of J turns d2 = J2'n into a multiple of the first axis.
  VectorMap d = d_.vector(n_);
  MatrixMap J = J_.matrix(n_, n_);
  MatrixMap R = R_.matrix(n_, n_);
  double tau = 0.0;
  double beta = 0.0;
  auto d2 = d.tail(n_ - q_);
  d2.makeHouseholderInPlace(tau, beta);
  J.rightCols(n_ - q_).applyHouseholderOnTheRight(d2.tail(n_ - q_ - 1), tau,
                                                  scratch_.vector(n_).data());
  R.col(q_).head(q_) = d.head(q_);
  R(q_, q_) = beta;
  active_.push_back(constraint);
  if (constraint.kind != ActiveConstraint::Kind::equality) state(constraint) = State::active;
  ++q_;
}

void DualActiveSet::deactivate(Eigen::Index position) {
  MatrixMap J = J_.matrix(n_, n_);
  MatrixMap R = R_.matrix(n_, n_);
  state(active_[static_cast<std::size_t>(position)]) = State::inactive;
  active_.erase(active_.begin() + position);
  --q_;
  for (Eigen::Index j = position; j < q_; ++j) R.col(j).head(j + 2) = R.col(j + 1).head(j + 2);
  for (Eigen::Index j = position; j < q_; ++j) {
    const double a = R(j, j);
    const double b = R(j + 1, j);
    const double length = std::hypot(a, b);
    if (length == 0.0) continue;
    const double c = a / length;
    const double s = b / length;
    R(j, j) = length;
    for (Eigen::Index k = j + 1; k < q_; ++k) {
      const double upper = R(j, k);
      const double lower = R(j + 1, k);
      R(j, k) = c * upper + s * lower;
      R(j + 1, k) = c * lower - s * upper;
    }
    for (Eigen::Index k = 0; k < n_; ++k) {
      const double left = J(k, j);
      const double right = J(k, j + 1);
      J(k, j) = c * left + s * right;
      J(k, j + 1) = c * right - s * left;
    }
  }
}

void DualActiveSet::return_to_active_sides(const LinearConstraints& constraints) {
  // Smallest correction in the metric of H: J1 R^-T (sides - N'x).
  VectorMap error = d_.vector(n_);
  for (Eigen::Index j = 0; j < q_; ++j) {
    const ActiveConstraint& active = active_[static_cast<std::size_t>(j)];
    set_normal(active, constraints);
    error[j] = signed_side(active, constraints) - normal_.vector(n_).dot(x_.vector(n_));
  }
  auto active_error = error.head(q_);
  R_.matrix(n_, n_).topLeftCorner(q_, q_).triangularView<Eigen::Upper>().transpose().solveInPlace(
      active_error);
  x_.vector(n_).noalias() += J_.matrix(n_, n_).leftCols(q_) * active_error;
}

DualActiveSet::State& DualActiveSet::state(const ActiveConstraint& constraint) {
  const auto i = static_cast<std::size_t>(constraint.index);
  return constraint.kind == ActiveConstraint::Kind::bound ? bound_states_[i] : row_states_[i];
}

}  // namespace clamber
