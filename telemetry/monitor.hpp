// The body of `clamber monitor`: torques against their limits, received over DDS.
// A process of its own; allocates; blocks; throws.
#pragma once

#include <iosfwd>
#include <optional>

#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct MonitorOptions {
  TelemetryConfig telemetry;       ///< domain, interfaces and robot to listen to
  bool plain = false;              ///< a line a second instead of the dashboard
  int rows = 24;                   ///< of the terminal that shows the dashboard
  std::optional<double> duration;  ///< s after the first frame; without it, for ever
  double timeout = 10.0;           ///< s to wait for the first frame
};

/// Subscribes and prints until the duration is over.
/// @return 0 when frames came, 1 when none came within the timeout
/// @throws InputError for a configuration that check() refuses
[[nodiscard]] int run_monitor(const MonitorOptions& options, std::ostream& out);

}  // namespace clamber
