// What the control thread tells the controller about the motor buses and itself, once per tick.
#pragma once

#include <cstdint>

namespace clamber {

struct BusHealth {
  bool down = false;                ///< commands cannot reach the drives
  std::uint32_t skipped_ticks = 0;  ///< grid points without a tick since the last one
};

}  // namespace clamber
