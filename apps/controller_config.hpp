// Reads the controller's settings (configs/control/*.yaml) for a robot.
// Start-up only: allocates, reads a file, throws InputError.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "control/controller.hpp"
#include "robot_model/model.hpp"

namespace clamber {

/// The robot's limits and gains with the file's settings over them.
/// @param robot_gains   the robot's own control.yaml, whose `gains` count for every settings file
///                      and stay below its own; empty: it has none
/// @param feed_forward  instead of the file's `feed_forward`; it decides whether the
///                      `feed_forward_gains` of both files count
/// @throws InputError naming file, line and key; also for a gain group that matches no joint
[[nodiscard]] ControllerConfig load_controller_config(
    const std::filesystem::path& file, const RobotModel& robot,
    const std::filesystem::path& robot_gains = {},
    std::optional<FeedForward> feed_forward = std::nullopt);

/// The robot's joints have the springs that its file names: references lead by their stretch.
void expect_springs(const RobotModel& robot, ControllerConfig& config);

/// True when `name` matches `pattern`, in which `*` stands for any characters.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view name);

/// The one-line message for a plan that Controller::load() refused.
[[nodiscard]] std::string describe(const LoadReport& report, const RobotModel& robot);

}  // namespace clamber
