// What the browser draws a run with: the robot's shapes and joints, obstacles and phases, as JSON.
// Off-line only: allocates; never blocks.
#pragma once

#include <string>
#include <vector>

#include "robot_model/model.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// Keys: robot, height (m, standing), yaw, joints [{name, limit}], bodies [{parent, p, R, axis}],
/// geoms [{body, shape, p, R, radius, length, half, colour}], contacts [{name, body, points,
/// radius}], obstacles [{center, half, yaw}], phases [{name}]. Lengths in m, R as w x y z.
/// @param phases names by index; empty where the plan is not known
[[nodiscard]] std::string scene_json(const RobotModel& model, const Scenario& scenario,
                                     const std::vector<std::string>& phases);

}  // namespace clamber
