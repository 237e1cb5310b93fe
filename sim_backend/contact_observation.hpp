// A contact as a physics engine reports it: who touches what, where and how hard.
// Any thread; allocates: never; blocks: never.
#pragma once

#include <Eigen/Core>

namespace clamber {

/// What a robot geom touches.
enum class Surface { kFloor, kObstacle, kRobot };

/// One contact point during the last step.
struct ContactObservation {
  int geom = 0;  ///< the robot's geom, index into RobotModel::geoms
  Surface surface = Surface::kFloor;
  int other = 0;  ///< kObstacle: index into Scenario::obstacles; kRobot: geom index
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< m, world
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   ///< world, pointing into the robot's geom
  Eigen::Vector3d force = Eigen::Vector3d::Zero();     ///< N, world, on the robot's geom
  double depth = 0.0;                                  ///< m, penetration

  [[nodiscard]] double normal_force() const { return force.dot(normal); }
};

}  // namespace clamber
