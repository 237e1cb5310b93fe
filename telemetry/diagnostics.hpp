// rt/diagnostics, what ROS 2's diagnostic tools show: loop, buses, torques, telemetry itself.
// Any thread; allocates; blocks: never. Inside this room only.
#pragma once

#include <cstdint>
#include <string>

#include "clamber_telemetry.h"
#include "ros2_messages.h"
#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct DiagnosticInputs {
  const TelemetryDescription& description;
  const TelemetryFrame& frame;  ///< the last one
  const msg::dds_::Timing_& timing;
  const msg::dds_::BusHealth_& bus;
  const msg::dds_::TorqueMargins_& torques;
};

/// @param nanoseconds stamp, since 1970
[[nodiscard]] diagnostic_msgs::msg::dds_::DiagnosticArray_ diagnose(const std::string& robot,
                                                                    const DiagnosticInputs& inputs,
                                                                    std::int64_t nanoseconds);

}  // namespace clamber
