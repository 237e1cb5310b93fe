// A robot motion as a table that people and other tools can read (motion.csv).
// Start-up only: allocates, reads and writes files, throws InputError.
//
// Lines that begin with # carry what is not a table: format, recording, rate, what was clamped.
// Then one line of column names and one line per frame:
//   base_x base_y base_z (m) base_qw base_qx base_qy base_qz, the joints by name (rad)
#pragma once

#include <filesystem>
#include <string>

#include "planner_offline/motion.hpp"
#include "robot_model/model.hpp"

namespace clamber {

[[nodiscard]] std::string format_motion(const RobotMotion& motion, const RobotModel& model);
/// Joint columns are found by name; `file` only names the text in errors.
/// @throws InputError naming file, line and what was expected
[[nodiscard]] RobotMotion parse_motion(const std::string& text, const std::string& file,
                                       const RobotModel& model);

/// True when the text begins as format_motion()'s does.
[[nodiscard]] bool is_motion(const std::string& text);

}  // namespace clamber
