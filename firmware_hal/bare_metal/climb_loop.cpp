#include "firmware_hal/bare_metal/climb_loop.hpp"

#include <algorithm>
#include <cstring>

#include "control/crc32c.hpp"

namespace clamber {
namespace {

// Ticks in which every drive must be on: each needs a reply, a limp setpoint and the enable frame.
constexpr int kEnablingTicks = 100;

WireBytes wire_bytes(const CanFrame& frame) noexcept {
  WireBytes wire{.id = frame.id, .length = frame.length, .fd = frame.fd, .data = {}};
  std::copy_n(frame.data.begin(), wire.data.size(), wire.data.begin());
  return wire;
}

}  // namespace

LoadReport ClimbLoop::start(std::span<const std::byte> image, std::span<double> workspace,
                            std::span<const JointState> first) noexcept {
  const std::string_view hash(header_.robot_hash.data(), header_.robot_hash.size());
  const LoadReport report = controller_.load(header_.control, hash, image, workspace);
  if (report.status != LoadStatus::kOk) return report;
  controller_.request(OperatorCommand::kArm);
  controller_.request(OperatorCommand::kStart);
  for (std::size_t j = 0; j < header_.joint_count; ++j)
    if (!host_.add_drive(header_.drives[j].mit, header_.drives[j].mounting, 0.0))
      return {.status = LoadStatus::kBadConfig};
  for (int i = 0; i < kEnablingTicks && !host_.all_on(); ++i) {
    ask(std::span(commands_).first(header_.joint_count));
    reply(first);
    if (i == 0) host_.set_goal(HostGoal::kOn);
  }
  ask(std::span(commands_).first(header_.joint_count));
  return host_.all_on() ? report : LoadReport{.status = LoadStatus::kBadConfig};
}

/// Each drive answers its command with what its sensors read, and the host takes it in.
void ClimbLoop::reply(std::span<const JointState> recorded) noexcept {
  for (std::size_t j = 0; j < header_.joint_count; ++j) {
    const LoopDrive& drive = header_.drives[j];
    const JointState& s = recorded[j];
    const JointCommand read =
        to_drive(drive.mounting, {.q = s.q, .dq = s.dq, .kp = 0.0, .kd = 0.0, .tau = s.tau});
    MitReply reply{.q = read.q, .dq = read.dq, .tau = read.tau, .temperature = s.temperature};
    reply.enabled = enabled_[j];
    replies_[j] = encode_mit_reply(drive.mit, reply);
  }
  done(LoopPart::kDrives);
  for (std::size_t j = 0; j < header_.joint_count; ++j)
    static_cast<void>(host_.receive(replies_[j]));
  host_.end_tick(std::span(states_).first(header_.joint_count));
  done(LoopPart::kDecode);
}

void ClimbLoop::ask(std::span<const JointCommand> commands) noexcept {
  host_.begin_tick(commands, frames_);
  for (std::size_t j = 0; j < frames_.frames().size(); ++j)
    enabled_[j] = enabled_[j] || is_mit_enable(frames_.frames()[j]);
}

JointRecord ClimbLoop::record_of(std::size_t joint) const noexcept {
  const LoopDrive& drive = header_.drives[joint];
  JointRecord record;
  record.command = commands_[joint];
  record.mit = wire_bytes(frames_.frames()[joint]);
  const JointCommand command = to_drive(drive.mounting, commands_[joint]);
  CanFrame frame;
  static_cast<void>(encode_cia402_command(
      drive.cia402, {.controlword = kControlEnable, .q = command.q, .tau = command.tau}, frame));
  record.cia402 = wire_bytes(frame);
  return record;
}

void ClimbLoop::tick(std::span<const JointState> recorded, std::span<std::byte> record) noexcept {
  const std::size_t joints = header_.joint_count;
  reply(recorded);
  const std::span<const JointCommand> commands = std::span(commands_).first(joints);
  TickRecord head;
  head.status = static_cast<std::uint32_t>(controller_.tick(
      std::span(states_).first(joints), std::span(commands_).first(joints), telemetry_));
  done(LoopPart::kControl);
  ask(commands);
  done(LoopPart::kEncode);
  head.fault = static_cast<std::uint32_t>(controller_.fault());
  head.telemetry_crc = crc32c(std::as_bytes(std::span(&telemetry_, 1)));
  for (std::size_t j = 0; j < joints; ++j)
    head.links_on += host_.status(j).phase == LinkPhase::kOn ? 1u : 0u;
  std::memcpy(record.data(), &head, sizeof(head));
  for (std::size_t j = 0; j < joints; ++j) {
    const JointRecord of_joint = record_of(j);
    std::memcpy(record.data() + sizeof(head) + j * sizeof(of_joint), &of_joint, sizeof(of_joint));
  }
  done(LoopPart::kRecord);
}

}  // namespace clamber
