// clamber bus scan and monitor: looking at CAN interfaces. They never switch a drive on.
// Start-up thread; each adds itself to `clamber bus`.
#pragma once

#include <CLI/CLI.hpp>

namespace clamber {

void add_bus_scan(CLI::App& bus);
void add_bus_monitor(CLI::App& bus);

/// Output goes to a terminal that shows colours, and nobody objects (NO_COLOR).
[[nodiscard]] bool use_color();

}  // namespace clamber
