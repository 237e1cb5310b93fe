// Joint angles of a short serial chain that reproduce a given rotation.
// Any thread; allocates: never after construction; blocks: never.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot_model/model.hpp"

namespace clamber {

/// What a chain reproduces of the rotation.
enum class ChainMatch {
  kRotation,  ///< all of it, as nearly as the joints can
  kLongAxis,  ///< the direction of the moved segment's z axis; turning about it does not count
};

/// Rotation of a chain of up to three revolute joints, from the body before the first joint to
/// the body after the last one.
class ChainSolver {
 public:
  using Angles = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;

  /// @param joints indices of consecutive joints of the tree, parent first (1 to 3)
  /// @param axis the moved segment's long axis in the last body, used by kLongAxis (unit)
  ChainSolver(const RobotModel& model, std::vector<int> joints,
              ChainMatch match = ChainMatch::kRotation,
              const Eigen::Vector3d& axis = Eigen::Vector3d::UnitZ());

  [[nodiscard]] Eigen::Matrix3d rotation(const Angles& q) const noexcept;

  /// Angles that come nearest to `target` (least squares over the rotation vector of the
  /// difference), found by damped Gauss-Newton from `start`, so that a motion solved frame by
  /// frame stays on one branch and is continuous. Limits are not applied.
  /// @return angles; `residual` gets the remaining rotation, rad
  [[nodiscard]] Angles solve(const Eigen::Matrix3d& target, const Angles& start,
                             double& residual) const noexcept;

  /// solve() from several starts within the limits: the nearest rotation, and among equals the
  /// smallest excess over the limits and then the smallest angles.
  [[nodiscard]] Angles solve_anywhere(const Eigen::Matrix3d& target,
                                      double& residual) const noexcept;

  [[nodiscard]] int size() const noexcept { return static_cast<int>(joints_.size()); }
  [[nodiscard]] int joint(int i) const noexcept { return joints_[static_cast<std::size_t>(i)]; }

 private:
  struct Link {
    Eigen::Matrix3d R_PJ;
    Eigen::Vector3d axis;
    double lower = 0.0;
    double upper = 0.0;
  };
  [[nodiscard]] Eigen::Vector3d error(const Eigen::Matrix3d& target,
                                      const Eigen::Matrix3d& R) const noexcept;

  std::vector<int> joints_;
  std::vector<Link> links_;
  ChainMatch match_;
  Eigen::Vector3d axis_;
};

}  // namespace clamber
