#include "planner_offline/clearance/signed_distance.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace clamber {
namespace {

using Eigen::Vector3d;

struct Segment {
  Vector3d a, b;
  [[nodiscard]] Vector3d at(double t) const { return a + t * (b - a); }
};

/// The axis of a sphere (a point) or capsule in the world.
Segment axis_of(const Solid& s) noexcept {
  const Vector3d half = s.shape == Shape::kCapsule ? Vector3d(0.5 * s.length * s.X_WG.R.col(2))
                                                   : Vector3d(Vector3d::Zero());
  return {s.X_WG.p - half, s.X_WG.p + half};
}

struct PointToBox {
  double value;
  Vector3d nearest;  // on the box's surface, box frame
  Vector3d normal;   // outward, box frame
};

/// Signed distance of a point to a box, both in the box's frame.
PointToBox point_to_box(const Vector3d& p, const Vector3d& half) noexcept {
  const Vector3d clamped = p.cwiseMax(-half).cwiseMin(half);
  const Vector3d outside = p - clamped;
  const double distance = outside.norm();
  if (distance > 1e-12) {
    return {distance, clamped, outside / distance};
  }
  Eigen::Index axis = 0;
  const double depth = (half - p.cwiseAbs()).minCoeff(&axis);
  Vector3d normal = Vector3d::Zero();
  normal[axis] = p[axis] >= 0.0 ? 1.0 : -1.0;
  return {-depth, p + depth * normal, normal};
}

bool is_inside(const Vector3d& p, const Vector3d& half) noexcept {
  // With the rounding of a point that was computed to lie on a face.
  constexpr double kOn = 1e-12;
  return ((half - p.cwiseAbs()).array() >= -kOn).all();
}

/// The same for a segment that enters the box: golden section over the depth.
double deepest_parameter(const Segment& s, const Vector3d& half) noexcept {
  constexpr double kRatio = 0.6180339887498949;
  double low = 0.0, high = 1.0;
  double t1 = high - kRatio, t2 = low + kRatio;
  double f1 = point_to_box(s.at(t1), half).value, f2 = point_to_box(s.at(t2), half).value;
  for (int i = 0; i < 40; ++i) {
    if (f1 <= f2) {
      high = t2;
      t2 = t1;
      f2 = f1;
      t1 = high - kRatio * (high - low);
      f1 = point_to_box(s.at(t1), half).value;
    } else {
      low = t1;
      t1 = t2;
      f1 = f2;
      t2 = low + kRatio * (high - low);
      f2 = point_to_box(s.at(t2), half).value;
    }
  }
  const double middle = 0.5 * (low + high);
  double best = middle, value = point_to_box(s.at(middle), half).value;
  for (const double end : {0.0, 1.0}) {
    const double candidate = point_to_box(s.at(end), half).value;
    if (candidate < value) {
      best = end;
      value = candidate;
    }
  }
  return best;
}

/// Where along the segment the distance to the box is smallest; the first place where several are.
/// Half the squared distance is convex and its slope piecewise linear: kinks are where the segment
/// crosses a face's plane, and the slope's zero lies between two of them.
double nearest_parameter(const Segment& s, const Vector3d& half) noexcept {
  const Vector3d along = s.b - s.a;
  if (along.isZero(0.0)) {
    return 0.0;  // a sphere's centre or a corner
  }
  const auto slope = [&](double t) {
    const Vector3d p = s.at(t);
    return (p - p.cwiseMax(-half).cwiseMin(half)).dot(along);
  };
  // Slopes below this are those of an edge that runs along a face.
  const double flat = 1e-12 * along.squaredNorm();
  double low = 0.0, high = 1.0;
  double slope_low = slope(low);
  if (slope_low >= -flat) {
    return slope_low > flat || !is_inside(s.a, half) ? low : deepest_parameter(s, half);
  }
  double slope_high = slope(high);
  if (slope_high < -flat) {
    return high;
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (const double side : {-half[axis], half[axis]}) {
      const double t = (side - s.a[axis]) / along[axis];
      if (!(t > low && t < high)) {
        continue;
      }
      const double at = slope(t);
      if (at < -flat) {
        low = t;
        slope_low = at;
      } else {
        high = t;
        slope_high = at;
      }
    }
  }
  const double rise = slope_high - slope_low;
  const double best = std::min(high, low - slope_low * (high - low) / rise);
  return is_inside(s.at(best), half) ? deepest_parameter(s, half) : best;
}

/// Segment (with a radius) against a box; `a` of the result lies on the segment's solid.
Distance segment_to_box(const Segment& world, double radius, const Solid& box) noexcept {
  const Pose X_GW = box.X_WG.inverse();
  const Segment local{X_GW * world.a, X_GW * world.b};
  const Vector3d p = local.at(nearest_parameter(local, box.half_extents));
  const PointToBox hit = point_to_box(p, box.half_extents);
  Distance d;
  d.value = hit.value - radius;
  d.normal = box.X_WG.R * hit.normal;
  d.on_b = box.X_WG * hit.nearest;
  d.on_a = box.X_WG * p - radius * d.normal;
  return d;
}

/// Nearest points of two segments.
std::pair<Vector3d, Vector3d> nearest_points(const Segment& s1, const Segment& s2) noexcept {
  const Vector3d d1 = s1.b - s1.a, d2 = s2.b - s2.a, r = s1.a - s2.a;
  const double a = d1.squaredNorm(), e = d2.squaredNorm(), f = d2.dot(r);
  constexpr double kPoint = 1e-18;
  double s = 0.0, t = 0.0;
  if (a <= kPoint && e <= kPoint) {
    return {s1.a, s2.a};
  }
  if (a <= kPoint) {
    t = std::clamp(f / e, 0.0, 1.0);
  } else {
    const double c = d1.dot(r);
    if (e <= kPoint) {
      s = std::clamp(-c / a, 0.0, 1.0);
    } else {
      const double b = d1.dot(d2), denominator = a * e - b * b;
      s = denominator > 1e-15 ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0.0;
      t = (b * s + f) / e;
      if (t < 0.0) {
        t = 0.0;
        s = std::clamp(-c / a, 0.0, 1.0);
      } else if (t > 1.0) {
        t = 1.0;
        s = std::clamp((b - c) / a, 0.0, 1.0);
      }
    }
  }
  return {s1.at(s), s2.at(t)};
}

Distance segment_to_segment(const Solid& a, const Solid& b) noexcept {
  const auto [pa, pb] = nearest_points(axis_of(a), axis_of(b));
  const Vector3d gap = pa - pb;
  const double norm = gap.norm();
  Distance d;
  d.normal = norm > 1e-12 ? Vector3d(gap / norm) : Vector3d(Vector3d::UnitZ());
  d.value = norm - a.radius - b.radius;
  d.on_a = pa - a.radius * d.normal;
  d.on_b = pb + b.radius * d.normal;
  return d;
}

std::array<Segment, 12> edges_of(const Solid& box) noexcept {
  std::array<Segment, 12> edges;
  std::size_t n = 0;
  const Vector3d h = box.half_extents;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const double su : {-1.0, 1.0}) {
      for (const double sv : {-1.0, 1.0}) {
        Vector3d a, b;
        a[axis] = -h[axis];
        b[axis] = h[axis];
        a[u] = b[u] = su * h[u];
        a[v] = b[v] = sv * h[v];
        edges[n++] = {box.X_WG * a, box.X_WG * b};
      }
    }
  }
  return edges;
}

/// No point of the edge is nearer to the box than this: the distance grows by at most the way.
double least_possible(const Segment& edge, const Solid& box) noexcept {
  const Vector3d middle = box.X_WG.inverse() * Vector3d(0.5 * (edge.a + edge.b));
  constexpr double kRounding = 1e-9;
  return point_to_box(middle, box.half_extents).value - 0.5 * (edge.b - edge.a).norm() - kRounding;
}

Distance flipped(const Distance& d) noexcept { return {d.value, d.on_b, d.on_a, -d.normal}; }

/// The nearest features of two disjoint boxes always include an edge (or its end) of one of them.
Distance box_to_box(const Solid& a, const Solid& b) noexcept {
  Distance best;
  best.value = std::numeric_limits<double>::infinity();
  for (const Segment& edge : edges_of(a)) {
    if (least_possible(edge, b) >= best.value) {
      continue;
    }
    const Distance d = segment_to_box(edge, 0.0, b);
    if (d.value < best.value) {
      best = d;
    }
  }
  for (const Segment& edge : edges_of(b)) {
    if (least_possible(edge, a) >= best.value) {
      continue;
    }
    const Distance d = segment_to_box(edge, 0.0, a);
    if (d.value < best.value) {
      best = flipped(d);
    }
  }
  return best;
}

/// Largest distance of a point of the solid from its centre, m.
double reach_of(const Solid& s) noexcept {
  return s.shape == Shape::kBox ? s.half_extents.norm() : s.radius + 0.5 * s.length;
}

}  // namespace

Eigen::Vector3d extent_of(const Solid& s, const Eigen::Matrix3d& axes) noexcept {
  const Eigen::Matrix3d along = (axes.transpose() * s.X_WG.R).cwiseAbs();
  if (s.shape == Shape::kBox) return along * s.half_extents;
  return 0.5 * s.length * along.col(2) + Eigen::Vector3d::Constant(s.radius);
}

double distance_at_least(const Solid& a, const Solid& b) noexcept {
  if (b.shape == Shape::kBox) {
    return point_to_box(b.X_WG.inverse() * a.X_WG.p, b.half_extents).value - reach_of(a);
  }
  return (a.X_WG.p - b.X_WG.p).norm() - reach_of(a) - reach_of(b);
}

Solid place(const Geom& geom, const Pose& X_WB) noexcept {
  return {geom.shape, X_WB * geom.X_BG, geom.radius, geom.length, geom.half_extents};
}

Solid solid_of(const ObstacleBox& box) noexcept {
  Solid solid;
  solid.shape = Shape::kBox;
  solid.X_WG.p = box.center;
  solid.X_WG.R = Eigen::AngleAxisd(box.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  solid.half_extents = box.half_extents;
  return solid;
}

Distance signed_distance(const Solid& a, const Solid& b) noexcept {
  if (a.shape == Shape::kBox && b.shape == Shape::kBox) {
    return box_to_box(a, b);
  }
  if (b.shape == Shape::kBox) {
    return segment_to_box(axis_of(a), a.radius, b);
  }
  if (a.shape == Shape::kBox) {
    return flipped(segment_to_box(axis_of(b), b.radius, a));
  }
  return segment_to_segment(a, b);
}

Distance distance_to_floor(const Solid& a, double height) noexcept {
  Distance d;
  Vector3d lowest = a.X_WG.p;
  if (a.shape == Shape::kBox) {
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d column = a.X_WG.R.col(axis);
      lowest -= (column.z() >= 0.0 ? 1.0 : -1.0) * a.half_extents[axis] * column;
    }
  } else {
    const Segment s = axis_of(a);
    lowest = s.a.z() <= s.b.z() ? s.a : s.b;
    lowest.z() -= a.radius;
  }
  d.value = lowest.z() - height;
  d.on_a = lowest;
  d.on_b = {lowest.x(), lowest.y(), height};
  return d;
}

}  // namespace clamber
