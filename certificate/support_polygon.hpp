// Convex polygon of points in the plane, and how far inside of it a point lies.
// Any thread; allocates: never; blocks: never; throws: never.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

namespace clamber {

/// Hull of up to 64 points by gift wrapping (the planner's is another algorithm).
class SupportPolygon {
 public:
  explicit SupportPolygon(std::span<const Eigen::Vector2d> points) noexcept;

  /// Distance to the nearest edge's line, m, negative outside; minus infinity without an area.
  [[nodiscard]] double margin(const Eigen::Vector2d& p) const noexcept;

 private:
  std::array<Eigen::Vector2d, 64> corners_;
  std::size_t count_ = 0;
};

}  // namespace clamber
