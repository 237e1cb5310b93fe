// Are the CAN links set as the bus map says? Bit rates, FD, sample points, queues, bus state.
// Start-up only: allocates; asks the kernel through `ip` (package iproute2).
#pragma once

#include <string>

#include "apps/doctor/finding.hpp"
#include "firmware_hal/bus_map.hpp"

namespace clamber {

/// A finding per bus, named can.<bus>, and one for the worst-case load.
[[nodiscard]] Findings check_buses(const BusMap& map);

/// The verdict on one bus from `ip -json -details link show`.
[[nodiscard]] Finding judge_link(const Bus& bus, const std::string& links);

/// Age of the zeros: `calibrated` of the map against `today`, both days since 1970.
[[nodiscard]] Finding check_calibration(const BusMap& map, long today);

}  // namespace clamber
