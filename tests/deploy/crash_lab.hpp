// Runs a piece of work that dies at a chosen change to the file system: killed there, or with the
// power cut, which leaves what had been written to the disk by then and of all else as much as a
// seed says. The test program's own fsync(), rename(), ... stand in front of the C library's, so
// the work under test is the product's, unchanged.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

namespace clamber {

struct Crash {
  enum class Kind { kNone, kKill, kPowerCut };
  Kind kind = Kind::kNone;
  std::uint64_t at = 0;    ///< number of the change before which it happens, from 1
  std::uint64_t seed = 0;  ///< of a power cut; 0: nothing is left but what was written to the disk
};

enum class Outcome { kFinished, kFailed, kCrashed };

/// In a process of its own. After a power cut `root` is what the disk has.
Outcome run_with(const Crash& crash, const std::filesystem::path& root,
                 const std::function<void()>& work);

}  // namespace clamber
