// Which part of a recording is the climb, where its floor is and which way it goes.
// Start-up only: allocates, throws InputError, never blocks.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "planner_offline/recording/human_motion.hpp"

namespace clamber {

struct WindowOptions {
  std::optional<double> start;  ///< s in the recording's clock; nothing: found
  std::optional<double> end;    ///< s; nothing: found
  std::optional<double> floor;  ///< m, height of the floor at the start; nothing: found
};

struct ClimbWindow {
  std::size_t first = 0;  ///< frames, both included
  std::size_t last = 0;
  double floor = 0.0;       ///< m
  double hip_height = 0.0;  ///< m above the floor, standing
  double heading = 0.0;     ///< yaw of the climb, rad
  std::vector<std::string> warnings;
};

/// Finds the climb in a full-body recording:
/// - hands on: first time both wrists rest for 0.3 s in front of a bent trunk, below the shoulders,
///   away from the hips by 0.3 of the hip height or more;
/// - start: in the last stretch before it in which the person stands (both feet still and on one
///   level, trunk within 25 deg of upright), half a second before the trunk begins to bend;
/// - end: the end of the first stretch after it in which both knees rest with the shanks level, off
///   the floor (the feet have not come on top yet); without such a stretch the recording's end;
/// - floor: 2 cm below the lowest toe joint between the start and hands on; heading: median over
/// the window of the
///   horizontal normal of the hip line.
/// A recording without hands-on keeps all its frames, with a warning.
/// @throws InputError when start, end or floor lie outside the recording
[[nodiscard]] ClimbWindow find_climb(const HumanMotion& motion, const WindowOptions& options);

}  // namespace clamber
