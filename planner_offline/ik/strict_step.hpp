// The exact step of one level of a hierarchy once its active constraints are known.
// Any thread (not shared); allocates: only for sizes larger than all before; blocks: never.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "planner_offline/ik/dual_active_set.hpp"
#include "planner_offline/ik/pivoted_qr.hpp"
#include "planner_offline/ik/workspace.hpp"

namespace clamber {

/// Solves, for active rows [B N] with sides h,
///   min |y - target|  s.t.  some w has  B y + N w = h,
/// then moves w by the least amount that satisfies the rows. The directions w give way wherever
/// they can; only combinations Z of rows with Z'N = 0 act on y.
class StrictStep {
 public:
  /// @param directions columns [y directions, w directions] of all constraint rows
  /// @param sides for each active constraint the value its row has to take
  /// @param step in: [target; w], out: [y; w]
  /// @returns false when the rows are too close to dependence to decide; step is then unchanged
  [[nodiscard]] bool compute(const Eigen::Ref<const Eigen::MatrixXd>& directions,
                             const std::vector<ActiveConstraint>& active,
                             const Eigen::Ref<const Eigen::VectorXd>& sides, Eigen::Index y_size,
                             Eigen::Ref<Eigen::VectorXd> step);

  /// Columns w-part of the rows that push on y: no later level may move along them.
  [[nodiscard]] MatrixMap pushing_rows() { return pushing_.matrix(w_size_, pushing_count_); }

 private:
  void gather(const Eigen::Ref<const Eigen::MatrixXd>& directions,
              const std::vector<ActiveConstraint>& active,
              const Eigen::Ref<const Eigen::VectorXd>& sides,
              const Eigen::Ref<const Eigen::VectorXd>& step);
  [[nodiscard]] bool push_y(Eigen::Ref<Eigen::VectorXd> y);
  void collect_pushing_rows(const Eigen::Ref<const Eigen::MatrixXd>& directions,
                            const std::vector<ActiveConstraint>& active);
  void follow_with_w(Eigen::Ref<Eigen::VectorXd> step);
  [[nodiscard]] Eigen::Index original(Eigen::Index j) const {
    return w_space_.permutation()[static_cast<std::size_t>(j)];
  }

  Eigen::Index y_size_ = 0;
  Eigen::Index w_size_ = 0;
  Eigen::Index count_ = 0;
  Eigen::Index yielding_ = 0;  ///< independent rows of N; the first ones after pivoting
  Eigen::Index pushing_count_ = 0;
  PivotedQr w_space_, y_space_;
  Workspace N_transposed_, B_transposed_, combination_, rigid_, errors_, forces_, push_, move_;
  Workspace pushing_;
};

}  // namespace clamber
