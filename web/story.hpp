// What the page tells of a run beside its rows: names of phases, modes and faults, and events.
// Any thread; allocates; blocks: never.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <utility>

#include "telemetry/event.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

/// JSON: {phases: [name], modes: [name], faults: [name], events: [{time, kind, severity, joint,
/// text}]}. Kinds and severities are the numbers of event.hpp; joint -1: none.
[[nodiscard]] std::string story_json(const TelemetryDescription& names,
                                     const std::deque<TelemetryEvent>& events);

/// The story of a live run, which browsers are told again, whole, whenever it changes: it is short.
class LiveStory {
 public:
  void tell(std::string json) {
    const std::lock_guard lock(mutex_);
    json_ = std::move(json);
    ++version_;
  }
  /// "" when nothing is new since `version`, which is brought up to date.
  [[nodiscard]] std::string news(std::uint64_t& version) const {
    const std::lock_guard lock(mutex_);
    return std::exchange(version, version_) == version_ ? std::string() : json_;
  }

 private:
  mutable std::mutex mutex_;
  std::string json_;
  std::uint64_t version_ = 0;
};

}  // namespace clamber
