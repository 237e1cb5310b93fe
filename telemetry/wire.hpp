// Between our data and the DDS types of idl/. Inside this room only.
// Any thread; allocates: only where a DDS type holds sequences; blocks: never.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <type_traits>

#include "clamber_telemetry.h"
#include "ros2_messages.h"
#include "telemetry/event.hpp"
#include "telemetry/frame.hpp"
#include "telemetry/port.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {

inline constexpr int kMaxBatch = 10;
static_assert(std::tuple_size_v<std::decay_t<decltype(msg::dds_::Batch_().frames())>> == kMaxBatch);
static_assert(std::tuple_size_v<std::decay_t<decltype(msg::dds_::Frame_().q())>> == kMaxJoints);
static_assert(std::tuple_size_v<std::decay_t<decltype(msg::dds_::Frame_().force_floor())>> ==
              kMaxContacts);

/// Joint and force arrays become single precision: 1e-6 N m, and half the datagram.
/// @param planned_contacts one bit per contact that the frame's phase wants to carry
void to_wire(const TelemetryRecord& record, std::uint32_t planned_contacts,
             msg::dds_::Frame_& wire) noexcept;
/// Counts beyond our arrays, which only a foreign writer can send, are cut to fit.
[[nodiscard]] TelemetryFrame from_wire(const msg::dds_::Frame_& wire) noexcept;

[[nodiscard]] msg::dds_::Description_ to_wire(const std::string& robot,
                                              const TelemetryDescription& description);
/// Names and limits beyond our arrays are left out.
[[nodiscard]] TelemetryDescription from_wire(const msg::dds_::Description_& wire);

/// @param nanoseconds stamp, since 1970
[[nodiscard]] msg::dds_::Event_ to_wire(const TelemetryEvent& event, std::int64_t nanoseconds);
[[nodiscard]] TelemetryEvent from_wire(const msg::dds_::Event_& wire);
/// When the event's run had its first tick, ns since 1970.
[[nodiscard]] std::int64_t run_start(const msg::dds_::Event_& wire) noexcept;

/// Simulation truth of a frame, apart. The caller numbers it.
void to_contacts(const TelemetryFrame& frame, std::uint32_t planned_contacts,
                 msg::dds_::Contacts_& wire) noexcept;

[[nodiscard]] builtin_interfaces::msg::dds_::Time_ to_stamp(std::int64_t nanoseconds);

/// Positions, velocities and measured torques; `state.name` says how many joints there are.
/// @param nanoseconds stamp, since 1970
void to_joint_state(const TelemetryFrame& frame, std::int64_t nanoseconds,
                    sensor_msgs::msg::dds_::JointState_& state);

}  // namespace clamber
