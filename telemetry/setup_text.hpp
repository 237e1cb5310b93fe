// What a publisher is told, as text: for a publisher in another process.
// Start-up only: allocates, throws.
#pragma once

#include <string>
#include <string_view>

#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct TelemetrySetup {
  TelemetryConfig config;
  TelemetryDescription description;
};

[[nodiscard]] std::string format_setup(const TelemetrySetup& setup);
/// @throws InputError for text that format_setup() did not write
[[nodiscard]] TelemetrySetup parse_setup(std::string_view text);

}  // namespace clamber
