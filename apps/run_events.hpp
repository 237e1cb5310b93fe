// Tells telemetry what changes from tick to tick: the supervisor's mode, faults, phases.
// Control thread; allocates: never; blocks: never.
#pragma once

#include "telemetry/port.hpp"

namespace clamber {

class RunEvents {
 public:
  /// @param port nullptr: nobody is told
  explicit RunEvents(TelemetryPort* port) noexcept : port_(port) {}

  void after_tick(const TelemetryFrame& frame) noexcept;

 private:
  void tell_mode(const TelemetryFrame& frame) noexcept;
  void tell_fault(const TelemetryFrame& frame) noexcept;
  void tell_phase(const TelemetryFrame& frame) noexcept;

  TelemetryPort* port_;
  bool first_ = true;
  std::uint32_t mode_ = 0;
  std::uint32_t fault_ = 0;
  std::uint32_t phase_ = 0;
};

}  // namespace clamber
