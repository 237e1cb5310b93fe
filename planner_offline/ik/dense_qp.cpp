#include "planner_offline/ik/dense_qp.hpp"

#include <algorithm>

namespace clamber {
namespace {

bool fits(const Eigen::MatrixXd& rows, const Eigen::VectorXd& sides, Eigen::Index n) {
  return rows.rows() == sides.size() && (rows.rows() == 0 || rows.cols() == n) && !rows.hasNaN() &&
         !sides.hasNaN();
}

bool bound_fits(const Eigen::VectorXd& bound, Eigen::Index n) {
  return (bound.size() == 0 || bound.size() == n) && !bound.hasNaN();
}

bool is_valid(const QpProblem& p) {
  const Eigen::Index n = p.g.size();
  return p.H.rows() == n && p.H.cols() == n && p.H.allFinite() && p.g.allFinite() &&
         fits(p.A_eq, p.b_eq, n) && fits(p.C, p.d, n) && bound_fits(p.lower, n) &&
         bound_fits(p.upper, n);
}

}  // namespace

void regularise(Eigen::MatrixXd& H, double relative) {
  if (H.rows() == 0) return;
  H.diagonal().array() += relative * std::max(1.0, H.diagonal().mean());
}

QpStatus DenseQp::solve(const QpProblem& problem) {
  x_.setZero(problem.g.size());
  if (!is_valid(problem)) return QpStatus::invalid_problem;
  core_.start(problem.g.size());
  factor_.compute(problem.H);
  if (factor_.info() != Eigen::Success) return QpStatus::not_convex;
  MatrixMap J = core_.J();
  J.setIdentity();
  factor_.matrixU().solveInPlace(J);
  core_.x() = -problem.g;
  factor_.solveInPlace(core_.x());
  static const Eigen::VectorXd no_upper_sides;
  const QpStatus status = core_.run({problem.A_eq, problem.b_eq, problem.C, problem.d,
                                     no_upper_sides, problem.lower, problem.upper});
  collect_solution(problem);
  return status;
}

void DenseQp::collect_solution(const QpProblem& problem) {
  using Kind = ActiveConstraint::Kind;
  x_ = core_.x();
  y_.setZero(problem.b_eq.size());
  u_.setZero(problem.d.size());
  v_.setZero(x_.size());
  for (const ActiveConstraint& active : core_.active()) {
    switch (active.kind) {
      case Kind::equality:
        y_[active.index] = active.multiplier;
        break;
      case Kind::row:
        u_[active.index] = active.multiplier;
        break;
      case Kind::bound:
        v_[active.index] = active.upper ? -active.multiplier : active.multiplier;
        // The iterate may miss the bound by rounding; the bound itself is exact.
        x_[active.index] = active.upper ? problem.upper[active.index] : problem.lower[active.index];
        break;
    }
  }
}

}  // namespace clamber
