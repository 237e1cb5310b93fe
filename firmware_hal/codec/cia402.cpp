#include "firmware_hal/codec/cia402.hpp"

#include <cmath>
#include <limits>

namespace clamber {
namespace {

constexpr std::uint32_t kRpdo1Id = 0x200;
constexpr std::uint32_t kTpdo1Id = 0x180;

template <typename Integer>
Integer to_integer(double value, bool& clamped) noexcept {
  constexpr auto kMin = static_cast<double>(std::numeric_limits<Integer>::min());
  constexpr auto kMax = static_cast<double>(std::numeric_limits<Integer>::max());
  if (!(value >= kMin)) {
    clamped = true;
    return std::numeric_limits<Integer>::min();
  }
  if (value > kMax) {
    clamped = true;
    return std::numeric_limits<Integer>::max();
  }
  return static_cast<Integer>(std::llround(value));
}

double clamp_torque(double tau, double limit, bool& clamped) noexcept {
  if (std::abs(tau) <= limit) return tau;
  clamped = true;
  return std::copysign(limit, tau);
}

// Commands of the controlword (CiA 402-2, table 29); bits that a command leaves open are masked.
bool is_shutdown(std::uint16_t word) noexcept { return (word & 0x87) == 0x06; }
bool is_switch_on(std::uint16_t word) noexcept { return (word & 0x8F) == 0x07; }
bool is_enable(std::uint16_t word) noexcept { return (word & 0x8F) == 0x0F; }
bool is_disable_voltage(std::uint16_t word) noexcept { return (word & 0x82) == 0x00; }
bool is_quick_stop(std::uint16_t word) noexcept { return (word & 0x86) == 0x02; }

std::size_t command_length(const Cia402Drive& drive) noexcept {
  return drive.mode == Cia402Mode::kCyclicTorque ? 4 : 8;
}

/// A PDO of this drive with its agreed length.
CodecStatus expect_pdo(const CanFrame& frame, std::uint32_t id, std::size_t length) noexcept {
  if (frame.extended || frame.remote || frame.error || frame.fd) return CodecStatus::kBadFormat;
  if (frame.id != id) return CodecStatus::kForeign;
  return frame.length == length ? CodecStatus::kOk : CodecStatus::kBadLength;
}

std::int16_t as_signed(std::uint32_t value) noexcept {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(value));
}

}  // namespace

const char* to_string(Cia402State state) noexcept {
  switch (state) {
    case Cia402State::kNotReady:
      return "not ready";
    case Cia402State::kSwitchOnDisabled:
      return "switch on disabled";
    case Cia402State::kReady:
      return "ready to switch on";
    case Cia402State::kSwitchedOn:
      return "switched on";
    case Cia402State::kEnabled:
      return "operation enabled";
    case Cia402State::kQuickStop:
      return "quick stop active";
    case Cia402State::kFaultReaction:
      return "fault reaction active";
    case Cia402State::kFault:
      return "fault";
  }
  return "?";
}

Cia402State state_of(std::uint16_t statusword) noexcept {
  switch (statusword & 0x4F) {
    case 0x00:
      return Cia402State::kNotReady;
    case 0x40:
      return Cia402State::kSwitchOnDisabled;
    case 0x0F:
      return Cia402State::kFaultReaction;
    case 0x08:
      return Cia402State::kFault;
    default:
      break;
  }
  switch (statusword & 0x6F) {
    case 0x21:
      return Cia402State::kReady;
    case 0x23:
      return Cia402State::kSwitchedOn;
    case 0x27:
      return Cia402State::kEnabled;
    case 0x07:
      return Cia402State::kQuickStop;
    default:
      return Cia402State::kNotReady;  // no state of the profile: nothing may be concluded from it
  }
}

std::uint16_t statusword_of(Cia402State state) noexcept {
  constexpr std::uint16_t kRemote = 1u << 9;
  constexpr std::uint16_t kVoltage = 1u << 4;
  switch (state) {
    case Cia402State::kNotReady:
      return kRemote;
    case Cia402State::kSwitchOnDisabled:
      return kRemote | 0x40;
    case Cia402State::kReady:
      return kRemote | kVoltage | 0x21;
    case Cia402State::kSwitchedOn:
      return kRemote | kVoltage | 0x23;
    case Cia402State::kEnabled:
      return kRemote | kVoltage | 0x27;
    case Cia402State::kQuickStop:
      return kRemote | kVoltage | 0x07;
    case Cia402State::kFaultReaction:
      return kRemote | kVoltage | 0x0F;
    case Cia402State::kFault:
      return kRemote | 0x08;
  }
  return kRemote;
}

std::uint16_t controlword_towards_enabled(Cia402State state) noexcept {
  switch (state) {
    case Cia402State::kSwitchOnDisabled:
      return kControlShutdown;
    case Cia402State::kReady:
      return kControlSwitchOn;
    case Cia402State::kSwitchedOn:
    case Cia402State::kEnabled:
      return kControlEnable;
    default:
      return kControlDisableVoltage;
  }
}

Cia402State next_state(Cia402State state, std::uint16_t before,
                       std::uint16_t controlword) noexcept {
  switch (state) {
    case Cia402State::kSwitchOnDisabled:
      return is_shutdown(controlword) ? Cia402State::kReady : state;
    case Cia402State::kReady:
      if (is_disable_voltage(controlword) || is_quick_stop(controlword))
        return Cia402State::kSwitchOnDisabled;
      // "Enable operation" here would be two transitions at once, which the profile leaves to the
      // drive. One at a time is what every host must cope with.
      return is_switch_on(controlword) || is_enable(controlword) ? Cia402State::kSwitchedOn : state;
    case Cia402State::kSwitchedOn:
      if (is_disable_voltage(controlword) || is_quick_stop(controlword))
        return Cia402State::kSwitchOnDisabled;
      if (is_shutdown(controlword)) return Cia402State::kReady;
      return is_enable(controlword) ? Cia402State::kEnabled : state;
    case Cia402State::kEnabled:
      if (is_disable_voltage(controlword)) return Cia402State::kSwitchOnDisabled;
      if (is_quick_stop(controlword)) return Cia402State::kQuickStop;
      if (is_shutdown(controlword)) return Cia402State::kReady;
      return is_switch_on(controlword) ? Cia402State::kSwitchedOn : state;
    case Cia402State::kQuickStop:
      if (is_disable_voltage(controlword)) return Cia402State::kSwitchOnDisabled;
      return is_enable(controlword) ? Cia402State::kEnabled : state;  // with option codes 5 to 8
    case Cia402State::kFault:
      return (controlword & ~before & kControlFaultReset) != 0 ? Cia402State::kSwitchOnDisabled
                                                               : state;
    case Cia402State::kNotReady:
    case Cia402State::kFaultReaction:
      return state;
  }
  return state;
}

CodecStatus encode_cia402_command(const Cia402Drive& drive, const Cia402Command& command,
                                  CanFrame& frame) noexcept {
  const bool position = drive.mode == Cia402Mode::kCyclicPosition;
  if (!std::isfinite(command.tau) || (position && !std::isfinite(command.q)))
    return CodecStatus::kNotFinite;
  bool clamped = false;
  const double tau = clamp_torque(command.tau, drive.max_torque, clamped);
  const auto permille = to_integer<std::int16_t>(tau / drive.torque_per_permille, clamped);
  std::array<std::uint8_t, 8> bytes{};
  write_le(bytes, 0, 2, command.controlword);
  std::size_t at = 2;
  if (position) {
    const auto counts = to_integer<std::int32_t>(command.q * drive.counts_per_radian, clamped);
    write_le(bytes, 2, 4, static_cast<std::uint32_t>(counts));
    at = 6;
  }
  write_le(bytes, at, 2, static_cast<std::uint16_t>(permille));
  frame = make_frame(kRpdo1Id + drive.node, std::span(bytes).first(command_length(drive)));
  return clamped ? CodecStatus::kClamped : CodecStatus::kOk;
}

CodecStatus decode_cia402_command(const Cia402Drive& drive, const CanFrame& frame,
                                  Cia402Command& command) noexcept {
  const CodecStatus status = expect_pdo(frame, kRpdo1Id + drive.node, command_length(drive));
  if (status != CodecStatus::kOk) return status;
  const auto bytes = frame.payload();
  Cia402Command read;
  read.controlword = static_cast<std::uint16_t>(read_le(bytes, 0, 2));
  std::size_t at = 2;
  if (drive.mode == Cia402Mode::kCyclicPosition) {
    read.q = static_cast<std::int32_t>(read_le(bytes, 2, 4)) / drive.counts_per_radian;
    at = 6;
  }
  read.tau = as_signed(read_le(bytes, at, 2)) * drive.torque_per_permille;
  command = read;
  return CodecStatus::kOk;
}

CanFrame encode_cia402_reply(const Cia402Drive& drive, const Cia402Reply& reply) noexcept {
  bool clamped = false;
  const auto counts = to_integer<std::int32_t>(reply.q * drive.counts_per_radian, clamped);
  const auto permille = to_integer<std::int16_t>(reply.tau / drive.torque_per_permille, clamped);
  std::array<std::uint8_t, 8> bytes{};
  write_le(bytes, 0, 2, reply.statusword);
  write_le(bytes, 2, 4, static_cast<std::uint32_t>(counts));
  write_le(bytes, 6, 2, static_cast<std::uint16_t>(permille));
  return make_frame(kTpdo1Id + drive.node, bytes);
}

CodecStatus decode_cia402_reply(const Cia402Drive& drive, const CanFrame& frame,
                                Cia402Reply& reply) noexcept {
  const CodecStatus status = expect_pdo(frame, kTpdo1Id + drive.node, 8);
  if (status != CodecStatus::kOk) return status;
  const auto bytes = frame.payload();
  reply.statusword = static_cast<std::uint16_t>(read_le(bytes, 0, 2));
  reply.counts = static_cast<std::int32_t>(read_le(bytes, 2, 4));
  reply.q = reply.counts / drive.counts_per_radian;
  reply.tau = as_signed(read_le(bytes, 6, 2)) * drive.torque_per_permille;
  return CodecStatus::kOk;
}

bool is_cia402_enable(const CanFrame& frame) noexcept {
  CanopenId id;
  if (classify_canopen(frame, id) != CodecStatus::kOk) return false;
  if (id.kind == CanopenKind::kRpdo && id.pdo == 1 && frame.length >= 2)
    return is_enable(static_cast<std::uint16_t>(read_le(frame.payload(), 0, 2)));
  Sdo sdo;
  bool request = false;
  return decode_sdo(frame, sdo, request) == CodecStatus::kOk && request &&
         sdo.kind == SdoKind::kDownload && sdo.index == 0x6040 &&
         is_enable(static_cast<std::uint16_t>(sdo.value));
}

}  // namespace clamber
