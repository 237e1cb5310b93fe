// What the browser draws a run with: the robot's shapes and joints, and obstacles, as JSON.
// Off-line only: allocates; never blocks.
#pragma once

#include <string>

#include "robot_model/model.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// Keys: robot, height (m, standing), yaw, joints [{name, limit}], bodies [{parent, p, R, axis}],
/// geoms [{body, shape, p, R, radius, length, half, colour}], contacts [{name, body, points,
/// radius}], obstacles [{center, half, yaw}]. Lengths in m, R as w x y z.
[[nodiscard]] std::string scene_json(const RobotModel& model, const Scenario& scenario);

}  // namespace clamber
