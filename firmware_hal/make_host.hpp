// The host of one bus of a map. Start-up only: allocates.
#pragma once

#include <memory>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/codec/bus_host.hpp"

namespace clamber {

/// A host with all drives of the bus, goal kOff. `bus` is one of `map`'s. @throws InputError when
/// the bus has more than kMaxDrives drives
[[nodiscard]] std::unique_ptr<BusHost> make_host(const BusMap& map, const Bus& bus);

}  // namespace clamber
