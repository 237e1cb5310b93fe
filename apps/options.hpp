// Options that several subcommands share, and loading what they name.
// Start-up only: allocates, reads files, throws InputError.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "apps/motion_file.hpp"
#include "control/controller.hpp"
#include "planner_offline/motion.hpp"
#include "robot_model/model.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

struct RobotOptions {
  std::string robot = "configs/robots/coman";
  bool ballast = false;
};
void add_robot_options(CLI::App& command, RobotOptions& options);
[[nodiscard]] RobotModel load_robot(const RobotOptions& options);
/// The controller's settings for that robot, with the gains of the control.yaml beside its
/// robot.yaml where there is one.
[[nodiscard]] ControllerConfig load_control(const std::string& settings,
                                            const RobotOptions& options, const RobotModel& robot,
                                            std::optional<FeedForward> feed_forward = {});

struct ScenarioOptions {
  std::string scenario = "configs/scenarios/box_0.275.yaml";
  std::optional<double> height;
  std::optional<Goal> goal;
};
void add_scenario_options(CLI::App& command, ScenarioOptions& options);
[[nodiscard]] Scenario load_scenario(const ScenarioOptions& options);

/// How to read a recording.
struct RecordingOptions {
  std::optional<double> rate;
  std::optional<std::string> skeleton;
  std::optional<double> start;
  std::optional<double> end;
};
void add_recording_options(CLI::App& command, RecordingOptions& options);

/// A motion and its text. The motion is what the text says, to the bit (a rotation does not come
/// back from a quaternion unchanged), so that a step started from motion.csv gives the same as a
/// step started from the recording.
struct LoadedMotion {
  std::string text;
  RobotMotion motion;
};
/// Imports the recording and maps it to the robot; reads a motion file as it is.
[[nodiscard]] LoadedMotion load_motion(const std::string& file, const RecordingOptions& recording,
                                       const RobotOptions& robot, const RobotModel& model);

/// Writes a text file, its folder made if missing. @throws InputError
void write_text(const std::string& file, const std::string& text);
void make_folder_of(const std::string& file);

}  // namespace clamber
