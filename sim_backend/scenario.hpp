// A scenario: what stands on the floor, where the robot starts, what it shall reach.
// Start-up only (the loader allocates, reads a file and throws InputError).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "robot_model/model.hpp"

namespace clamber {

/// An axis-aligned-in-yaw box standing on the floor.
struct ObstacleBox {
  std::string name;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();        ///< m, world
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  ///< m
  double yaw = 0.0;                                        ///< rad
  [[nodiscard]] double top() const { return center.z() + half_extents.z(); }
};

struct Scenario {
  std::string name;
  std::string hash;                    ///< SHA-256 of the file, hex
  std::vector<ObstacleBox> obstacles;  ///< the first is the one to climb
  double friction = 0.8;
  Eigen::Vector3d start_position = Eigen::Vector3d::Zero();  ///< mid-point between the soles, m
  double start_yaw = 0.0;                                    ///< rad
  std::string goal = "all_fours";
  std::vector<std::string> goal_contacts;  ///< contact links that must carry the robot at the end
};

/// @throws InputError naming file, line, key and what was expected.
[[nodiscard]] Scenario load_scenario(const std::filesystem::path& file);
/// As load_scenario() from the text itself; `file` only names it in errors.
[[nodiscard]] Scenario parse_scenario(const std::string& text, const std::string& file);
/// The scenario with its first obstacle `height` (m) high; name and hash tell the difference.
/// @throws InputError when the height is not positive and finite
[[nodiscard]] Scenario with_height(Scenario scenario, double height);

/// Base pose and home posture with both soles flat on the floor at the scenario's start pose.
/// @throws InputError when the model has no two foot contacts or its home posture no flat soles
[[nodiscard]] Configuration start_configuration(const RobotModel& model, const Scenario& scenario);

}  // namespace clamber
