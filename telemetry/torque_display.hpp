// What `clamber monitor` shows, as text.
// Any thread; allocates; blocks: never.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "telemetry/event.hpp"
#include "telemetry/torque_watch.hpp"

namespace clamber {

/// The last samples of the topics timing and bus.
struct LoopFigures {
  bool paced = false;  ///< by the clock; else there are no times
  // us
  double wakeup_p99 = 0.0, wakeup_max = 0.0;
  double tick_p99 = 0.0, tick_max = 0.0;
  // Since the start.
  std::uint64_t overruns = 0, skipped = 0, gaps = 0, refused = 0, event_drops = 0;
  std::uint64_t restarts = 0, hangs = 0;  ///< of the publisher; hangs are among its restarts
  std::uint64_t missing_replies = 0;
  bool bus_down = false;
};

struct MonitorView {
  const TorqueWatch& torques;
  std::uint64_t ring_drops = 0;
  std::optional<LoopFigures> loop = {};    ///< unknown before the first sample
  std::deque<TelemetryEvent> events = {};  ///< the last ones, oldest first
};

/// "mode executing  phase 3 'swing Lknee'  fault none"
[[nodiscard]] std::string state_text(const TorqueWatch& watch);
/// "12.345 s  error  fault tracking error at LElbj"
[[nodiscard]] std::string event_text(const TelemetryEvent& event,
                                     const TelemetryDescription& description);

/// One line without its end: clocks, state, counts and the three joints with the least margin.
[[nodiscard]] std::string plain_line(const MonitorView& view);

/// A screenful of bars for an ANSI terminal, drawn over the one before.
/// @param rows lines of the terminal; the joints with the largest margin go when they do not fit
[[nodiscard]] std::string dashboard(const MonitorView& view, int rows);

}  // namespace clamber
