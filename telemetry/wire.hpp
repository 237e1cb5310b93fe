// Between our frames and the DDS types of idl/. Inside this room only.
// Any thread; allocates: only where a DDS type holds sequences; blocks: never.
#pragma once

#include "clamber_telemetry.h"
#include "ros2_joint_state.h"
#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

inline constexpr int kMaxBatch = static_cast<int>(msg::dds_::MAX_BATCH);
static_assert(kMaxJoints == msg::dds_::MAX_JOINTS && kMaxContacts == msg::dds_::MAX_CONTACTS);

/// Joint and force arrays become single precision: 1e-6 N m, and half the datagram.
void to_wire(const TelemetryFrame& frame, msg::dds_::Frame_& wire) noexcept;
/// Counts beyond our arrays, which only a foreign writer can send, are cut to fit.
[[nodiscard]] TelemetryFrame from_wire(const msg::dds_::Frame_& wire) noexcept;

[[nodiscard]] msg::dds_::Description_ to_wire(const std::string& robot,
                                              const TelemetryDescription& description);
/// Names and limits beyond our arrays are left out.
[[nodiscard]] TelemetryDescription from_wire(const msg::dds_::Description_& wire);

/// Positions, velocities and measured torques; `state.name` says how many joints there are.
/// @param nanoseconds stamp, since 1970
void to_joint_state(const TelemetryFrame& frame, std::int64_t nanoseconds,
                    sensor_msgs::msg::dds_::JointState_& state);

}  // namespace clamber
