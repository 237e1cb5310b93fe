#include "apps/run_events.hpp"

#include <array>
#include <charconv>

#include "control/supervisor.hpp"

namespace clamber {
namespace {

TelemetryEvent event_at(const TelemetryFrame& frame, EventKind kind, Severity severity) noexcept {
  TelemetryEvent event;
  event.tick = frame.sequence;
  event.time = frame.time;
  event.kind = kind;
  event.severity = severity;
  event.phase = frame.phase;
  return event;
}

void append_number(TelemetryEvent& event, std::uint32_t number) noexcept {
  std::array<char, 12> digits{};
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), number);
  event.append({digits.data(), static_cast<std::size_t>(end - digits.data())});
}

}  // namespace

void RunEvents::after_tick(const TelemetryFrame& frame) noexcept {
  if (port_ == nullptr) return;
  // The fault first: it is why the mode changes.
  if (first_ ? frame.fault != 0 : frame.fault != fault_) tell_fault(frame);
  if (first_ || frame.mode != mode_) tell_mode(frame);
  if (first_ || frame.phase != phase_) tell_phase(frame);
  first_ = false;
  mode_ = frame.mode;
  fault_ = frame.fault;
  phase_ = frame.phase;
}

void RunEvents::tell_mode(const TelemetryFrame& frame) noexcept {
  TelemetryEvent event = event_at(frame, EventKind::kMode, Severity::kInfo);
  if (!first_) {
    event.append(to_string(static_cast<Mode>(mode_)));
    event.append(" -> ");
  }
  event.append(to_string(static_cast<Mode>(frame.mode)));
  (void)port_->push(event);
}

void RunEvents::tell_fault(const TelemetryFrame& frame) noexcept {
  const bool stands = frame.fault != 0;
  TelemetryEvent event =
      event_at(frame, EventKind::kFault, stands ? Severity::kError : Severity::kInfo);
  if (frame.fault_joint < kMaxJoints) event.joint = static_cast<std::int32_t>(frame.fault_joint);
  event.append(stands ? to_string(static_cast<FaultCode>(frame.fault)) : "acknowledged");
  (void)port_->push(event);
}

void RunEvents::tell_phase(const TelemetryFrame& frame) noexcept {
  TelemetryEvent event = event_at(frame, EventKind::kPhase, Severity::kInfo);
  event.append("phase ");
  append_number(event, frame.phase);
  (void)port_->push(event);
}

}  // namespace clamber
