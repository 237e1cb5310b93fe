// Builds bodies, joints, frames and primitives of a RobotModel from a parsed URDF.
// Any thread; allocates: yes; blocks: no. Start-up only.
#pragma once

#include <urdf_model/model.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "robot_model/model.hpp"

namespace clamber {

struct TreeOptions {
  std::string file;  ///< the URDF, named in messages
  /// Every movable joint once, parents before children. Without it: depth first, siblings by name.
  std::optional<std::vector<std::string>> joint_order;
  std::string order_source;  ///< where joint_order was given, named in messages about it
  /// Link name -> mass added to it (kg, may be negative). The link's inertia scales with its mass,
  /// its centre of mass stays.
  std::map<std::string, double> added_mass;
};

/// Fills bodies, joints (limits and damping; drive figures are the robot file's), frames, geoms
/// and total_mass. Links behind fixed joints are merged into the body that carries them.
/// @throws InputError for a joint that does not turn, missing or crossed limits, a moving body
///         without mass, an inertia that is not positive definite, more than kMaxJoints joints
void build_tree(const urdf::ModelInterface& document, const TreeOptions& options,
                RobotModel& model);

}  // namespace clamber
