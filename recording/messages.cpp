#include "recording/messages.hpp"

#include <algorithm>
#include <type_traits>

#include "recording/frame_fields.hpp"

namespace clamber {
namespace {

constexpr const char* kSeparator =
    "================================================================================\n";

constexpr const char* kTime = "int32 sec\nuint32 nanosec\n";
constexpr const char* kHeader = "builtin_interfaces/Time stamp\nstring frame_id\n";

std::string dependency(const std::string& name, const std::string& text) {
  return kSeparator + ("MSG: " + name + '\n') + text;
}

std::string with_header(const std::string& text) {
  return text + dependency("std_msgs/Header", kHeader) +
         dependency("builtin_interfaces/Time", kTime);
}

void encode_stamp(std::uint64_t time, CdrWriter& out) {
  constexpr std::uint64_t kSecond = 1'000'000'000;
  out.number(static_cast<std::int32_t>(time / kSecond));
  out.number(static_cast<std::uint32_t>(time % kSecond));
}

template <std::size_t N>
constexpr const char* kArrayType = nullptr;
template <>
constexpr const char* kArrayType<3> = "float64[3]";
template <>
constexpr const char* kArrayType<4> = "float64[4]";
template <>
constexpr const char* kArrayType<kMaxJoints> = "float64[]";
template <>
constexpr const char* kArrayType<kMaxContacts> = "float64[]";

const char* type_of(std::uint64_t /*tag*/) { return "uint64"; }
const char* type_of(std::uint32_t /*tag*/) { return "uint32"; }
const char* type_of(double /*tag*/) { return "float64"; }
template <std::size_t N>
const char* type_of(const std::array<double, N>& /*tag*/) {
  return kArrayType<N>;
}

/// How many entries of the array the frame uses.
std::size_t used(const TelemetryFrame& frame, const PerJoint& /*tag*/) {
  return std::min<std::size_t>(frame.joint_count, kMaxJoints);
}
std::size_t used(const TelemetryFrame& frame, const PerContact& /*tag*/) {
  return std::min<std::size_t>(frame.contact_count, kMaxContacts);
}

template <typename Array>
constexpr bool kIsSequence = std::is_same_v<Array, PerJoint> || std::is_same_v<Array, PerContact>;

}  // namespace

McapSchema tick_schema() {
  std::string text;
  const TelemetryFrame frame;
  visit_fields(frame, [&](const FieldText& field, const auto& member) {
    text += type_of(member) + (' ' + std::string(field.name)) + "  # ";
    if (*field.unit != '\0') text += std::string(field.unit) + ", ";
    text += field.meaning + std::string("\n");
  });
  return {.name = "clamber/msg/Tick", .encoding = "ros2msg", .text = text};
}

void encode_tick(const TelemetryFrame& frame, CdrWriter& out) {
  out.start();
  visit_fields(frame, [&](const FieldText& /*field*/, const auto& member) {
    using Member = std::decay_t<decltype(member)>;
    if constexpr (std::is_arithmetic_v<Member>) {
      out.number(member);
    } else if constexpr (kIsSequence<Member>) {
      out.sequence(std::span(member).first(used(frame, member)));
    } else {
      out.fixed(member);
    }
  });
}

bool decode_tick(std::string_view bytes, TelemetryFrame& frame) {
  frame = {};
  CdrReader in(bytes);
  visit_fields(frame, [&](const FieldText& /*field*/, auto& member) {
    using Member = std::decay_t<decltype(member)>;
    if constexpr (std::is_arithmetic_v<Member>) {
      member = in.number<Member>();
    } else if constexpr (std::is_same_v<Member, PerJoint>) {
      frame.joint_count = in.sequence(member);
    } else if constexpr (std::is_same_v<Member, PerContact>) {
      frame.contact_count = in.sequence(member);
    } else {
      in.fixed(member);
    }
  });
  return in.ok();
}

McapSchema description_schema() {
  return {.name = "clamber/msg/Description",
          .encoding = "ros2msg",
          .text =
              "string robot\nstring[] joint_names\n"
              "float64[] torque_limit  # N m, magnitude; none when unknown\n"
              "string[] contact_names\n"};
}

void encode_description(const RunDescription& run, CdrWriter& out) {
  out.start();
  out.text(run.robot);
  out.text_sequence(run.telemetry.joint_names);
  out.sequence(run.telemetry.torque_limits);
  out.text_sequence(run.telemetry.contact_names);
}

bool decode_description(std::string_view bytes, RunDescription& run) {
  CdrReader in(bytes);
  run.robot = in.text();
  const auto names = [&](std::size_t most) {
    std::vector<std::string> list;
    const auto size = in.number<std::uint32_t>();
    for (std::uint32_t i = 0; i < size && list.size() < most && in.ok(); ++i)
      list.push_back(in.text());
    return list;
  };
  run.telemetry.joint_names = names(kMaxJoints);
  PerJoint limits{};
  const std::uint32_t count = in.sequence(limits);
  run.telemetry.torque_limits.assign(limits.begin(), limits.begin() + count);
  run.telemetry.contact_names = names(kMaxContacts);
  return in.ok();
}

McapSchema joint_state_schema() {
  return {.name = "sensor_msgs/msg/JointState",
          .encoding = "ros2msg",
          .text = with_header("std_msgs/Header header\nstring[] name\nfloat64[] position\n"
                              "float64[] velocity\nfloat64[] effort\n")};
}

void encode_joint_state(const TelemetryFrame& frame, std::uint64_t time, const RunDescription& run,
                        CdrWriter& out) {
  out.start();
  encode_stamp(time, out);
  out.text("");
  out.text_sequence(run.telemetry.joint_names);
  const std::size_t joints = used(frame, frame.q);
  out.sequence(std::span(frame.q).first(joints));
  out.sequence(std::span(frame.dq).first(joints));
  out.sequence(std::span(frame.tau_meas).first(joints));
}

McapSchema tf_schema() {
  return {
      .name = "tf2_msgs/msg/TFMessage",
      .encoding = "ros2msg",
      .text = with_header(
          "geometry_msgs/TransformStamped[] transforms\n" +
          dependency("geometry_msgs/TransformStamped",
                     "std_msgs/Header header\nstring child_frame_id\n"
                     "geometry_msgs/Transform transform\n") +
          dependency("geometry_msgs/Transform",
                     "geometry_msgs/Vector3 translation\n"
                     "geometry_msgs/Quaternion rotation\n") +
          dependency("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n") +
          dependency("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"))};
}

void encode_tf(const RobotModel& model, const RobotData& data, std::uint64_t time, CdrWriter& out) {
  out.start();
  out.number(static_cast<std::uint32_t>(model.bodies.size()));
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    encode_stamp(time, out);
    out.text("world");
    out.text(model.bodies[b].name);
    out.fixed(std::span(data.X_WB[b].p.data(), 3));
    const Eigen::Quaterniond rotation(data.X_WB[b].R);
    out.fixed(std::span(rotation.coeffs().data(), 4));  // x y z w, as in ROS
  }
}

}  // namespace clamber
