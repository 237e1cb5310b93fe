// The events of one run, as a subscriber gets them.
// One thread at a time; allocates; blocks: never.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "telemetry/event.hpp"

namespace clamber {

/// A publisher that was started again sends its last events again, and the run after this one
/// counts them from 0 as well: what tells runs apart is when their first tick was.
class EventHistory {
 public:
  static constexpr std::size_t kKept = 256;

  /// An event of another run replaces all that is kept.
  /// @param start of the event's run, ns since 1970
  /// @return it is news
  bool add(const TelemetryEvent& event, std::int64_t start);

  /// The last ones, oldest first.
  [[nodiscard]] const std::deque<TelemetryEvent>& events() const noexcept { return events_; }
  /// Of the run that they are of, ns since 1970; 0: none came yet.
  [[nodiscard]] std::int64_t start() const noexcept { return start_; }

 private:
  std::int64_t start_ = 0;
  std::deque<TelemetryEvent> events_;
};

}  // namespace clamber
