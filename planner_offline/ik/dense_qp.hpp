// Dense strictly convex quadratic programs, up to some hundred variables.
// Any thread (one DenseQp per thread); allocates: only for sizes larger than all before;
// blocks: never.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "planner_offline/ik/dual_active_set.hpp"

namespace clamber {

/// min 1/2 x'Hx + g'x  s.t.  A_eq x = b_eq,  C x >= d,  lower <= x <= upper.
/// Blocks that are not needed stay empty; bounds may hold infinities.
struct QpProblem {
  Eigen::MatrixXd H;  ///< n x n, symmetric positive definite (the lower triangle is read)
  Eigen::VectorXd g;  ///< n
  Eigen::MatrixXd A_eq;
  Eigen::VectorXd b_eq;
  Eigen::MatrixXd C;
  Eigen::VectorXd d;
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
};

/// Adds `relative` times the mean diagonal entry (at least `relative`) to the diagonal, so that a
/// positive semidefinite H becomes definite whatever its unit.
void regularise(Eigen::MatrixXd& H, double relative = 1e-9);

/// Solver and its memory. Dependent equality rows that are consistent and duplicate inequality
/// rows are tolerated.
class DenseQp {
 public:
  /// On `optimal` all accessors are valid; otherwise x() is the last, infeasible iterate.
  [[nodiscard]] QpStatus solve(const QpProblem& problem);

  [[nodiscard]] const Eigen::VectorXd& x() const { return x_; }
  /// Multipliers such that H x + g = A_eq' y + C' u + v, u >= 0;
  /// v_i >= 0 at a lower and <= 0 at an upper bound.
  [[nodiscard]] const Eigen::VectorXd& equality_multipliers() const { return y_; }
  [[nodiscard]] const Eigen::VectorXd& inequality_multipliers() const { return u_; }
  [[nodiscard]] const Eigen::VectorXd& bound_multipliers() const { return v_; }
  [[nodiscard]] const std::vector<ActiveConstraint>& active_set() const { return core_.active(); }
  [[nodiscard]] int iterations() const { return core_.iterations(); }

 private:
  void collect_solution(const QpProblem& problem);

  DualActiveSet core_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::VectorXd x_, y_, u_, v_;
};

}  // namespace clamber
