// Distance between convex solids by the Gilbert-Johnson-Keerthi algorithm.
// Any thread; allocates: never; blocks: never; throws: never.
//
// The planner has closed formulas of its own; the verifier must not inherit their mistakes.
#pragma once

#include "robot_model/model.hpp"

namespace clamber {

/// A point, a segment or a box, inflated by a radius: sphere, capsule and box of the robot model.
struct InflatedCore {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();        ///< m, world
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();      ///< columns: the core's own axes
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  ///< m; zero along a missing dimension
  double radius = 0.0;                                     ///< m

  /// Of a sphere around everything.
  [[nodiscard]] double reach() const { return half_extents.norm() + radius; }
  /// The core's point farthest along d.
  [[nodiscard]] Eigen::Vector3d support(const Eigen::Vector3d& d) const;
};

[[nodiscard]] InflatedCore inflated_core(const Geom& geom, const Pose& X_WB) noexcept;

/// Distance of the cores less both radii, m. Exact (to about 1e-9 m) as long as the cores are
/// apart; overlapping cores give minus the sum of the radii, and at least 1e-3 m, negative.
[[nodiscard]] double convex_distance(const InflatedCore& a, const InflatedCore& b) noexcept;

/// Lowest point's height, m.
[[nodiscard]] double lowest_height(const InflatedCore& a) noexcept;

}  // namespace clamber
