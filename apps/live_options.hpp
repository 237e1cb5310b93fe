// Options of the commands that listen to a run over DDS and draw its robot.
// Start-up only: allocates, throws InputError.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/options.hpp"
#include "recording/run_description.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct LiveOptions {
  std::string name = "coman";
  std::optional<int> domain;
  std::vector<std::string> interfaces;
  RobotOptions robot;
  ScenarioOptions scenario;
};
void add_live_options(CLI::App& command, LiveOptions& options);
/// What the options and the environment say. @throws InputError
[[nodiscard]] TelemetryConfig telemetry_config(const LiveOptions& options);
/// The joints and contacts published are those of the robot whose shapes are drawn.
[[nodiscard]] bool is_of(const TelemetryDescription& published, const RobotModel& model);

}  // namespace clamber
