// World joint positions as text: labelled columns and a time column.
// Start-up only: allocates, never blocks, throws InputError.
#pragma once

#include <string>
#include <string_view>

#include "planner_offline/recording/human_motion.hpp"

namespace clamber {

/// First line that is no comment (#): column names: t (s) and <joint>_x, <joint>_y, <joint>_z (m)
/// in any order. Rows are evenly spaced in time; the rate follows from t. A comment containing
/// the word SYNTHETIC marks a made-up motion. Points only (see add_segments()).
/// @throws InputError (file, line, what was expected)
[[nodiscard]] HumanMotion parse_csv(std::string_view bytes, const std::string& source);

}  // namespace clamber
