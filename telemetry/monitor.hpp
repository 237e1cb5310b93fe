// The body of `clamber monitor`: torques against their limits, received over DDS.
// A process of its own; allocates; blocks; throws.
#pragma once

#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct MonitorOptions {
  TelemetryConfig telemetry;        ///< domain, interfaces and robot to listen to
  bool plain = false;               ///< a line a second instead of the dashboard
  int rows = 24;                    ///< of the terminal that shows the dashboard
  std::optional<double> duration;   ///< s after the first frame; without it, see end_of_run
  bool end_of_run = false;          ///< end when the publisher has gone; checks imply it
  double timeout = 10.0;            ///< s to wait for the first frame
  std::vector<std::string> checks;  ///< see check.hpp
};

enum class MonitorOutcome { kFine, kNothingCame, kCheckFailed };

/// Subscribes and prints until the duration is over or the publisher has gone, then judges.
/// @throws InputError for a configuration that telemetry's check() refuses, a check that is not
///   understood or one that names a joint that the robot does not have
[[nodiscard]] MonitorOutcome run_monitor(const MonitorOptions& options, std::ostream& out);

}  // namespace clamber
