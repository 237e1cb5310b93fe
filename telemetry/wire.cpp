#include "telemetry/wire.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

template <typename From, typename To, std::size_t N>
void copy(const std::array<From, N>& from, std::array<To, N>& to) noexcept {
  std::transform(from.begin(), from.end(), to.begin(), [](From x) { return static_cast<To>(x); });
}

constexpr double kCarries = 1.0;                 // N
constexpr std::int64_t kSecond = 1'000'000'000;  // ns

float microseconds(std::int64_t ns) noexcept {
  return static_cast<float>(1e-3 * static_cast<double>(ns));
}

std::int32_t joint_or_none(std::uint32_t joint) noexcept {
  return joint < kMaxJoints ? static_cast<std::int32_t>(joint) : -1;
}

/// Beyond what fits, the largest that does.
std::uint16_t to_ticks(double age) noexcept {
  return static_cast<std::uint16_t>(std::clamp(age, 0.0, 65535.0));
}

template <typename Wire>
void copy_forces(const TelemetryFrame& frame, Wire& wire) noexcept {
  copy(frame.force_obstacle, wire.force_obstacle());
  copy(frame.force_floor, wire.force_floor());
  wire.force_forbidden(static_cast<float>(frame.force_forbidden));
  wire.force_other(static_cast<float>(frame.force_other));
}

template <typename Names>
std::vector<std::string> texts_of(const Names& names, std::size_t at_most) {
  std::vector<std::string> texts;
  for (const auto& name : names)
    if (texts.size() < at_most) texts.emplace_back(name.to_string());
  return texts;
}

}  // namespace

void to_wire(const TelemetryRecord& record, std::uint32_t planned_contacts,
             msg::dds_::Frame_& wire) noexcept {
  const TelemetryFrame& frame = record.frame;
  wire.tick(frame.sequence);
  wire.time(frame.time);
  wire.plan_time(frame.plan_time);
  wire.joint_count(frame.joint_count);
  wire.contact_count(frame.contact_count);
  wire.phase(frame.phase);
  wire.flags(frame.flags);
  wire.mode(frame.mode);
  wire.fault(frame.fault);
  wire.fault_joint(joint_or_none(frame.fault_joint));
  wire.joint_faults(frame.joint_faults);
  wire.planned_contacts(planned_contacts);
  copy(frame.q_ref, wire.q_ref());
  copy(frame.q, wire.q());
  copy(frame.dq, wire.dq());
  copy(frame.tau_ff, wire.tau_ff());
  copy(frame.tau_cmd, wire.tau_cmd());
  copy(frame.tau_meas, wire.tau_meas());
  copy(frame.tau_limit, wire.tau_limit());
  copy(frame.temperature, wire.temperature());
  std::transform(frame.age.begin(), frame.age.end(), wire.age().begin(), to_ticks);
  copy(frame.base_position, wire.base_position());
  copy(frame.base_orientation, wire.base_orientation());
  copy_forces(frame, wire);
  wire.wakeup_us(microseconds(record.loop.wakeup_ns));
  wire.tick_us(microseconds(record.loop.tick_ns));
  wire.exchange_us(microseconds(record.loop.exchange_ns));
}

TelemetryFrame from_wire(const msg::dds_::Frame_& wire) noexcept {
  TelemetryFrame frame;
  frame.sequence = wire.tick();
  frame.time = wire.time();
  frame.plan_time = wire.plan_time();
  frame.joint_count = std::min<std::uint32_t>(wire.joint_count(), kMaxJoints);
  frame.contact_count = std::min<std::uint32_t>(wire.contact_count(), kMaxContacts);
  frame.phase = wire.phase();
  frame.flags = wire.flags();
  frame.mode = wire.mode();
  frame.fault = wire.fault();
  frame.fault_joint = wire.fault_joint() >= 0 && wire.fault_joint() < kMaxJoints
                          ? static_cast<std::uint32_t>(wire.fault_joint())
                          : kMaxJoints;
  frame.joint_faults = wire.joint_faults();
  copy(wire.q_ref(), frame.q_ref);
  copy(wire.q(), frame.q);
  copy(wire.dq(), frame.dq);
  copy(wire.tau_ff(), frame.tau_ff);
  copy(wire.tau_cmd(), frame.tau_cmd);
  copy(wire.tau_meas(), frame.tau_meas);
  copy(wire.tau_limit(), frame.tau_limit);
  copy(wire.temperature(), frame.temperature);
  copy(wire.age(), frame.age);
  copy(wire.base_position(), frame.base_position);
  copy(wire.base_orientation(), frame.base_orientation);
  copy(wire.force_obstacle(), frame.force_obstacle);
  copy(wire.force_floor(), frame.force_floor);
  frame.force_forbidden = static_cast<double>(wire.force_forbidden());
  frame.force_other = static_cast<double>(wire.force_other());
  return frame;
}

msg::dds_::Description_ to_wire(const std::string& robot, const TelemetryDescription& description) {
  msg::dds_::Description_ wire;
  wire.robot() = robot.c_str();
  wire.plan() = description.plan.c_str();
  const auto append = [](const std::vector<std::string>& names, auto& to) {
    for (const std::string& name : names) to.emplace_back(name.c_str());
  };
  append(description.joint_names, wire.joint_names());
  append(description.contact_names, wire.contact_names());
  append(description.modes, wire.modes());
  append(description.faults, wire.faults());
  std::transform(description.torque_limits.begin(), description.torque_limits.end(),
                 wire.torque_limit().begin(), [](double x) { return static_cast<float>(x); });
  for (const DescribedPhase& phase : description.phases) {
    wire.phases().emplace_back();
    wire.phases().back().name() = phase.name.c_str();
    wire.phases().back().contacts(phase.contacts);
  }
  return wire;
}

TelemetryDescription from_wire(const msg::dds_::Description_& wire) {
  TelemetryDescription description;
  description.plan = wire.plan().to_string();
  description.joint_names = texts_of(wire.joint_names(), kMaxJoints);
  description.contact_names = texts_of(wire.contact_names(), kMaxContacts);
  description.modes = texts_of(wire.modes(), TelemetryDescription::kMaxModes);
  description.faults = texts_of(wire.faults(), TelemetryDescription::kMaxFaults);
  for (std::size_t j = 0; j < description.joint_names.size(); ++j)
    description.torque_limits.push_back(static_cast<double>(wire.torque_limit()[j]));
  for (const auto& phase : wire.phases())
    if (description.phases.size() < TelemetryDescription::kMaxPhases)
      description.phases.push_back({phase.name().to_string(), phase.contacts()});
  return description;
}

builtin_interfaces::msg::dds_::Time_ to_stamp(std::int64_t nanoseconds) {
  builtin_interfaces::msg::dds_::Time_ stamp;
  stamp.sec(static_cast<std::int32_t>(nanoseconds / kSecond));
  stamp.nanosec(static_cast<std::uint32_t>(nanoseconds % kSecond));
  return stamp;
}

msg::dds_::Event_ to_wire(const TelemetryEvent& event, std::int64_t nanoseconds) {
  msg::dds_::Event_ wire;
  const auto stamp = to_stamp(nanoseconds);
  wire.number(event.sequence);
  wire.tick(event.tick);
  wire.time(event.time);
  wire.stamp_sec(stamp.sec());
  wire.stamp_nanosec(stamp.nanosec());
  wire.kind(static_cast<std::uint32_t>(event.kind));
  wire.severity(static_cast<std::uint32_t>(event.severity));
  wire.joint(event.joint);
  wire.phase(event.phase);
  wire.text() = std::string(event.view()).c_str();
  return wire;
}

TelemetryEvent from_wire(const msg::dds_::Event_& wire) {
  TelemetryEvent event;
  event.sequence = wire.number();
  event.tick = wire.tick();
  event.time = wire.time();
  event.kind = static_cast<EventKind>(wire.kind());
  event.severity = static_cast<Severity>(wire.severity());
  event.joint = wire.joint();
  event.phase = wire.phase();
  event.append(wire.text().to_string());
  return event;
}

std::int64_t run_start(const msg::dds_::Event_& wire) noexcept {
  // Rounded as the publisher rounds, so that all events of a run agree to the nanosecond.
  return wire.stamp_sec() * kSecond + static_cast<std::int64_t>(wire.stamp_nanosec()) -
         std::llround(wire.time() * 1e9);
}

void to_contacts(const TelemetryFrame& frame, std::uint32_t planned_contacts,
                 msg::dds_::Contacts_& wire) noexcept {
  std::uint32_t carrying = 0;
  for (std::size_t c = 0; c < frame.contact_count; ++c)
    if (frame.force_obstacle[c] + frame.force_floor[c] > kCarries) carrying |= 1u << c;
  wire.tick(frame.sequence);
  wire.time(frame.time);
  wire.phase(frame.phase);
  wire.contact_count(frame.contact_count);
  wire.planned(planned_contacts);
  wire.carrying(carrying);
  copy_forces(frame, wire);
}

void to_joint_state(const TelemetryFrame& frame, std::int64_t nanoseconds,
                    sensor_msgs::msg::dds_::JointState_& state) {
  state.header().stamp(to_stamp(nanoseconds));
  const auto joints =
      static_cast<std::ptrdiff_t>(std::min<std::size_t>(state.name().size(), kMaxJoints));
  state.position().assign(frame.q.begin(), frame.q.begin() + joints);
  state.velocity().assign(frame.dq.begin(), frame.dq.begin() + joints);
  state.effort().assign(frame.tau_meas.begin(), frame.tau_meas.begin() + joints);
}

}  // namespace clamber
