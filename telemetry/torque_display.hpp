// What `clamber monitor` shows of a TorqueWatch, as text.
// Any thread; allocates; blocks: never.
#pragma once

#include <string>

#include "telemetry/torque_watch.hpp"

namespace clamber {

/// One line without its end: clocks, counts and the three joints with the least margin.
[[nodiscard]] std::string plain_line(const TorqueWatch& watch, std::uint32_t ring_drops);

/// A screenful of bars for an ANSI terminal, drawn over the one before.
/// @param rows lines of the terminal; the joints with the largest margin go when they do not fit
[[nodiscard]] std::string dashboard(const TorqueWatch& watch, std::uint32_t ring_drops, int rows);

}  // namespace clamber
