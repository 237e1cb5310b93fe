// The MIT mini-cheetah protocol as CubeMars AK, Damiao and bgkatz drives speak it: bytes <->
// values, for the host and for the drive. Any thread; allocates: never; blocks: never.
//
// One 8-byte command per joint, one 6-, 7- or 8-byte reply. Values are unsigned integers that span
// a range which is nowhere on the wire: it belongs to motor type and firmware, and with a wrong
// range every value is silently wrong. Layouts: bgkatz motorcontrol (CAN section), CubeMars AK
// series manual ("MIT mode"), Damiao DM-J4310 manual ("feedback frame"); docs/can.md has them as
// tables.
#pragma once

#include <cstdint>

#include "control/joint_types.hpp"
#include "firmware_hal/can_frame.hpp"
#include "firmware_hal/codec/codec_status.hpp"

namespace clamber {

struct MitRange {
  double min = 0.0;
  double max = 0.0;
};

struct MitRanges {
  MitRange position;      ///< rad, 16 bits
  MitRange velocity;      ///< rad/s, 12 bits
  MitRange kp;            ///< N m/rad, 12 bits
  MitRange kd;            ///< N m s/rad, 12 bits
  MitRange torque;        ///< N m, 12 bits
  MitRange reply_torque;  ///< N m, 12 bits: some firmware scales replies otherwise than commands
  MitRange voltage;       ///< V, 8 bits; MitReplyKind::kVoltage only
};

enum class MitReplyKind : std::uint8_t {
  kPlain,             ///< 6 bytes: id, position, velocity, torque
  kVoltage,           ///< 7 bytes: the same and the supply voltage
  kTemperatureError,  ///< 8 bytes: the same, temperature, error code (0: none)
  kStateNibble,       ///< 8 bytes: first byte is state << 4 | id; then MOSFET, rotor temperature
};
[[nodiscard]] constexpr std::uint8_t mit_reply_length(MitReplyKind kind) noexcept {
  return kind == MitReplyKind::kPlain ? 6 : kind == MitReplyKind::kVoltage ? 7 : 8;
}

/// One drive as its host must know it.
struct MitDrive {
  std::uint16_t id = 0;        ///< standard id of its commands
  std::uint16_t reply_id = 0;  ///< standard id of its replies ("master id"; 0 from the factory)
  MitRanges ranges;
  MitReplyKind reply = MitReplyKind::kPlain;
  double temperature_offset = 0.0;  ///< degree Celsius, added to the reply's temperature byte
  FrameFormat format;
};

/// The commands that are eight fixed bytes: seven 0xFF and one of these.
enum class MitSpecial : std::uint8_t {
  kClearFault = 0xFB,  ///< Damiao only
  kEnable = 0xFC,
  kDisable = 0xFD,
  kSetZero = 0xFE,  ///< the drive is deaf for up to kMitZeroingSeconds
};
inline constexpr double kMitZeroingSeconds = 1.5;

/// Encodes a setpoint. No setpoint ever becomes a special command: bytes of seven 0xFF, which all
/// ends of the ranges together would give, have kd lowered by one of its 4095 steps.
/// @return kOk, kClamped or kNotFinite (then `frame` is untouched)
[[nodiscard]] CodecStatus encode_mit_command(const MitDrive& drive, const JointCommand& command,
                                             CanFrame& frame) noexcept;
[[nodiscard]] CanFrame encode_mit_special(const MitDrive& drive, MitSpecial special) noexcept;

struct MitReply {
  double q = 0.0;            ///< rad
  double dq = 0.0;           ///< rad/s
  double tau = 0.0;          ///< N m
  double temperature = 0.0;  ///< degree Celsius, the hottest one reported; 0: not reported
  double voltage = 0.0;      ///< V; 0: not reported
  std::uint8_t error = 0;    ///< the drive's code, 0: none
  bool enabled = true;       ///< only kStateNibble reports it; others: true
};

/// Host: reads a reply of this drive.
/// @return kOk, or why the frame is not one (`reply` is then untouched). kForeign covers both
/// another
///   CAN id and, as drives share the factory's reply id, another drive's id in the first byte.
[[nodiscard]] CodecStatus decode_mit_reply(const MitDrive& drive, const CanFrame& frame,
                                           MitReply& reply) noexcept;

struct MitCommand {
  bool special = false;
  MitSpecial code = MitSpecial::kDisable;  ///< if special
  JointCommand setpoint;                   ///< if not
};

/// Drive: reads a command for this drive, in whatever format it came (a real drive accepts both).
/// @return kOk, kForeign, kBadFormat (not a standard data frame) or kBadLength
[[nodiscard]] CodecStatus decode_mit_command(const MitDrive& drive, const CanFrame& frame,
                                             MitCommand& command) noexcept;
/// Drive: writes its reply, in the format of `drive`; values beyond the ranges are clamped, values
/// that are not finite become the ranges' lower ends.
[[nodiscard]] CanFrame encode_mit_reply(const MitDrive& drive, const MitReply& reply) noexcept;

/// True for the one frame that energises a drive: eight bytes FF FF FF FF FF FF FF FC.
[[nodiscard]] bool is_mit_enable(const CanFrame& frame) noexcept;

}  // namespace clamber
