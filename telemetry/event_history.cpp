#include "telemetry/event_history.hpp"

namespace clamber {

bool EventHistory::add(const TelemetryEvent& event, std::int64_t start) {
  if (start != start_) events_.clear();
  start_ = start;
  if (!events_.empty() && event.sequence <= events_.back().sequence) return false;
  events_.push_back(event);
  if (events_.size() > kKept) events_.pop_front();
  return true;
}

}  // namespace clamber
