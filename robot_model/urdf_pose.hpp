// URDF poses as ours. Any thread; allocates: never; blocks: never.
#pragma once

#include <urdf_model/pose.h>

#include "robot_model/types.hpp"

namespace clamber {

[[nodiscard]] inline Eigen::Vector3d from_urdf(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

[[nodiscard]] inline Pose from_urdf(const urdf::Pose& pose) {
  const urdf::Rotation& r = pose.rotation;
  const Eigen::Quaterniond quaternion(r.w, r.x, r.y, r.z);
  return {quaternion.normalized().toRotationMatrix(), from_urdf(pose.position)};
}

}  // namespace clamber
