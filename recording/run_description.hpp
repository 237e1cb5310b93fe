// What belongs to a recorded run beside its frames.
// Plain data; any thread.
#pragma once

#include <optional>
#include <string>

#include "robot_model/model.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct RunDescription {
  std::string robot;               ///< name
  TelemetryDescription telemetry;  ///< names of joints and contacts, torque limits (may be none)
  std::string scene;               ///< JSON of robot, obstacle and phases for drawing, or ""
};

}  // namespace clamber
