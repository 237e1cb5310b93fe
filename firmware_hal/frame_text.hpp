// Frames as lines for people: what `clamber bus decode` prints.
// Any thread; allocates: yes; blocks: never.
#pragma once

#include <string>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/can_frame.hpp"

namespace clamber {

enum class FrameKind : std::uint8_t {
  kData,       ///< commands, states, SYNC, heartbeats
  kSwitching,  ///< changes what a drive may do: enable, disable, network management, configuration
  kTrouble,    ///< drive errors, emergencies, error frames, states that are faults
  kForeign,    ///< nobody's on this bus
  kMalformed,  ///< somebody's id, but not a frame of the protocol
};

struct FrameText {
  FrameKind kind = FrameKind::kForeign;
  std::string text;
};

/// In joint units with joint names (the drive's zero and direction taken out).
[[nodiscard]] FrameText describe_frame(const Bus& bus, const CanFrame& frame);
/// CANopen without a map: node ids and raw objects.
[[nodiscard]] FrameText describe_canopen(const CanFrame& frame);

/// Kind, id and length, to stand before the text: "fd+ 42C [8]", "can 701 [1]".
[[nodiscard]] std::string frame_label(const CanFrame& frame);

}  // namespace clamber
