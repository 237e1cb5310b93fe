// What a run shows of itself to those who watch it from another thread: does it live, and is it
// well? Written by the thread of the tick, read by any. Allocates: never; blocks: never.
#pragma once

#include <atomic>
#include <cstdint>

namespace clamber {

/// Ticks after which a joint's state counts as stale here.
inline constexpr std::uint32_t kStaleAge = 10;

struct RunPulse {
  std::atomic<std::uint64_t> beats{0};  ///< ticks, and looks for the operator while drives are off
  std::atomic<std::uint64_t> overruns{0};      ///< late ones of those, where the clock paces them
  std::atomic<std::uint32_t> stale_joints{0};  ///< in the last tick
  std::atomic<bool> torque{false};             ///< the drives have any
  std::atomic<bool> fault{false};              ///< the supervisor knows of one and deals with it
  std::atomic<bool> switching{false};          ///< drives on or off, which takes some seconds
  std::atomic<bool> over{false};               ///< the drives are off for good; logs are written
};

}  // namespace clamber
