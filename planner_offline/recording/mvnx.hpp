// Xsens MVNX, versions 3 and 4 (MVN user manual MV0319P rev. N, 14.4).
// Start-up only: allocates, never blocks, throws InputError.
#pragma once

#include <string>
#include <string_view>

#include "planner_offline/recording/human_motion.hpp"

namespace clamber {

/// Reads a whole MVNX document. Segments and joints are found by label and connector, frames by
/// type; orientations come out in the anatomical frames of HumanMotion (version 4: through the
/// file's own tpose and tpose-isb frames).
/// @param source name used in messages
/// @throws InputError (file, line, what was expected): damaged XML, version 1 or 2 or unknown,
///         wrong counts, numbers that are not finite, quaternions that are not unit
[[nodiscard]] HumanMotion parse_mvnx(std::string_view bytes, const std::string& source);

}  // namespace clamber
