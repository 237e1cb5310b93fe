// Peak torques of a run, from its frames.
// Any thread; allocates the result; never blocks.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report/run_data.hpp"

namespace clamber {

struct TorquePeak {
  std::string joint;
  double value = 0.0;  ///< N m, magnitude
  double time = 0.0;   ///< s, when it occurred
};

/// Largest |measured torque| of every joint, in the model's order, over frames with time >= from.
[[nodiscard]] std::vector<TorquePeak> torque_peaks(const RunData& run, double from = 0.0);

/// The largest of all joints; nothing when there is no frame.
[[nodiscard]] std::optional<TorquePeak> largest_peak(const std::vector<TorquePeak>& peaks);

/// First time at which every wrist (contact link whose name ends in "wrist") pushes the obstacle
/// with more than `threshold` N; nothing when that never happens or the frames carry no truth.
[[nodiscard]] std::optional<double> hands_carry_from(const RunData& run, double threshold = 5.0);

}  // namespace clamber
