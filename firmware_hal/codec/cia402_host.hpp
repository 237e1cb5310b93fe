// The host (CANopen network manager) of a bus of CiA 402 drives.
// One thread; allocates: never; blocks: never.
//
// Each drive is brought to pre-operational, checked (device type, modes, rated torque), configured
// by SDO (heartbeats, reaction to a lost host, mode, process data) and started. From then on every
// tick sends RPDO1 to each and one SYNC, on which drives act on RPDO1 and send TPDO1. None of this
// energises anything: only the goal kOn leads a drive up the state machine, one controlword a tick.
//
// A running drive is told a new failure policy by SDO (6007h), one drive midway between two of the
// host's heartbeats, so that the bus budget holds it: hold is the quick stop that ends in standing,
// limp "disable voltage", lower the maker's own code; a drive that has none holds.
#pragma once

#include <optional>

#include "firmware_hal/codec/bus_host.hpp"
#include "firmware_hal/codec/cia402.hpp"

namespace clamber {

struct Cia402HostSettings {
  double tick = 0.001;      ///< s
  double heartbeat = 0.02;  ///< s between heartbeats, host's and drives'
  std::uint8_t node = 1;    ///< the host's; low, so that its heartbeat goes before the drives'
  LostHostReaction lost_host = LostHostReaction::kQuickStop;
};

/// A heartbeat is lost after this many of its periods (host and drives alike).
inline constexpr double kHeartbeatPatience = 2.5;

class Cia402Host final : public BusHost {
 public:
  explicit Cia402Host(const Cia402HostSettings& settings) noexcept;
  /// @param rated_motor_torque N m of the motor itself, as its object 6076h must say
  /// @return false: no room (kMaxDrives)
  [[nodiscard]] bool add_drive(const Cia402Drive& drive, const Mounting& mounting,
                               double rated_motor_torque) noexcept;

  void set_goal(HostGoal goal) noexcept override;
  [[nodiscard]] bool set_failure_policy(FailurePolicy policy) noexcept override;
  [[nodiscard]] std::uint32_t policy_ticks() const noexcept override;
  void begin_tick(std::span<const JointCommand> commands, FrameList& out) noexcept override;
  CodecStatus receive(const CanFrame& frame) noexcept override;

  /// The last emergency message of a drive; code 0: none, or the drive has taken it back.
  [[nodiscard]] const Emergency& emergency(std::size_t drive) const noexcept {
    return drives_[drive].emergency;
  }
  [[nodiscard]] Cia402State state(std::size_t drive) const noexcept { return drives_[drive].state; }

 private:
  enum class Stage : std::uint8_t { kSilent, kConfiguring, kStarting, kRunning };
  struct Drive {
    Cia402Drive codec;
    double rated_motor_torque = 0.0;
    Stage stage = Stage::kSilent;
    std::uint16_t step = 0;                      ///< of the configuration
    bool asked = false;                          ///< this step's SDO has been sent
    std::uint8_t attempts = 0;                   ///< of this step
    std::uint32_t wait = 0;                      ///< ticks in this stage or for this answer
    Cia402State state = Cia402State::kNotReady;  ///< as believed
    Cia402State seen = Cia402State::kNotReady;   ///< in the last reply
    bool reset_fault = false;                    ///< the operator has asked for it
    bool heard = false;                          ///< a heartbeat has come since the start
    std::uint64_t heartbeat_tick = 0;
    bool counted = false;  ///< counts and reply_tick are those of a former reply
    std::int32_t counts = 0;
    Emergency emergency;
    Cia402Command last;
    std::optional<std::uint16_t> policy_code;  ///< of 6007h, which it has acknowledged
    std::uint16_t policy_asked = 0;            ///< in the last question
    std::uint8_t policy_attempts = 0;
  };

  [[nodiscard]] std::uint32_t ticks(double seconds) const noexcept;
  void supervise(std::size_t i) noexcept;
  void bring_up(std::size_t i, FrameList& out) noexcept;
  void configure(std::size_t i, FrameList& out) noexcept;
  void command(std::size_t i, std::span<const JointCommand> commands, FrameList& out) noexcept;
  void tell_policy(FrameList& out) noexcept;
  void take_policy_answer(Drive& drive, SdoKind answer) noexcept;
  [[nodiscard]] static std::uint16_t policy_code(const Drive& drive, FailurePolicy policy) noexcept;
  [[nodiscard]] std::uint16_t controlword(std::size_t i) noexcept;
  [[nodiscard]] Cia402Command setpoint(std::size_t i,
                                       std::span<const JointCommand> commands) const noexcept;
  [[nodiscard]] std::size_t find(std::uint8_t node) const noexcept;
  void take_heartbeat(std::size_t i, NmtState state) noexcept;
  void take_sdo(std::size_t i, const Sdo& sdo) noexcept;
  CodecStatus take_reply(std::size_t i, const CanFrame& frame) noexcept;
  void take_emergency(std::size_t i, const Emergency& emergency) noexcept;

  Cia402HostSettings settings_;
  HostGoal goal_ = HostGoal::kOff;
  std::optional<FailurePolicy> policy_;  ///< none: what the drives were configured with
  std::uint32_t heartbeat_ticks_;
  std::array<Drive, kMaxDrives> drives_{};
};

/// One entry of the configuration that a drive gets, in order. For the host and for tests.
struct SdoStep {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint8_t size = 0;    ///< bytes; 0: not written but read and checked
  std::uint32_t value = 0;  ///< what is written
  bool optional = false;    ///< a drive may refuse it
};
[[nodiscard]] std::size_t cia402_step_count(const Cia402Drive& drive) noexcept;
[[nodiscard]] SdoStep cia402_step(const Cia402Drive& drive, const Cia402HostSettings& settings,
                                  std::size_t step) noexcept;

}  // namespace clamber
