// Strict-hierarchy least squares under bounds and inequality rows.
// Any thread (one Hqp per thread); allocates: only for sizes larger than all before;
// blocks: never.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "planner_offline/ik/dual_active_set.hpp"
#include "planner_offline/ik/pivoted_qr.hpp"
#include "planner_offline/ik/strict_step.hpp"
#include "planner_offline/ik/workspace.hpp"

namespace clamber {

/// One priority: minimise |A x - b|. Row weights, if any, are already in A and b.
struct TaskLevel {
  Eigen::MatrixXd A;  ///< m x n
  Eigen::VectorXd b;  ///< m
};

/// Lexicographic least squares: levels[0] first, each later one without changing the residual of
/// those before; lower <= x <= upper and C x >= d hold at every level. What the levels leave free
/// goes towards zero. Bounds may hold infinities or be empty; C may be empty.
struct HqpProblem {
  int n = 0;
  std::vector<TaskLevel> levels;
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
  Eigen::MatrixXd C;
  Eigen::VectorXd d;
};

enum class HqpStatus {
  optimal,
  infeasible,       ///< bounds and inequality rows contradict each other
  iteration_limit,  ///< some level stopped early
  invalid_problem,  ///< sizes disagree, or a number is NaN
};
[[nodiscard]] const char* to_string(HqpStatus status) noexcept;

/// Solver and its memory. Each level is reduced to the null space of those before by a complete
/// orthogonal decomposition and solved there by the dual active-set method; the hierarchy of
/// A. Escande, N. Mansard, P.-B. Wieber, "Hierarchical quadratic programming", IJRR 2014.
class Hqp {
 public:
  /// @param x the solution, size n; on failure the last point reached (zero if invalid).
  [[nodiscard]] HqpStatus solve(const HqpProblem& problem, Eigen::VectorXd& x);

  /// |A_k x - b_k| at the point returned.
  [[nodiscard]] const Eigen::VectorXd& residual_norms() const { return residual_norms_; }
  /// Directions a level could use: its rank in the null space of those before.
  [[nodiscard]] const std::vector<int>& level_ranks() const { return level_ranks_; }
  /// Active-set steps over all levels.
  [[nodiscard]] int iterations() const { return iterations_; }

 private:
  void start(const HqpProblem& problem);
  [[nodiscard]] QpStatus solve_level(const TaskLevel& level);
  [[nodiscard]] QpStatus shrink_free_part();
  void split_free_space(const TaskLevel& level);
  [[nodiscard]] QpStatus move_along_split(Eigen::Index rank, const VectorMap& target);
  [[nodiscard]] bool sharpen(Eigen::Index rank, const VectorMap& target);
  void freeze_pushing_constraints();
  void finish(const HqpProblem& problem, Eigen::VectorXd& x);

  // The steps a level may take are the columns of `directions`: its first n rows act on x, the
  // others on the rows of C. Columns before `first_free_` belong to levels already solved.
  [[nodiscard]] MatrixMap directions() { return directions_.matrix(values_.size(), n_); }
  [[nodiscard]] auto free_directions() { return directions().rightCols(n_ - first_free_); }

  Eigen::Index n_ = 0;
  Eigen::Index first_free_ = 0;
  bool has_feasible_point_ = false;
  int iterations_ = 0;
  DualActiveSet core_;
  PivotedQr row_space_, column_space_;
  StrictStep strict_step_;
  bool pushing_known_ = false;
  Workspace directions_, reduced_, target_, sides_, sharp_, reached_, step_lower_, step_upper_;
  Eigen::VectorXd values_, lower_, upper_;  ///< of x and the unit-length rows of C, stacked
  Eigen::VectorXd residual_norms_;
  std::vector<int> level_ranks_;
};

}  // namespace clamber
