// The drive profile CiA 402 over CANopen: state machine, cyclic process data in torque (CST) and
// position mode (CSP); for the host and for the drive. Any thread; allocates: never; blocks: never.
#pragma once

#include <cstdint>

#include "control/joint_types.hpp"
#include "firmware_hal/codec/canopen.hpp"

namespace clamber {

/// States of CiA 402-2 (IEC 61800-7-201), 6.1.
enum class Cia402State : std::uint8_t {
  kNotReady,
  kSwitchOnDisabled,
  kReady,
  kSwitchedOn,
  kEnabled,
  kQuickStop,
  kFaultReaction,
  kFault,
};
[[nodiscard]] const char* to_string(Cia402State state) noexcept;

enum class Cia402Mode : std::int8_t { kCyclicPosition = 8, kCyclicTorque = 10 };  ///< object 6060h

/// What a drive does when its host falls silent: object 6007h, "abort connection option code".
/// Negative codes are the drive's maker's own (CiA 402-2).
enum class LostHostReaction : std::uint8_t { kNone = 0, kFault = 1, kDisable = 2, kQuickStop = 3 };

enum Controlword : std::uint16_t {
  kControlDisableVoltage = 0x00,
  kControlQuickStop = 0x02,
  kControlShutdown = 0x06,
  kControlSwitchOn = 0x07,
  kControlEnable = 0x0F,
  kControlFaultReset = 0x80,  ///< acts on its rising edge
};
inline constexpr std::uint16_t kStatusInternalLimit = 1u << 11;

[[nodiscard]] Cia402State state_of(std::uint16_t statusword) noexcept;
/// Drive: the statusword of a state, with "voltage enabled" and "remote".
[[nodiscard]] std::uint16_t statusword_of(Cia402State state) noexcept;

/// Host: the controlword that brings the drive one step nearer to being enabled. In kFault and
/// kFaultReaction: disable voltage, never a reset, which is the operator's decision.
[[nodiscard]] std::uint16_t controlword_towards_enabled(Cia402State state) noexcept;

/// Drive: the state after a controlword (transitions 2 to 12, 15 and 16; the others are the drive's
/// own). @param before the controlword before it, for the edge of the fault reset
[[nodiscard]] Cia402State next_state(Cia402State state, std::uint16_t before,
                                     std::uint16_t controlword) noexcept;

/// One drive as its host must know it. Scales are those of the joint, behind the gear.
struct Cia402Drive {
  std::uint8_t node = 0;
  Cia402Mode mode = Cia402Mode::kCyclicTorque;
  double counts_per_radian = 1.0;  ///< of 6064h and 607Ah
  double torque_per_permille =
      1.0;                  ///< N m per thousandth of the rated torque (6071h, 6077h, 60B2h)
  double max_torque = 0.0;  ///< N m; commands are clamped to it
  /// 6007h by which this drive lowers its joint, of its maker's own; 0: it has none.
  std::int16_t lower_option = 0;
};

/// RPDO1. CST: 6040h u16, 6071h i16 (4 bytes). CSP: 6040h u16, 607Ah i32, 60B2h i16 (8 bytes).
struct Cia402Command {
  std::uint16_t controlword = 0;
  double q = 0.0;    ///< rad, CSP only
  double tau = 0.0;  ///< N m: target torque (CST) or torque offset (CSP)
};
/// @return kOk, kClamped or kNotFinite (then `frame` is untouched)
[[nodiscard]] CodecStatus encode_cia402_command(const Cia402Drive& drive,
                                                const Cia402Command& command,
                                                CanFrame& frame) noexcept;
[[nodiscard]] CodecStatus decode_cia402_command(const Cia402Drive& drive, const CanFrame& frame,
                                                Cia402Command& command) noexcept;

/// TPDO1: 6041h u16, 6064h i32, 6077h i16 (8 bytes).
struct Cia402Reply {
  std::uint16_t statusword = 0;
  std::int32_t counts = 0;  ///< 6064h, for differences without rounding
  double q = 0.0;           ///< rad
  double tau = 0.0;         ///< N m
};
/// Drive: `counts` is ignored, `q` and `tau` are clamped to what the objects hold.
[[nodiscard]] CanFrame encode_cia402_reply(const Cia402Drive& drive,
                                           const Cia402Reply& reply) noexcept;
[[nodiscard]] CodecStatus decode_cia402_reply(const Cia402Drive& drive, const CanFrame& frame,
                                              Cia402Reply& reply) noexcept;

/// True for a frame that asks a drive to energise: "enable operation" as RPDO1 or by SDO.
[[nodiscard]] bool is_cia402_enable(const CanFrame& frame) noexcept;

}  // namespace clamber
