// How the loop of a paced run kept its time, for people and for programs.
// Any thread, after the run; allocates.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "apps/executor.hpp"

namespace clamber {

/// Late ticks, percentiles, guards and what the system did not grant, as lines for the terminal;
/// empty for a run that was not paced.
[[nodiscard]] std::string describe_timing(const ExecutorReport& report);

/// Status, ticks, timing in seconds, guards.
[[nodiscard]] nlohmann::ordered_json to_json(const ExecutorReport& report);

}  // namespace clamber
