// The dual active-set iteration that dense_qp.hpp and hqp.hpp share.
// Any thread (not shared); allocates: only for sizes larger than all before; blocks: never.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "planner_offline/ik/workspace.hpp"

namespace clamber {

enum class QpStatus {
  optimal,
  infeasible,       ///< no point satisfies all constraints
  iteration_limit,  ///< stopped early; the point violates a constraint
  not_convex,       ///< the Hessian is not positive definite
  invalid_problem,  ///< sizes disagree, or a number is NaN
};
[[nodiscard]] const char* to_string(QpStatus status) noexcept;

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Constraints over n variables. Infinite sides are absent; any block may be empty (size 0).
struct LinearConstraints {
  Eigen::Ref<const Eigen::MatrixXd> A_eq;       ///< m_eq x n: A_eq x = b_eq
  Eigen::Ref<const Eigen::VectorXd> b_eq;       ///< m_eq
  Eigen::Ref<const Eigen::MatrixXd> C;          ///< m x n: row_lower <= C x <= row_upper
  Eigen::Ref<const Eigen::VectorXd> row_lower;  ///< m
  Eigen::Ref<const Eigen::VectorXd> row_upper;  ///< m, or empty: no upper sides
  Eigen::Ref<const Eigen::VectorXd> lower;      ///< n, or empty: unbounded below
  Eigen::Ref<const Eigen::VectorXd> upper;      ///< n, or empty: unbounded above
};

/// A constraint that holds with equality at the solution, and its multiplier.
struct ActiveConstraint {
  enum class Kind { equality, row, bound };
  Kind kind = Kind::row;
  int index = 0;            ///< row of its block, or variable
  bool upper = false;       ///< active at its upper side
  double multiplier = 0.0;  ///< >= 0 for inequalities, any sign for equalities
};

/// Minimises 1/2 x'Hx + g'x under constraints added one at a time while the dual stays feasible.
/// Source: D. Goldfarb, A. Idnani, "A numerically stable dual method for solving strictly convex
/// quadratic programs", Mathematical Programming 27, 1983. Kept in their notation: H^-1 = J J',
/// the active normals N satisfy J'N = [R; 0].
class DualActiveSet {
 public:
  /// Starts without constraints. The caller then fills J() with any J such that J J' = H^-1 and
  /// x() with the unconstrained minimum -H^-1 g.
  void start(Eigen::Index n);
  [[nodiscard]] MatrixMap J() { return J_.matrix(n_, n_); }
  [[nodiscard]] VectorMap x() { return x_.vector(n_); }

  /// Equality rows that depend on earlier ones are dropped when consistent with them.
  [[nodiscard]] QpStatus run(const LinearConstraints& constraints);

  [[nodiscard]] const std::vector<ActiveConstraint>& active() const { return active_; }
  [[nodiscard]] int iterations() const { return iterations_; }

 private:
  enum class State : unsigned char { inactive, active, ignored };
  enum class Step { full, dual_only, impossible };

  void prepare(const LinearConstraints& constraints);
  [[nodiscard]] QpStatus add_equalities(const LinearConstraints& constraints);
  [[nodiscard]] bool find_most_violated(const LinearConstraints& constraints,
                                        ActiveConstraint& worst);
  [[nodiscard]] QpStatus satisfy(ActiveConstraint constraint, const LinearConstraints& constraints);
  /// Fills the normal, d = J'n, z = J2 d2 and r = R^-1 d1; returns z'n, 0 when n depends on the
  /// active normals.
  [[nodiscard]] double compute_directions(const ActiveConstraint& constraint,
                                          const LinearConstraints& constraints);
  void set_normal(const ActiveConstraint& constraint, const LinearConstraints& constraints);
  /// The constraint reads normal'x >= signed_side, with = for equalities.
  [[nodiscard]] static double signed_side(const ActiveConstraint& constraint,
                                          const LinearConstraints& constraints);
  void dual_step(double t);
  void activate(const ActiveConstraint& constraint);
  void deactivate(Eigen::Index position);
  void return_to_active_sides(const LinearConstraints& constraints);
  [[nodiscard]] State& state(const ActiveConstraint& constraint);

  Eigen::Index n_ = 0;
  Eigen::Index q_ = 0;           ///< number of active constraints
  Eigen::Index equalities_ = 0;  ///< the first of them, never dropped
  int iterations_ = 0;
  int iteration_limit_ = 0;
  Workspace J_, R_, x_;
  Workspace normal_, d_, z_, r_, row_values_, row_scales_, scratch_;
  std::vector<ActiveConstraint> active_;
  std::vector<State> row_states_, bound_states_;
};

}  // namespace clamber
