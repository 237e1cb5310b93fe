// Reads the planner's settings (configs/planner/default.yaml).
// Start-up only: allocates, reads a file, throws InputError.
#pragma once

#include <filesystem>

#include "planner_offline/settings.hpp"

namespace clamber {

/// Keys that the file leaves out keep their defaults; unknown keys are errors.
/// @throws InputError naming file, line and key
[[nodiscard]] PlannerSettings load_planner_settings(const std::filesystem::path& file);

}  // namespace clamber
