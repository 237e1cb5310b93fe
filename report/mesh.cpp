#include "report/mesh.hpp"

#include <array>
#include <cmath>
#include <numbers>

namespace clamber {

namespace {

constexpr int kSegments = 40;
constexpr int kRings = 10;  // per hemisphere

/// Turns points of a primitive's frame into vertices of the world.
class Builder {
 public:
  Builder(const Pose& X_WP, Rgb colour, std::vector<MeshVertex>& mesh)
      : X_WP_(X_WP), colour_(colour), mesh_(mesh) {}

  void set_wood(const Eigen::Vector3d& half_extents) { extent_ = half_extents; }

  void vertex(const Eigen::Vector3d& p, const Eigen::Vector3d& n) {
    const Eigen::Vector3f position = (X_WP_ * p).cast<float>();
    const Eigen::Vector3f normal = (X_WP_.R * n).cast<float>();
    const Eigen::Vector3f local = p.cast<float>();
    const Eigen::Vector3f extent = extent_.cast<float>();
    mesh_.push_back(
        {{position.x(), position.y(), position.z()},
         {normal.x(), normal.y(), normal.z()},
         {static_cast<float>(colour_.r) / 255.0f, static_cast<float>(colour_.g) / 255.0f,
          static_cast<float>(colour_.b) / 255.0f},
         {local.x(), local.y(), local.z()},
         {extent.x(), extent.y(), extent.z()}});
  }

 private:
  Pose X_WP_;
  Rgb colour_;
  std::vector<MeshVertex>& mesh_;
  Eigen::Vector3d extent_ = Eigen::Vector3d::Zero();
};

/// A point of a profile turned about z: radius and height, with its normal in the same plane.
struct ProfilePoint {
  double r, z, normal_r, normal_z;
};

void revolve(const std::vector<ProfilePoint>& profile, Builder& out) {
  for (int s = 0; s < kSegments; ++s) {
    const double a0 = 2.0 * std::numbers::pi * s / kSegments;
    const double a1 = 2.0 * std::numbers::pi * (s + 1) / kSegments;
    const auto emit = [&out](const ProfilePoint& p, double a) {
      const double c = std::cos(a);
      const double n = std::sin(a);
      out.vertex({p.r * c, p.r * n, p.z}, {p.normal_r * c, p.normal_r * n, p.normal_z});
    };
    for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
      const ProfilePoint& low = profile[i];
      const ProfilePoint& high = profile[i + 1];
      emit(low, a0);
      emit(low, a1);
      emit(high, a1);
      emit(low, a0);
      emit(high, a1);
      emit(high, a0);
    }
  }
}

std::vector<ProfilePoint> capsule_profile(double radius, double length) {
  std::vector<ProfilePoint> profile;
  for (const double end : {-1.0, 1.0}) {
    for (int i = 0; i <= kRings; ++i) {
      const double share = static_cast<double>(i) / kRings;
      const double angle = 0.5 * std::numbers::pi * (end < 0 ? share - 1.0 : share);
      profile.push_back({radius * std::cos(angle), end * 0.5 * length + radius * std::sin(angle),
                         std::cos(angle), std::sin(angle)});
    }
  }
  return profile;
}

void append_box(const Eigen::Vector3d& half, Builder& out) {
  constexpr std::array<std::array<double, 2>, 6> kCorners{
      {{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}}};
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    for (const double side : {-1.0, 1.0}) {
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      normal[axis] = side;
      for (const auto& corner : kCorners) {
        Eigen::Vector3d p;
        p[axis] = side * half[axis];
        p[u] = side * corner[0] * half[u];  // mirrored faces keep their winding
        p[v] = corner[1] * half[v];
        out.vertex(p, normal);
      }
    }
  }
}

}  // namespace

void append_primitive(const ScenePrimitive& primitive, std::vector<MeshVertex>& mesh) {
  Builder out(primitive.X_WP, primitive.colour, mesh);
  if (primitive.shape == Shape::kBox) {
    if (primitive.material == Material::kWood) {
      out.set_wood(primitive.half_extents);
    }
    append_box(primitive.half_extents, out);
    return;
  }
  const double length = primitive.shape == Shape::kCapsule ? primitive.length : 0.0;
  revolve(capsule_profile(primitive.radius, length), out);
}

void append_arrow(const SceneArrow& arrow, std::vector<MeshVertex>& mesh) {
  constexpr double kShaft = 0.007;
  constexpr double kHead = 0.019;
  constexpr double kHeadLength = 0.038;
  const double length = arrow.vector.norm();
  if (length < 1e-6) {
    return;
  }
  Pose pose;
  pose.R =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), arrow.vector).toRotationMatrix();
  pose.p = arrow.from;
  Builder out(pose, arrow.colour, mesh);
  const double scale = std::min(1.0, length / (1.5 * kHeadLength));
  const double neck = length - scale * kHeadLength;
  const double slope = std::hypot(kHead, kHeadLength);
  revolve({{0.0, 0.0, 0.0, -1.0},
           {kShaft, 0.0, 0.0, -1.0},
           {kShaft, 0.0, 1.0, 0.0},
           {kShaft, neck, 1.0, 0.0},
           {kShaft, neck, 0.0, -1.0},
           {scale * kHead, neck, 0.0, -1.0},
           {scale * kHead, neck, kHeadLength / slope, kHead / slope},
           {0.0, length, kHeadLength / slope, kHead / slope}},
          out);
  // The point of contact itself.
  ScenePrimitive dot;
  dot.X_WP.p = arrow.from;
  dot.radius = 0.016;
  dot.colour = arrow.colour;
  append_primitive(dot, mesh);
}

}  // namespace clamber
