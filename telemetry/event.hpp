// What happens once in a while, as fixed-size plain data: changes of the supervisor's state,
// faults, phases, the plan, and what befalls telemetry itself. Any thread; allocates: never;
// blocks: never.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

namespace clamber {

/// Numbers of the wire (idl/clamber_telemetry.idl): add at the end only.
enum class EventKind : std::uint32_t { kMode, kFault, kPhase, kPlan, kTelemetry };
enum class Severity : std::uint32_t { kInfo, kWarning, kError };

struct TelemetryEvent {
  std::uint64_t sequence = 0;  ///< given by whoever publishes it, without gaps
  std::uint64_t tick = 0;
  double time = 0.0;  ///< s since the first tick
  EventKind kind = EventKind::kMode;
  Severity severity = Severity::kInfo;
  std::int32_t joint = -1;  ///< that it concerns; -1: none
  std::uint32_t phase = 0;
  std::array<char, 96> text{};  ///< ends with a zero

  /// Appends what there is room for.
  void append(std::string_view more) noexcept {
    for (const char c : more) {
      if (used_ + 1 >= text.size()) return;
      text[used_++] = c;
    }
  }
  /// The text, whoever wrote it.
  [[nodiscard]] std::string_view view() const noexcept {
    std::size_t length = 0;
    while (length < text.size() && text[length] != '\0') ++length;
    return {text.data(), length};
  }

 private:
  std::uint64_t used_ = 0;
};
static_assert(std::is_trivially_copyable_v<TelemetryEvent>);

}  // namespace clamber
