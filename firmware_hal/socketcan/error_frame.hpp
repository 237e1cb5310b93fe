// What a CAN controller reports about its bus: SocketCAN's error frames, read into a port's state.
// Any thread; allocates: never; blocks: never. Layout: Linux, include/uapi/linux/can/error.h.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware_hal/frame_port.hpp"

namespace clamber {

struct ErrorReport {
  std::optional<PortState> state;  ///< what it says about the state, if anything
  bool restarted = false;          ///< back from bus-off
  bool overflow = false;           ///< the controller lost a reception
  bool not_acknowledged = false;   ///< nobody else is on the bus, or its wire is open
};

/// @param classes the error classes: the frame's id without its flags
[[nodiscard]] ErrorReport read_error_frame(std::uint32_t classes,
                                           const std::array<std::uint8_t, 8>& data) noexcept;

}  // namespace clamber
