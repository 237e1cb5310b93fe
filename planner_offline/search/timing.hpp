// Times a stretch of the climb: from a dense path to keyframes with smooth starts and stops.
// Any thread; allocates; never blocks.
#pragma once

#include <vector>

#include "planner_offline/search/stretch.hpp"
#include "planner_offline/settings.hpp"

namespace clamber {

struct TimedPosture {
  double time = 0.0;   ///< s from the stretch's beginning
  double share = 0.0;  ///< 0..1 of the way from the stretch's beginning to its end
  Configuration x;
};

/// Keyframes of a stretch at about `knot_spacing`, the first at time 0. Along a motion the path
/// runs at a minimum-jerk rate whose peak keeps joint and centre-of-mass speeds near the settings';
/// a load stretch rests for `load_time`.
[[nodiscard]] std::vector<TimedPosture> time_stretch(const RobotModel& model,
                                                     const Stretch& stretch,
                                                     const TimingSettings& settings);

}  // namespace clamber
