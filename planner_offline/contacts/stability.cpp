#include "planner_offline/contacts/stability.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace clamber {
namespace {

double cross(const Eigen::Vector2d& o, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return (a.x() - o.x()) * (b.y() - o.y()) - (a.y() - o.y()) * (b.x() - o.x());
}

void add_chain(const std::vector<Eigen::Vector2d>& points, std::vector<Eigen::Vector2d>& hull) {
  const std::size_t base = hull.size();
  for (const Eigen::Vector2d& point : points) {
    while (hull.size() >= base + 2 && cross(hull[hull.size() - 2], hull.back(), point) <= 0.0) {
      hull.pop_back();
    }
    hull.push_back(point);
  }
  hull.pop_back();
}

/// Corners in counter-clockwise order (Andrew's monotone chain); fewer than three when degenerate.
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points) {
  const auto before = [](const auto& a, const auto& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  };
  std::sort(points.begin(), points.end(), before);
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) {
    return points;
  }
  std::vector<Eigen::Vector2d> hull;
  add_chain(points, hull);
  std::reverse(points.begin(), points.end());
  add_chain(points, hull);
  return hull;
}

double segment_distance(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                        const Eigen::Vector2d& p) {
  const double length2 = (b - a).squaredNorm();
  const double t = length2 > 0.0 ? std::clamp((p - a).dot(b - a) / length2, 0.0, 1.0) : 0.0;
  return (p - a - t * (b - a)).norm();
}

}  // namespace

double support_angle(const Eigen::Vector3d& contact, const Eigen::Vector3d& support) noexcept {
  const Eigen::Vector3d line = support - contact;
  return std::atan2(line.head<2>().norm(), line.z());
}

double contact_stability(const Eigen::Vector3d& contact, const Eigen::Vector3d& support) noexcept {
  const Eigen::Vector3d line = support - contact;
  return line.z() > 0.0 ? line.head<2>().norm() : line.norm();
}

double hull_margin(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& point) {
  std::vector<Eigen::Vector2d> flat;
  for (const Eigen::Vector3d& p : points) {
    flat.emplace_back(p.head<2>());
  }
  const std::vector<Eigen::Vector2d> hull = convex_hull(std::move(flat));
  const Eigen::Vector2d p = point.head<2>();
  bool inside = hull.size() >= 3;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Eigen::Vector2d& a = hull[i];
    const Eigen::Vector2d& b = hull[(i + 1) % hull.size()];
    inside = inside && cross(a, b, p) >= 0.0;
    nearest = std::min(nearest, segment_distance(a, b, p));
  }
  return inside ? nearest : -nearest;
}

double state_stability(std::span<const LimbContact> loaded,
                       std::span<const Eigen::Vector3d> support_points, const Eigen::Vector3d& com,
                       const StabilityConfig& config) {
  struct Limb {
    bool supported = false;
    double s = std::numeric_limits<double>::infinity();
  };
  std::map<std::string_view, Limb> limbs;
  for (const LimbContact& c : loaded) {
    Limb& limb = limbs[c.limb];
    const double contact_s = contact_stability(c.contact, c.support);
    const double bound = (c.support - c.contact).norm() * std::sin(config.max_theta);
    limb.supported = limb.supported || contact_s <= bound + config.tolerance;
    limb.s = std::min(limb.s, contact_s);
  }
  double s = 0.0;
  for (const auto& [name, limb] : limbs) {
    s = limb.supported ? s : std::max(s, limb.s);
  }
  const double outside = config.com_margin - hull_margin(support_points, com);
  return outside > config.tolerance ? std::max(s, outside) : s;
}

}  // namespace clamber
