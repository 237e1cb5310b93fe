// Finds shipped configuration files wherever the command is started.
// Start-up only: allocates, looks at the file system.
#pragma once

#include <filesystem>
#include <string>

namespace clamber {

/// The folder `configs`: $CLAMBER_CONFIGS, else the one of the slot or package that the program
/// lies in, else of the tree that it was built from, else ./configs.
[[nodiscard]] std::filesystem::path configs_folder();

/// `name` if it exists; else, if it begins with "configs/", the file of that name in
/// configs_folder(); else `name`, for its reader to complain about.
[[nodiscard]] std::filesystem::path find_file(const std::string& name);

/// find_file() for a robot: its folder stands for the robot.yaml in it.
[[nodiscard]] std::filesystem::path find_robot(const std::string& name);

}  // namespace clamber
