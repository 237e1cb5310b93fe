#include "planner_offline/certify/support_region.hpp"

#include <algorithm>
#include <limits>

namespace clamber {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Andrew's monotone chain, counter-clockwise, without collinear points.
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
  });
  std::vector<Eigen::Vector2d> hull;
  const auto grow = [&hull](const Eigen::Vector2d& p, std::size_t keep) {
    while (hull.size() >= keep + 2 &&
           cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 1e-12) {
      hull.pop_back();
    }
    hull.push_back(p);
  };
  for (const auto& p : points) {
    grow(p, 0);
  }
  const std::size_t lower = hull.size() - 1;
  for (auto it = points.rbegin() + 1; it != points.rend(); ++it) {
    grow(*it, lower);
  }
  hull.pop_back();
  return hull;
}

}  // namespace

SupportRegion::SupportRegion(const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector2d> flat;
  flat.reserve(points.size());
  for (const auto& p : points) {
    flat.emplace_back(p.head<2>());
  }
  if (flat.size() < 3) {
    return;
  }
  corners_ = convex_hull(std::move(flat));
  if (corners_.size() < 3) {
    corners_.clear();
    return;
  }
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const Eigen::Vector2d edge = (corners_[(i + 1) % corners_.size()] - corners_[i]).normalized();
    const Eigen::Vector2d normal(-edge.y(), edge.x());
    half_planes_.push_back({normal, normal.dot(corners_[i])});
  }
  // Ascend the (concave) margin from the centroid: exact enough for a target.
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  for (const auto& c : corners_) {
    p += c / static_cast<double>(corners_.size());
  }
  for (double step = 0.05; step > 1e-4;) {
    Eigen::Vector2d best = p;
    for (const Eigen::Vector2d& d : {Eigen::Vector2d(1, 0), Eigen::Vector2d(-1, 0),
                                     Eigen::Vector2d(0, 1), Eigen::Vector2d(0, -1)}) {
      if (margin(p + step * d) > margin(best) + 1e-12) {
        best = p + step * d;
      }
    }
    if (best == p) {
      step *= 0.5;
    }
    p = best;
  }
  middle_ = p;
}

double SupportRegion::margin(const Eigen::Vector2d& p) const {
  if (half_planes_.empty()) {
    return -std::numeric_limits<double>::infinity();
  }
  double least = std::numeric_limits<double>::infinity();
  for (const HalfPlane& h : half_planes_) {
    least = std::min(least, h.normal.dot(p) - h.offset);
  }
  return least;
}

Eigen::Vector2d SupportRegion::nearest_inside(const Eigen::Vector2d& p, double wanted) const {
  if (margin(p) >= wanted) {
    return p;
  }
  const double reachable = std::min(wanted, 0.999 * margin(middle_));
  double outside = 0.0, inside = 1.0;
  for (int i = 0; i < 40; ++i) {
    const double t = 0.5 * (outside + inside);
    (margin(p + t * (middle_ - p)) >= reachable ? inside : outside) = t;
  }
  return p + inside * (middle_ - p);
}

}  // namespace clamber
