#include "telemetry/wire.hpp"

#include <algorithm>

namespace clamber {
namespace {

template <typename From, typename To, std::size_t N>
void copy(const std::array<From, N>& from, std::array<To, N>& to) noexcept {
  std::transform(from.begin(), from.end(), to.begin(), [](From x) { return static_cast<To>(x); });
}

}  // namespace

void to_wire(const TelemetryFrame& frame, msg::dds_::Frame_& wire) noexcept {
  wire.tick(frame.sequence);
  wire.time(frame.time);
  wire.plan_time(frame.plan_time);
  wire.joint_count(frame.joint_count);
  wire.contact_count(frame.contact_count);
  wire.phase(frame.phase);
  wire.flags(frame.flags);
  copy(frame.q_ref, wire.q_ref());
  copy(frame.q, wire.q());
  copy(frame.dq, wire.dq());
  copy(frame.tau_ff, wire.tau_ff());
  copy(frame.tau_cmd, wire.tau_cmd());
  copy(frame.tau_meas, wire.tau_meas());
  copy(frame.base_position, wire.base_position());
  copy(frame.base_orientation, wire.base_orientation());
  copy(frame.force_obstacle, wire.force_obstacle());
  copy(frame.force_floor, wire.force_floor());
  wire.force_forbidden(static_cast<float>(frame.force_forbidden));
  wire.force_other(static_cast<float>(frame.force_other));
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
  copy(wire.q_ref(), frame.q_ref);
  copy(wire.q(), frame.q);
  copy(wire.dq(), frame.dq);
  copy(wire.tau_ff(), frame.tau_ff);
  copy(wire.tau_cmd(), frame.tau_cmd);
  copy(wire.tau_meas(), frame.tau_meas);
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
  for (const std::string& name : description.joint_names) {
    wire.joint_names().emplace_back(name.c_str());
  }
  std::transform(description.torque_limits.begin(), description.torque_limits.end(),
                 wire.torque_limit().begin(), [](double x) { return static_cast<float>(x); });
  for (const std::string& name : description.contact_names) {
    wire.contact_names().emplace_back(name.c_str());
  }
  return wire;
}

TelemetryDescription from_wire(const msg::dds_::Description_& wire) {
  TelemetryDescription description;
  const std::size_t joints = std::min<std::size_t>(wire.joint_names().size(), kMaxJoints);
  for (std::size_t j = 0; j < joints; ++j) {
    description.joint_names.emplace_back(wire.joint_names()[j].to_string());
    description.torque_limits.push_back(static_cast<double>(wire.torque_limit()[j]));
  }
  const std::size_t contacts = std::min<std::size_t>(wire.contact_names().size(), kMaxContacts);
  for (std::size_t c = 0; c < contacts; ++c) {
    description.contact_names.emplace_back(wire.contact_names()[c].to_string());
  }
  return description;
}

void to_joint_state(const TelemetryFrame& frame, std::int64_t nanoseconds,
                    sensor_msgs::msg::dds_::JointState_& state) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  state.header().stamp().sec(static_cast<std::int32_t>(nanoseconds / kSecond));
  state.header().stamp().nanosec(static_cast<std::uint32_t>(nanoseconds % kSecond));
  const auto joints =
      static_cast<std::ptrdiff_t>(std::min<std::size_t>(state.name().size(), kMaxJoints));
  state.position().assign(frame.q.begin(), frame.q.begin() + joints);
  state.velocity().assign(frame.dq.begin(), frame.dq.begin() + joints);
  state.effort().assign(frame.tau_meas.begin(), frame.tau_meas.begin() + joints);
}

}  // namespace clamber
