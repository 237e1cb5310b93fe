#include "apps/run_events.hpp"

#include <charconv>
#include <utility>

#include "control/supervisor.hpp"
#include "telemetry/event_names.hpp"

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

TelemetryEvent mode_event(const TelemetryFrame& frame,
                          std::optional<std::uint32_t> before) noexcept {
  TelemetryEvent event = event_at(frame, EventKind::kMode, Severity::kInfo);
  if (before) {
    event.append(to_string(static_cast<Mode>(*before)));
    event.append(" -> ");
  }
  event.append(to_string(static_cast<Mode>(frame.mode)));
  return event;
}

TelemetryEvent fault_event(const TelemetryFrame& frame) noexcept {
  const bool stands = frame.fault != 0;
  TelemetryEvent event =
      event_at(frame, EventKind::kFault, stands ? Severity::kError : Severity::kInfo);
  if (frame.fault_joint < kMaxJoints) event.joint = static_cast<std::int32_t>(frame.fault_joint);
  event.append(stands ? to_string(static_cast<FaultCode>(frame.fault)) : "acknowledged");
  return event;
}

TelemetryEvent phase_event(const TelemetryFrame& frame) noexcept {
  TelemetryEvent event = event_at(frame, EventKind::kPhase, Severity::kInfo);
  event.append("phase ");
  append_number(event, frame.phase);
  return event;
}

}  // namespace

TelemetryEvent plan_event(std::string_view sha256) noexcept {
  TelemetryEvent event;
  event.kind = EventKind::kPlan;
  event.append("plan ");
  event.append(sha256);
  return event;
}

std::span<const TelemetryEvent> RunEvents::after_tick(const TelemetryFrame& frame) noexcept {
  std::size_t count = 0;
  // The fault first: it is why the mode changes.
  if (frame.fault != fault_) events_[count++] = fault_event(frame);
  if (frame.mode != mode_) events_[count++] = mode_event(frame, mode_);
  if (frame.phase != phase_) events_[count++] = phase_event(frame);
  mode_ = frame.mode;
  fault_ = frame.fault;
  phase_ = frame.phase;
  return std::span(events_).first(count);
}

LoggedEvents::LoggedEvents(TelemetryDescription description)
    : description_(std::move(description)) {}

void LoggedEvents::after_tick(const TelemetryFrame& frame, const Take& take) {
  const auto tell = [&](TelemetryEvent event) {
    event.sequence = told_++;
    name_phase(event, description_);
    take(event);
  };
  if (told_ == 0) tell(plan_event(description_.plan));
  for (const TelemetryEvent& event : changes_.after_tick(frame)) tell(event);
}

}  // namespace clamber
