// One run as the report reads it: the robot, its world and every tick's frame.
// Off-line only: owns large vectors.
#pragma once

#include <string>
#include <vector>

#include "recording/measured_configuration.hpp"
#include "robot_model/model.hpp"
#include "sim_backend/scenario.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

/// Joint and contact names are model.joints and model.contacts, in the order of the frames' arrays.
struct RunData {
  std::string label;  ///< e.g. "climb", "playback"
  RobotModel model;
  Scenario scenario;
  std::vector<TelemetryFrame> frames;  ///< in time order, usually 1 kHz
};

/// Indices of `count` frames, the first and the last among them, spaced by how far the robot moves
/// (joints and base), not by the clock: a sequence of pictures then skips the pauses.
[[nodiscard]] std::vector<std::size_t> pick_moments(const std::vector<TelemetryFrame>& frames,
                                                    int count);

}  // namespace clamber
