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

/// What the robot does in the scenario; each begins with the climb onto all fours.
enum class Goal {
  kAllFours,    ///< rests on top on its goal contacts
  kStandOnTop,  ///< then stands up
  kOver,        ///< then walks over the top, turns round and climbs down the far side, backwards
  kBackDown,    ///< climbs down again where it came up
};
[[nodiscard]] const char* to_string(Goal goal);
/// Where the robot is with the goal reached: "on top of", "over" ... the obstacle.
[[nodiscard]] const char* outcome(Goal goal);

struct Scenario {
  std::string name;
  std::string hash;                    ///< SHA-256 of the file, hex
  std::vector<ObstacleBox> obstacles;  ///< the first is the one to climb
  double friction = 0.8;
  Eigen::Vector3d start_position = Eigen::Vector3d::Zero();  ///< mid-point between the soles, m
  double start_yaw = 0.0;                                    ///< rad
  Goal goal = Goal::kAllFours;
  /// Contact links that must carry the robot on all fours; none: all that are not soles.
  std::vector<std::string> goal_contacts;
};

/// @throws InputError naming file, line, key and what was expected.
[[nodiscard]] Scenario load_scenario(const std::filesystem::path& file);
/// As load_scenario() from the text itself; `file` only names it in errors.
[[nodiscard]] Scenario parse_scenario(const std::string& text, const std::string& file);
/// The scenario with its first obstacle `height` (m) high; name and hash tell the difference.
/// @throws InputError when the height is not positive and finite
[[nodiscard]] Scenario with_height(Scenario scenario, double height);

/// The scenario with another goal; name and hash tell the difference.
[[nodiscard]] Scenario with_goal(Scenario scenario, Goal goal);

/// The links that carry on all fours: the scenario's goal contacts or, where it names none, all of
/// the robot's but its soles.
[[nodiscard]] std::vector<std::string> all_fours_contacts(const RobotModel& model,
                                                          const Scenario& scenario);

/// Base pose and home posture with both soles flat on the floor at the scenario's start pose.
/// @throws InputError when the model has no two foot contacts or its home posture no flat soles
[[nodiscard]] Configuration start_configuration(const RobotModel& model, const Scenario& scenario);

}  // namespace clamber
