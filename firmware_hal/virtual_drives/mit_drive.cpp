#include "firmware_hal/virtual_drives/mit_drive.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

// Damiao's states (DM-J4310 manual, feedback frame) and CubeMars' error codes (AK manual, 5.3).
constexpr std::uint8_t kDamiaoOverCurrent = 0xA;
constexpr std::uint8_t kDamiaoCoilTooHot = 0xC;
constexpr std::uint8_t kDamiaoHostLost = 0xD;
constexpr std::uint8_t kCubeMarsTooHot = 1;
constexpr std::uint8_t kCubeMarsOverCurrent = 2;

std::uint32_t steps_in(double seconds, double step) noexcept {
  return static_cast<std::uint32_t>(std::ceil(seconds / step - 1e-6));
}

}  // namespace

VirtualMitDrive::VirtualMitDrive(const MitDrive& codec, double watchdog, const WindingHeat& heat,
                                 double step) noexcept
    : VirtualDrive(heat, step), codec_(codec), watchdog_steps_(steps_in(watchdog, step)) {}

void VirtualMitDrive::receive(const CanFrame& frame) noexcept {
  MitCommand command;
  const CodecStatus status = decode_mit_command(codec_, frame, command);
  if (deaf_ > 0 || status == CodecStatus::kForeign || frame.id != codec_.id) return;
  ++traffic_.heard;
  if (status != CodecStatus::kOk) {
    ++traffic_.malformed;
    return;
  }
  silence_ = 0;
  limp_ = false;
  if (command.special)
    take_special(command.code);
  else
    setpoint_ = command.setpoint;
  if (deaf_ == 0) reply();
}

void VirtualMitDrive::take_special(MitSpecial special) noexcept {
  switch (special) {
    case MitSpecial::kEnable:
      enabled_ = error_ == 0;
      dropped_ = dropped_ && !enabled_;
      break;
    case MitSpecial::kDisable:
      enabled_ = dropped_ = false;
      // Without a command for it, leaving the motor mode is how these drives' errors are cleared.
      if (!reports_state() && winding_.cooled()) error_ = 0;
      break;
    case MitSpecial::kClearFault:
      if (reports_state() && winding_.cooled()) error_ = 0;
      break;
    case MitSpecial::kSetZero:
      if (enabled_) break;
      encoder_offset_ -= q();
      deaf_ = steps_in(kMitZeroingSeconds, step());
      break;
  }
}

void VirtualMitDrive::reply() noexcept {
  MitReply reply;
  reply.q = q();
  reply.dq = dq();
  reply.tau = measured_torque();
  reply.temperature = temperature();
  reply.voltage = 48.0;
  reply.error = error_;
  reply.enabled = enabled_;
  outbox_.push(encode_mit_reply(codec_, reply));
}

double VirtualMitDrive::torque() noexcept {
  if (!enabled_ || limp_ || deaf_ > 0) return 0.0;
  const double wanted =
      setpoint_.tau + setpoint_.kp * (setpoint_.q - q()) + setpoint_.kd * (setpoint_.dq - dq());
  return std::clamp(wanted, codec_.ranges.torque.min, codec_.ranges.torque.max);
}

void VirtualMitDrive::pass() noexcept {
  winding_.pass(measured_torque(), step());
  if (deaf_ > 0) {
    --deaf_;
    return;
  }
  ++silence_;
  if (enabled_ && watchdog_steps_ > 0 && silence_ >= watchdog_steps_) {
    if (reports_state())
      break_down(kDamiaoHostLost);
    else
      limp_ = true;
  }
  if (error_ == 0 && winding_.too_hot())
    break_down(reports_state() ? kDamiaoCoilTooHot : kCubeMarsTooHot);
}

DrivePower VirtualMitDrive::power() const noexcept {
  if (enabled_) return limp_ ? DrivePower::kDropped : DrivePower::kOn;
  return dropped_ ? DrivePower::kDropped : DrivePower::kOff;
}

void VirtualMitDrive::power_cycle(double seconds) noexcept {
  dropped_ = dropped_ || enabled_;
  enabled_ = limp_ = false;
  error_ = 0;
  setpoint_ = {};
  silence_ = 0;
  deaf_ = steps_in(seconds, step());
}

void VirtualMitDrive::break_down(std::uint32_t code) noexcept {
  dropped_ = dropped_ || enabled_;
  enabled_ = false;
  error_ = code != 0 ? static_cast<std::uint8_t>(code)
                     : (reports_state() ? kDamiaoOverCurrent : kCubeMarsOverCurrent);
}

}  // namespace clamber
