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
              "string[] contact_names\n"
              "string plan  # SHA-256 of what was executed; empty when unknown\n"
              "string[] modes  # names of Tick.mode\n"
              "string[] faults  # names of Tick.fault\n"
              "clamber/Phase[] phases  # of Tick.phase\n" +
              dependency("clamber/Phase",
                         "string name\n"
                         "uint32 contacts  # one bit per contact that is to carry\n")};
}

void encode_description(const RunDescription& run, CdrWriter& out) {
  const TelemetryDescription& described = run.telemetry;
  out.start();
  out.text(run.robot);
  out.text_sequence(described.joint_names);
  out.sequence(described.torque_limits);
  out.text_sequence(described.contact_names);
  out.text(described.plan);
  out.text_sequence(described.modes);
  out.text_sequence(described.faults);
  out.number(static_cast<std::uint32_t>(described.phases.size()));
  for (const DescribedPhase& phase : described.phases) {
    out.text(phase.name);
    out.number(phase.contacts);
  }
}

bool decode_description(std::string_view bytes, RunDescription& run) {
  CdrReader in(bytes);
  TelemetryDescription& described = run.telemetry;
  run.robot = in.text();
  described.joint_names = in.text_sequence(kMaxJoints);
  PerJoint limits{};
  const std::uint32_t count = in.sequence(limits);
  described.torque_limits.assign(limits.begin(), limits.begin() + count);
  described.contact_names = in.text_sequence(kMaxContacts);
  described.plan = in.text();
  described.modes = in.text_sequence(TelemetryDescription::kMaxModes);
  described.faults = in.text_sequence(TelemetryDescription::kMaxFaults);
  const std::uint32_t phases = in.count(TelemetryDescription::kMaxPhases);
  for (std::uint32_t i = 0; i < phases && in.ok(); ++i) {
    DescribedPhase& phase = described.phases.emplace_back();
    phase.name = in.text();
    phase.contacts = in.number<std::uint32_t>();
  }
  return in.ok();
}

McapSchema event_schema() {
  // A constant before a field of its type is a name of its values to Foxglove.
  return {.name = "clamber/msg/Event",
          .encoding = "ros2msg",
          .text =
              "uint64 number  # counts the run's events: a gap is a loss\n"
              "uint64 tick\n"
              "float64 time  # s since the first tick\n"
              "builtin_interfaces/Time stamp\n"
              "uint32 MODE=0\nuint32 FAULT=1\nuint32 PHASE=2\nuint32 PLAN=3\n"
              "uint32 TELEMETRY=4\nuint32 kind\n"
              "uint32 INFO=0\nuint32 WARNING=1\nuint32 ERROR=2\nuint32 severity\n"
              "int32 joint  # index into Description.joint_names; -1: none\n"
              "uint32 phase\n"
              "string text\n" +
              dependency("builtin_interfaces/Time", kTime)};
}

void encode_event(const TelemetryEvent& event, std::uint64_t time, CdrWriter& out) {
  out.start();
  out.number(event.sequence);
  out.number(event.tick);
  out.number(event.time);
  encode_stamp(time, out);
  out.number(static_cast<std::uint32_t>(event.kind));
  out.number(static_cast<std::uint32_t>(event.severity));
  out.number(event.joint);
  out.number(event.phase);
  out.text(event.view());
}

bool decode_event(std::string_view bytes, TelemetryEvent& event) {
  event = {};
  CdrReader in(bytes);
  event.sequence = in.number<std::uint64_t>();
  event.tick = in.number<std::uint64_t>();
  event.time = in.number<double>();
  in.number<std::int32_t>();  // stamp
  in.number<std::uint32_t>();
  event.kind = static_cast<EventKind>(in.number<std::uint32_t>());
  event.severity = static_cast<Severity>(in.number<std::uint32_t>());
  event.joint = in.number<std::int32_t>();
  event.phase = in.number<std::uint32_t>();
  event.append(in.text());
  return in.ok();
}

McapSchema string_schema() {
  return {.name = "std_msgs/msg/String", .encoding = "ros2msg", .text = "string data\n"};
}

void encode_string(std::string_view text, CdrWriter& out) {
  out.start();
  out.text(text);
}

bool decode_string(std::string_view bytes, std::string& text) {
  CdrReader in(bytes);
  text = in.text();
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
      .text = with_header("geometry_msgs/TransformStamped[] transforms\n" +
                          dependency("geometry_msgs/TransformStamped",
                                     "std_msgs/Header header\nstring child_frame_id\n"
                                     "geometry_msgs/Transform transform\n") +
                          dependency("geometry_msgs/Transform",
                                     "geometry_msgs/Vector3 translation\n"
                                     "geometry_msgs/Quaternion rotation\n") +
                          dependency("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n") +
                          dependency("geometry_msgs/Quaternion",
                                     "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"))};
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
