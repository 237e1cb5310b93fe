// Rank-revealing Householder QR with column pivoting, M P = Q [R; 0].
// Any thread (not shared); allocates: only for sizes larger than all before; blocks: never.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "planner_offline/ik/workspace.hpp"

namespace clamber {

/// Eigen's own decomposition allocates whenever its size changes; the levels of a hierarchy all
/// have different sizes.
class PivotedQr {
 public:
  /// @param M r x c
  /// @param threshold absolute: columns with a smaller remainder count as dependent
  /// @param pivot false: keep the columns' order; for matrices known to have full column rank
  void compute(const Eigen::Ref<const Eigen::MatrixXd>& M, double threshold, bool pivot = true);

  [[nodiscard]] Eigen::Index rank() const { return rank_; }
  /// Column i of M P is column permutation()[i] of M.
  [[nodiscard]] const std::vector<Eigen::Index>& permutation() const { return permutation_; }
  /// rank x c, upper trapezoidal in its upper triangle; below it are reflector data.
  [[nodiscard]] auto R() { return factors_.matrix(rows_, cols_).topRows(rank_); }
  /// B := B Q, B with r columns.
  void apply_q_on_the_right(Eigen::Ref<Eigen::MatrixXd> B);
  /// v := Q v, v with r entries.
  void apply_q(Eigen::Ref<Eigen::VectorXd> v);
  /// v := Q' v, v with r entries.
  void apply_q_transpose(Eigen::Ref<Eigen::VectorXd> v);

 private:
  Eigen::Index rows_ = 0;
  Eigen::Index cols_ = 0;
  Eigen::Index rank_ = 0;
  Workspace factors_, taus_, norms_, scratch_;
  std::vector<Eigen::Index> permutation_;
};

}  // namespace clamber
