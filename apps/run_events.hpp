// What changes from tick to tick, as telemetry's events: the supervisor's mode, faults, phases.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>

#include "telemetry/event.hpp"
#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

/// What a run begins with. Any thread; allocates: never; blocks: never.
[[nodiscard]] TelemetryEvent plan_event(std::string_view sha256) noexcept;

/// Control thread; allocates: never; blocks: never.
class RunEvents {
 public:
  /// What has changed since the frame before; of the first frame, all but the absence of a fault.
  /// Valid until the next call.
  [[nodiscard]] std::span<const TelemetryEvent> after_tick(const TelemetryFrame& frame) noexcept;

 private:
  std::uint32_t fault_ = 0;
  std::optional<std::uint32_t> mode_;
  std::optional<std::uint32_t> phase_;
  std::array<TelemetryEvent, 3> events_;
};

/// The events of a run of which only the log is left, as telemetry told them: numbered and named.
/// One thread; allocates; blocks: never.
class LoggedEvents {
 public:
  using Take = std::function<void(const TelemetryEvent&)>;

  explicit LoggedEvents(TelemetryDescription description);
  void after_tick(const TelemetryFrame& frame, const Take& take);

 private:
  TelemetryDescription description_;
  RunEvents changes_;
  std::uint64_t told_ = 0;
};

}  // namespace clamber
