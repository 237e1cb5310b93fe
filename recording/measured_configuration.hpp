// Where the robot is, as a frame measured it.
// Any thread; allocates: never; blocks: never.
#pragma once

#include "robot_model/types.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

/// The frame's measured configuration; the base is identity when the frame carries no truth.
[[nodiscard]] Configuration measured_configuration(const TelemetryFrame& frame);

}  // namespace clamber
