#include "certificate/support_polygon.hpp"

#include <algorithm>
#include <limits>

namespace clamber {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace

SupportPolygon::SupportPolygon(std::span<const Eigen::Vector2d> points) noexcept {
  if (points.size() < 3 || points.size() > corners_.size()) return;
  // From the lowest point, always on to the one that has all others on its left.
  const auto start =
      std::min_element(points.begin(), points.end(), [](const auto& a, const auto& b) {
        return a.y() < b.y() || (a.y() == b.y() && a.x() < b.x());
      });
  Eigen::Vector2d at = *start;
  do {
    corners_[count_++] = at;
    const Eigen::Vector2d* next = nullptr;
    for (const Eigen::Vector2d& p : points) {
      if ((p - at).squaredNorm() < 1e-18) continue;
      if (next == nullptr) {
        next = &p;
        continue;
      }
      const double turn = cross(*next - at, p - at);
      const bool farther = (p - at).squaredNorm() > (*next - at).squaredNorm();
      if (turn < -1e-14 || (turn <= 1e-14 && farther)) next = &p;
    }
    if (next == nullptr) break;
    at = *next;
  } while ((at - *start).squaredNorm() > 1e-18 && count_ < points.size());
}

double SupportPolygon::margin(const Eigen::Vector2d& p) const noexcept {
  if (count_ < 3) return -std::numeric_limits<double>::infinity();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count_; ++i) {
    const Eigen::Vector2d a = corners_[i];
    const Eigen::Vector2d edge = corners_[i + 1 == count_ ? 0 : i + 1] - a;
    least = std::min(least, cross(edge, p - a) / edge.norm());
  }
  return least;
}

}  // namespace clamber
