// The support region of a set of contacts: where the centre of mass may project.
// Any thread; allocates; never blocks.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace clamber {

/// Half plane n . p >= c (n unit, pointing inwards).
struct HalfPlane {
  Eigen::Vector2d normal;
  double offset = 0.0;
};

/// Convex hull of the contacts' projections. For contacts on horizontal surfaces, at whatever
/// heights, vertical forces alone balance a centre of mass above it: friction is kept in reserve.
class SupportRegion {
 public:
  explicit SupportRegion(const std::vector<Eigen::Vector3d>& points);

  [[nodiscard]] const std::vector<HalfPlane>& half_planes() const { return half_planes_; }
  [[nodiscard]] const std::vector<Eigen::Vector2d>& corners() const { return corners_; }
  /// Distance of p to the nearest edge, m, negative outside.
  [[nodiscard]] double margin(const Eigen::Vector2d& p) const;
  /// The point with the largest margin among those on the way from p to the region's middle:
  /// where to move a centre of mass for `wanted` margin with the least motion.
  [[nodiscard]] Eigen::Vector2d nearest_inside(const Eigen::Vector2d& p, double wanted) const;
  /// A point of (nearly) largest margin.
  [[nodiscard]] const Eigen::Vector2d& middle() const { return middle_; }

 private:
  std::vector<Eigen::Vector2d> corners_;  // counter-clockwise
  std::vector<HalfPlane> half_planes_;
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
};

}  // namespace clamber
