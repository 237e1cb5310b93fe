// Between our frames and the DDS types of idl/. Inside this room only.
// Any thread; allocates: only where a DDS type holds sequences; blocks: never.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <type_traits>

#include "clamber_telemetry.h"
#include "ros2_joint_state.h"
#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

inline constexpr int kMaxBatch = 10;
static_assert(std::tuple_size_v<std::decay_t<decltype(msg::dds_::Batch_().frames())>> == kMaxBatch);
static_assert(std::tuple_size_v<std::decay_t<decltype(msg::dds_::Frame_().q())>> == kMaxJoints);
static_assert(std::tuple_size_v<std::decay_t<decltype(msg::dds_::Frame_().force_floor())>> ==
              kMaxContacts);

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
