#include "certificate/convex_distance.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace clamber {
namespace {

using Vec = Eigen::Vector3d;

/// Points of the Minkowski difference, at most four, and the point of their hull nearest to 0.
struct Simplex {
  std::array<Vec, 4> p{Vec::Zero(), Vec::Zero(), Vec::Zero(), Vec::Zero()};
  int size = 0;

  void keep(std::initializer_list<int> which) {
    std::array<Vec, 4> kept = p;
    int n = 0;
    for (const int i : which) kept[static_cast<std::size_t>(n++)] = p[static_cast<std::size_t>(i)];
    p = kept;
    size = n;
  }
};

Vec nearest_on_segment(Simplex& s) {
  const Vec edge = s.p[1] - s.p[0];
  const double length2 = edge.squaredNorm();
  const double t = length2 > 0.0 ? -s.p[0].dot(edge) / length2 : 0.0;
  if (t <= 0.0) {
    s.keep({0});
    return s.p[0];
  }
  if (t >= 1.0) {
    s.keep({1});
    return s.p[0];
  }
  return s.p[0] + t * edge;
}

/// By the signs of barycentric areas; a degenerate triangle falls back to its edges.
Vec nearest_on_triangle(Simplex& s) {
  const Vec a = s.p[0], b = s.p[1], c = s.p[2];
  const Vec n = (b - a).cross(c - a);
  const double n2 = n.squaredNorm();
  const double scale = std::max({(b - a).squaredNorm(), (c - a).squaredNorm()});
  if (n2 > 1e-24 * scale * scale) {
    const double u = n.dot(b.cross(c)), v = n.dot(c.cross(a)), w = n.dot(a.cross(b));
    if (u > 0.0 && v > 0.0 && w > 0.0) return n * (n.dot(a) / n2);
  }
  Vec best = Vec::Zero();
  double least = std::numeric_limits<double>::infinity();
  Simplex chosen;
  for (const auto& [i, j] : {std::pair{0, 1}, std::pair{1, 2}, std::pair{2, 0}}) {
    Simplex edge;
    edge.p[0] = s.p[static_cast<std::size_t>(i)];
    edge.p[1] = s.p[static_cast<std::size_t>(j)];
    edge.size = 2;
    const Vec q = nearest_on_segment(edge);
    if (q.squaredNorm() < least) {
      least = q.squaredNorm();
      best = q;
      chosen = edge;
    }
  }
  s = chosen;
  return best;
}

/// `inside` is set when the origin is in the tetrahedron.
Vec nearest_on_tetrahedron(Simplex& s, bool& inside) {
  static constexpr std::array<std::array<int, 4>, 4> kFaces = {
      {{0, 1, 2, 3}, {0, 1, 3, 2}, {0, 2, 3, 1}, {1, 2, 3, 0}}};
  Vec best = Vec::Zero();
  double least = std::numeric_limits<double>::infinity();
  Simplex chosen;
  inside = true;
  for (const auto& face : kFaces) {
    const auto at = [&](int i) {
      return s.p[static_cast<std::size_t>(face[static_cast<std::size_t>(i)])];
    };
    const Vec n = (at(1) - at(0)).cross(at(2) - at(0));
    const double origin_side = -n.dot(at(0)), other_side = n.dot(at(3) - at(0));
    if (origin_side * other_side > 0.0) continue;  // the origin lies behind this face
    inside = false;
    Simplex triangle;
    triangle.p = {at(0), at(1), at(2), Vec::Zero()};
    triangle.size = 3;
    const Vec q = nearest_on_triangle(triangle);
    if (q.squaredNorm() < least) {
      least = q.squaredNorm();
      best = q;
      chosen = triangle;
    }
  }
  if (!inside) s = chosen;
  return best;
}

Vec nearest(Simplex& s, bool& inside) {
  inside = false;
  switch (s.size) {
    case 1:
      return s.p[0];
    case 2:
      return nearest_on_segment(s);
    case 3:
      return nearest_on_triangle(s);
    default:
      return nearest_on_tetrahedron(s, inside);
  }
}

}  // namespace

Vec InflatedCore::support(const Vec& d) const {
  Vec out = centre;
  for (int i = 0; i < 3; ++i) {
    const double e = half_extents[i];
    if (e > 0.0) out += (axes.col(i).dot(d) >= 0.0 ? e : -e) * axes.col(i);
  }
  return out;
}

InflatedCore inflated_core(const Geom& geom, const Pose& X_WB) noexcept {
  const Pose X = X_WB * geom.X_BG;
  InflatedCore core{X.p, X.R, Vec::Zero(), geom.radius};
  if (geom.shape == Shape::kCapsule) core.half_extents.z() = 0.5 * geom.length;
  if (geom.shape == Shape::kBox) {
    core.half_extents = geom.half_extents;
    core.radius = 0.0;
  }
  return core;
}

double convex_distance(const InflatedCore& a, const InflatedCore& b) noexcept {
  constexpr int kMostSteps = 64;
  constexpr double kTolerance = 1e-10;  // m
  Simplex s;
  Vec v = a.centre - b.centre;
  if (v.squaredNorm() == 0.0) v = Vec::UnitX();
  double distance = 0.0;
  bool inside = false;
  s.p[0] = a.support(-v) - b.support(v);
  s.size = 1;
  v = s.p[0];
  for (int step = 0; step < kMostSteps; ++step) {
    distance = v.norm();
    if (distance < 1e-12) {
      inside = true;
      break;
    }
    const Vec w = a.support(-v) - b.support(v);
    // The plane through w bounds the distance from below: stop when it cannot shrink.
    if (distance - v.dot(w) / distance < kTolerance) break;
    bool known = false;
    for (int i = 0; i < s.size; ++i) known |= s.p[static_cast<std::size_t>(i)] == w;
    if (known) break;
    s.p[static_cast<std::size_t>(s.size++)] = w;
    v = nearest(s, inside);
    if (inside) break;
  }
  const double radii = a.radius + b.radius;
  return inside ? -std::max(radii, 1e-3) : distance - radii;
}

double lowest_height(const InflatedCore& a) noexcept {
  return a.support(-Vec::UnitZ()).z() - a.radius;
}

}  // namespace clamber
