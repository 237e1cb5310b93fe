// Opens the interfaces of a bus map: what both sides of the buses do at start-up.
// Start-up only: allocates; throws InputError (interface_check.hpp).
#pragma once

#include <memory>
#include <vector>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/socketcan/socketcan_clock.hpp"

namespace clamber {

/// What the interface of a bus of the map must be.
[[nodiscard]] SocketCanSettings socketcan_settings(const BusMap& map, const Bus& bus);

/// One port per bus of the map, in its order, and their clock.
struct SocketCanPorts {
  std::vector<std::unique_ptr<SocketCanPort>> ports;
  std::unique_ptr<SocketCanClock> clock;
};

/// @throws InputError for the first interface that is not fit for its bus
[[nodiscard]] SocketCanPorts open_ports(const BusMap& map);

}  // namespace clamber
