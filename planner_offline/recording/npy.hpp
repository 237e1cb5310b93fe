// World joint positions as a NumPy array (.npy) of shape (frames, 53, 3).
// Start-up only: allocates, never blocks, throws InputError.
#pragma once

#include <string>
#include <string_view>

#include "planner_offline/recording/human_motion.hpp"

namespace clamber {

/// Such a file has neither labels nor a rate: the 53 joints stand in the order that
/// npy_joint_labels() lists, and the frame rate comes from the caller.
inline constexpr double kDefaultNpyRate = 120.0;  ///< Hz

/// Reads '<f4' or '<f8', C order, header versions 1 to 3; points only (see add_segments()).
/// @throws InputError (file, byte offset, what was expected)
[[nodiscard]] HumanMotion parse_npy(std::string_view bytes, const std::string& source,
                                    double rate = kDefaultNpyRate);

/// Labels of the 53 joints; finger joints are LeftFinger1 ... RightFinger15.
[[nodiscard]] const std::vector<std::string>& npy_joint_labels();

}  // namespace clamber
