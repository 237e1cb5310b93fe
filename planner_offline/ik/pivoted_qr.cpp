#include "planner_offline/ik/pivoted_qr.hpp"

#include <Eigen/Householder>
#include <algorithm>
#include <numeric>

namespace clamber {

void PivotedQr::compute(const Eigen::Ref<const Eigen::MatrixXd>& M, double threshold, bool pivot) {
  rows_ = M.rows();
  cols_ = M.cols();
  rank_ = 0;
  permutation_.resize(static_cast<std::size_t>(cols_));
  std::iota(permutation_.begin(), permutation_.end(), Eigen::Index{0});
  MatrixMap F = factors_.matrix(rows_, cols_);
  F = M;
  VectorMap taus = taus_.vector(std::min(rows_, cols_));
  VectorMap norms = norms_.vector(cols_);
  norms = F.colwise().squaredNorm().transpose();
  double* scratch = scratch_.vector(cols_).data();
  for (Eigen::Index k = 0; k < taus.size(); ++k) {
    if (pivot) {
      Eigen::Index longest = 0;
      norms.tail(cols_ - k).maxCoeff(&longest);
      longest += k;
      F.col(k).swap(F.col(longest));
      std::swap(norms[k], norms[longest]);
      std::swap(permutation_[static_cast<std::size_t>(k)],
                permutation_[static_cast<std::size_t>(longest)]);
    }
    double beta = 0.0;
    auto column = F.col(k).tail(rows_ - k);
    if (column.squaredNorm() <= threshold * threshold) break;
    column.makeHouseholderInPlace(taus[k], beta);
    F(k, k) = beta;
    F.bottomRightCorner(rows_ - k, cols_ - k - 1)
        .applyHouseholderOnTheLeft(column.tail(rows_ - k - 1), taus[k], scratch);
    // Recomputed rather than downdated: the matrices are small and the rank decision is exact.
    for (Eigen::Index j = k + 1; j < cols_; ++j) {
      norms[j] = F.col(j).tail(rows_ - k - 1).squaredNorm();
    }
    ++rank_;
  }
}

void PivotedQr::apply_q_on_the_right(Eigen::Ref<Eigen::MatrixXd> B) {
  const MatrixMap F = factors_.matrix(rows_, cols_);
  const VectorMap taus = taus_.vector(std::min(rows_, cols_));
  double* scratch = scratch_.vector(std::max(cols_, B.rows())).data();
  for (Eigen::Index k = 0; k < rank_; ++k) {
    B.rightCols(rows_ - k).applyHouseholderOnTheRight(F.col(k).tail(rows_ - k - 1), taus[k],
                                                      scratch);
  }
}

void PivotedQr::apply_q(Eigen::Ref<Eigen::VectorXd> v) {
  const MatrixMap F = factors_.matrix(rows_, cols_);
  const VectorMap taus = taus_.vector(std::min(rows_, cols_));
  double* scratch = scratch_.vector(cols_).data();
  for (Eigen::Index k = rank_ - 1; k >= 0; --k) {
    v.tail(rows_ - k).applyHouseholderOnTheLeft(F.col(k).tail(rows_ - k - 1), taus[k], scratch);
  }
}

void PivotedQr::apply_q_transpose(Eigen::Ref<Eigen::VectorXd> v) {
  const MatrixMap F = factors_.matrix(rows_, cols_);
  const VectorMap taus = taus_.vector(std::min(rows_, cols_));
  double* scratch = scratch_.vector(cols_).data();
  for (Eigen::Index k = 0; k < rank_; ++k) {
    v.tail(rows_ - k).applyHouseholderOnTheLeft(F.col(k).tail(rows_ - k - 1), taus[k], scratch);
  }
}

}  // namespace clamber
