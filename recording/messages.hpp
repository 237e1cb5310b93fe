// ROS 2 messages of a recording: their schemas and bytes. Inside this room only.
// Any thread; allocates; blocks: never.
#pragma once

#include <string>
#include <string_view>

#include "recording/cdr.hpp"
#include "recording/mcap_writer.hpp"
#include "recording/run_description.hpp"
#include "robot_model/kinematics.hpp"
#include "telemetry/event.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

/// One frame: clamber/msg/Tick. Not the batches of the DDS topic: viewers want every tick at its
/// own time, in full precision, and no unused entries.
[[nodiscard]] McapSchema tick_schema();
void encode_tick(const TelemetryFrame& frame, CdrWriter& out);
/// False when the bytes are no such message.
[[nodiscard]] bool decode_tick(std::string_view bytes, TelemetryFrame& frame);

/// Names, limits and phases: clamber/msg/Description.
[[nodiscard]] McapSchema description_schema();
void encode_description(const RunDescription& run, CdrWriter& out);
[[nodiscard]] bool decode_description(std::string_view bytes, RunDescription& run);

/// What happens once in a while: clamber/msg/Event. @param time ns, its stamp
[[nodiscard]] McapSchema event_schema();
void encode_event(const TelemetryEvent& event, std::uint64_t time, CdrWriter& out);
[[nodiscard]] bool decode_event(std::string_view bytes, TelemetryEvent& event);

/// std_msgs/msg/String, for the URDF on the topic that ROS 2's tools expect it on.
inline constexpr const char* kUrdfTopic = "/robot_description";
[[nodiscard]] McapSchema string_schema();
void encode_string(std::string_view text, CdrWriter& out);
[[nodiscard]] bool decode_string(std::string_view bytes, std::string& text);

/// sensor_msgs/msg/JointState. @param time ns
[[nodiscard]] McapSchema joint_state_schema();
void encode_joint_state(const TelemetryFrame& frame, std::uint64_t time, const RunDescription& run,
                        CdrWriter& out);

/// tf2_msgs/msg/TFMessage: every body in the frame "world". @param time ns
[[nodiscard]] McapSchema tf_schema();
void encode_tf(const RobotModel& model, const RobotData& data, std::uint64_t time, CdrWriter& out);

}  // namespace clamber
