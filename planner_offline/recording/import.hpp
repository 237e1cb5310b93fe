// From a recording file to the human motion of its climb: the door to this folder.
// Start-up only: allocates, reads files, throws InputError.
#pragma once

#include <filesystem>
#include <optional>

#include "planner_offline/recording/climb_window.hpp"
#include "planner_offline/recording/human_motion.hpp"

namespace clamber {

struct ImportOptions {
  /// Hz, for formats that do not carry it (.npy, .amc); both default to 120 Hz.
  std::optional<double> rate;
  /// Skeleton of an .amc file; nothing: <name>.asf, then <part before the last _>.asf beside it.
  std::optional<std::filesystem::path> skeleton;
  WindowOptions window;
};

/// Recognises the format by content (MVNX, NumPy array, labelled CSV, Acclaim AMC), reads it,
/// gives position-only recordings their segment orientations and cuts out the climb.
/// @throws InputError naming file, line or byte, and what was expected
[[nodiscard]] HumanMotion import_recording(const std::filesystem::path& file,
                                           const ImportOptions& options = {});

/// The same without cutting: all frames; floor, heading and hip height of the climb are filled in.
[[nodiscard]] HumanMotion import_whole_recording(const std::filesystem::path& file,
                                                 const ImportOptions& options = {});

}  // namespace clamber
