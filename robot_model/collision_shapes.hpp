// Turns a URDF link's collision elements into primitives; finds the capsules among them.
// Any thread; allocates: yes; blocks: no. Start-up only.
#pragma once

#include <urdf_model/link.h>

#include <string>
#include <vector>

#include "robot_model/model.hpp"

namespace clamber {

/// The primitives of `link`, posed in the link's frame (Geom::X_BG) with Geom::body left at 0.
///
/// URDF knows no capsule. It is written as a <cylinder> and two <sphere>s of the same radius at
/// the ends of its axis, which is the same solid for every reader; here the three elements become
/// one Shape::kCapsule named after the cylinder.
/// @throws InputError for a mesh, a cylinder without its two spheres, a size that is not positive
[[nodiscard]] std::vector<Geom> collision_shapes(const urdf::Link& link, const std::string& file);

}  // namespace clamber
