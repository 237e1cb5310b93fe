#include "firmware_hal/codec/mit.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

constexpr std::uint8_t kStateDisabled = 0;
constexpr std::uint8_t kStateEnabled = 1;

/// Nearest step: a command that is decoded is off by half a step at most.
std::uint32_t to_steps(double value, MitRange range, int bits, bool& clamped) noexcept {
  const double steps = static_cast<double>((1u << bits) - 1);
  if (!(value >= range.min)) {  // NaN as well
    clamped = true;
    return 0;
  }
  if (value > range.max) {
    clamped = true;
    return static_cast<std::uint32_t>(steps);
  }
  return static_cast<std::uint32_t>(
      std::lround((value - range.min) * steps / (range.max - range.min)));
}

double from_steps(std::uint32_t value, MitRange range, int bits) noexcept {
  return range.min + value * (range.max - range.min) / static_cast<double>((1u << bits) - 1);
}

constexpr std::uint8_t low8(std::uint32_t value) noexcept {
  return static_cast<std::uint8_t>(value & 0xFFu);
}

bool is_seven_ones(std::span<const std::uint8_t> bytes) noexcept {
  return bytes.size() == 8 && std::all_of(bytes.begin(), bytes.begin() + 7,
                                          [](std::uint8_t byte) { return byte == 0xFF; });
}

bool is_special(std::uint8_t code) noexcept {
  return code >= low8(static_cast<std::uint32_t>(MitSpecial::kClearFault)) && code <= 0xFE;
}

}  // namespace

CodecStatus encode_mit_command(const MitDrive& drive, const JointCommand& command,
                               CanFrame& frame) noexcept {
  if (!std::isfinite(command.q) || !std::isfinite(command.dq) || !std::isfinite(command.kp) ||
      !std::isfinite(command.kd) || !std::isfinite(command.tau))
    return CodecStatus::kNotFinite;
  bool clamped = false;
  const std::uint32_t p = to_steps(command.q, drive.ranges.position, 16, clamped);
  const std::uint32_t v = to_steps(command.dq, drive.ranges.velocity, 12, clamped);
  const std::uint32_t kp = to_steps(command.kp, drive.ranges.kp, 12, clamped);
  std::uint32_t kd = to_steps(command.kd, drive.ranges.kd, 12, clamped);
  const std::uint32_t t = to_steps(command.tau, drive.ranges.torque, 12, clamped);
  if (p == 0xFFFF && v == 0xFFF && kp == 0xFFF && kd == 0xFFF && t >= 0xF00) --kd;
  const std::array<std::uint8_t, 8> bytes{low8(p >> 8),           low8(p),  low8(v >> 4),
                                          low8(v << 4 | kp >> 8), low8(kp), low8(kd >> 4),
                                          low8(kd << 4 | t >> 8), low8(t)};
  frame = make_frame(drive.id, bytes, drive.format);
  return clamped ? CodecStatus::kClamped : CodecStatus::kOk;
}

CanFrame encode_mit_special(const MitDrive& drive, MitSpecial special) noexcept {
  std::array<std::uint8_t, 8> bytes;
  bytes.fill(0xFF);
  bytes[7] = static_cast<std::uint8_t>(special);
  return make_frame(drive.id, bytes, drive.format);
}

CodecStatus decode_mit_reply(const MitDrive& drive, const CanFrame& frame,
                             MitReply& reply) noexcept {
  if (frame.extended || frame.remote || frame.error) return CodecStatus::kBadFormat;
  if (frame.id != drive.reply_id) return CodecStatus::kForeign;
  if (frame.length != mit_reply_length(drive.reply)) return CodecStatus::kBadLength;
  const bool nibble = drive.reply == MitReplyKind::kStateNibble;
  const std::uint8_t mask = nibble ? 0x0F : 0xFF;
  const auto& d = frame.data;
  if ((d[0] & mask) != (drive.id & mask)) return CodecStatus::kForeign;
  if (frame.fd != drive.format.fd || frame.brs != drive.format.brs) return CodecStatus::kBadFormat;

  MitReply read;
  read.q = from_steps(std::uint32_t{d[1]} << 8 | d[2], drive.ranges.position, 16);
  read.dq = from_steps(std::uint32_t{d[3]} << 4 | d[4] >> 4, drive.ranges.velocity, 12);
  read.tau = from_steps((d[4] & 0x0Fu) << 8 | d[5], drive.ranges.reply_torque, 12);
  switch (drive.reply) {
    case MitReplyKind::kPlain:
      break;
    case MitReplyKind::kVoltage:
      read.voltage = from_steps(d[6], drive.ranges.voltage, 8);
      break;
    case MitReplyKind::kTemperatureError:
      read.temperature = d[6] + drive.temperature_offset;
      read.error = d[7];
      break;
    case MitReplyKind::kStateNibble: {
      const auto state = static_cast<std::uint8_t>(d[0] >> 4);
      read.enabled = state == kStateEnabled;
      read.error = state > kStateEnabled ? state : 0;
      read.temperature = std::max(d[6], d[7]) + drive.temperature_offset;
    }
  }
  reply = read;
  return CodecStatus::kOk;
}

CodecStatus decode_mit_command(const MitDrive& drive, const CanFrame& frame,
                               MitCommand& command) noexcept {
  if (frame.extended || frame.remote || frame.error) return CodecStatus::kBadFormat;
  if (frame.id != drive.id) return CodecStatus::kForeign;
  if (frame.length != 8) return CodecStatus::kBadLength;
  const auto& d = frame.data;
  MitCommand read;
  if (is_seven_ones(frame.payload()) && is_special(d[7])) {
    read.special = true;
    read.code = static_cast<MitSpecial>(d[7]);
  } else {
    read.setpoint.q = from_steps(std::uint32_t{d[0]} << 8 | d[1], drive.ranges.position, 16);
    read.setpoint.dq = from_steps(std::uint32_t{d[2]} << 4 | d[3] >> 4, drive.ranges.velocity, 12);
    read.setpoint.kp = from_steps((d[3] & 0x0Fu) << 8 | d[4], drive.ranges.kp, 12);
    read.setpoint.kd = from_steps(std::uint32_t{d[5]} << 4 | d[6] >> 4, drive.ranges.kd, 12);
    read.setpoint.tau = from_steps((d[6] & 0x0Fu) << 8 | d[7], drive.ranges.torque, 12);
  }
  command = read;
  return CodecStatus::kOk;
}

CanFrame encode_mit_reply(const MitDrive& drive, const MitReply& reply) noexcept {
  bool clamped = false;
  const std::uint32_t p = to_steps(reply.q, drive.ranges.position, 16, clamped);
  const std::uint32_t v = to_steps(reply.dq, drive.ranges.velocity, 12, clamped);
  const std::uint32_t t = to_steps(reply.tau, drive.ranges.reply_torque, 12, clamped);
  const MitRange degrees{drive.temperature_offset, drive.temperature_offset + 255.0};
  const std::uint8_t temperature = low8(to_steps(reply.temperature, degrees, 8, clamped));
  std::array<std::uint8_t, 8> bytes{low8(drive.id),        low8(p >> 8), low8(p), low8(v >> 4),
                                    low8(v << 4 | t >> 8), low8(t),      0,       0};
  switch (drive.reply) {
    case MitReplyKind::kPlain:
      break;
    case MitReplyKind::kVoltage:
      bytes[6] = low8(to_steps(reply.voltage, drive.ranges.voltage, 8, clamped));
      break;
    case MitReplyKind::kTemperatureError:
      bytes[6] = temperature;
      bytes[7] = reply.error;
      break;
    case MitReplyKind::kStateNibble: {
      const std::uint8_t healthy = reply.enabled ? kStateEnabled : kStateDisabled;
      const std::uint8_t state = reply.error != 0 ? reply.error : healthy;
      bytes[0] = low8(std::uint32_t{state} << 4 | (drive.id & 0x0Fu));
      bytes[6] = bytes[7] = temperature;
    }
  }
  return make_frame(drive.reply_id, std::span(bytes).first(mit_reply_length(drive.reply)),
                    drive.format);
}

bool is_mit_enable(const CanFrame& frame) noexcept {
  return is_standard_data(frame, 8) && is_seven_ones(frame.payload()) &&
         frame.data[7] == static_cast<std::uint8_t>(MitSpecial::kEnable);
}

}  // namespace clamber
