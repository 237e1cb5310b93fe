// clamber bus scan and monitor: looking at CAN interfaces. They never switch a drive on.
// Start-up thread; each adds itself to `clamber bus`.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "firmware_hal/bus_map.hpp"

namespace clamber {

void add_bus_scan(CLI::App& bus);
void add_bus_monitor(CLI::App& bus);

/// Asks every drive of the map once, as `clamber bus scan` does: moves nothing. If somebody
/// commands the drives it only listens. @return the drives that did not answer or have an error,
/// one text each
[[nodiscard]] std::vector<std::string> survey_drives(const BusMap& map);

/// Output goes to a terminal that shows colours, and nobody objects (NO_COLOR).
[[nodiscard]] bool use_color();

}  // namespace clamber
