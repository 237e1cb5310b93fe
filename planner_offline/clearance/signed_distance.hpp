// Signed distance and witness points between the simulator's own primitives.
// Any thread; allocates: never; blocks: never; throws: never.
#pragma once

#include "robot_model/model.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// A primitive placed in the world.
struct Solid {
  Shape shape = Shape::kSphere;
  Pose X_WG;
  double radius = 0.0;
  double length = 0.0;                                     ///< capsule axis, m
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  ///< box, m
};

[[nodiscard]] Solid place(const Geom& geom, const Pose& X_WB) noexcept;
[[nodiscard]] Solid solid_of(const ObstacleBox& box) noexcept;

struct Distance {
  double value = 0.0;                              ///< m, negative in penetration
  Eigen::Vector3d on_a = Eigen::Vector3d::Zero();  ///< nearest (or deepest) point of a, world
  Eigen::Vector3d on_b = Eigen::Vector3d::Zero();  ///< of b
  Eigen::Vector3d normal =
      Eigen::Vector3d::UnitZ();  ///< from b to a, unit: moving a along it adds distance
};

/// Exact for every pair of sphere, capsule and box that is apart, and in penetration as long as no
/// axis enters the other solid. Deeper in, a sphere's or capsule's value against a box is that of
/// the axis point farthest from the box's faces (its normal: the way to the nearest face); box
/// against box in penetration is an estimate from their edges. (FCL, which the playback analysis
/// uses, has no dependable penetration depth for these pairs, and the inverse kinematics needs one
/// to push out of contact.)
[[nodiscard]] Distance signed_distance(const Solid& a, const Solid& b) noexcept;

/// Largest distance of a point of the solid from its centre along each of the axes (columns), m.
[[nodiscard]] Eigen::Vector3d extent_of(const Solid& solid, const Eigen::Matrix3d& axes) noexcept;

/// Some lower bound on signed_distance(a, b), cheap: what is farther apart need not be looked at.
[[nodiscard]] double distance_at_least(const Solid& a, const Solid& b) noexcept;

/// Distance of a solid to the half space z <= height.
[[nodiscard]] Distance distance_to_floor(const Solid& a, double height) noexcept;

}  // namespace clamber
