// Names for what the control thread, which carries none, tells by its number.
// Any thread; allocates: never; blocks: never.
#pragma once

#include "telemetry/event.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

/// "phase 3" becomes "phase 3: swing Lknee" where the description names it.
inline void name_phase(TelemetryEvent& event, const TelemetryDescription& description) noexcept {
  const std::string_view name = description.phase_name(event.phase);
  if (event.kind != EventKind::kPhase || name.empty()) return;
  event.append(": ");
  event.append(name);
}

}  // namespace clamber
