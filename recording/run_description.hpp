// What belongs to a recorded run beside its frames.
// Plain data; any thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "robot_model/model.hpp"
#include "telemetry/event.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct RunDescription {
  std::string robot;               ///< name
  TelemetryDescription telemetry;  ///< names, torque limits (may be none); links are not recorded
  std::string scene;               ///< JSON of robot and obstacle for drawing, or ""
};

/// What a run has between its frames.
struct RunNotes {
  std::vector<TelemetryEvent> events;
  std::string urdf;  ///< empty: not among them
};

}  // namespace clamber
