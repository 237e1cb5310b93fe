// The firmware of a CANopen servo drive (CiA 301, CiA 402). Threads and heap: see
// virtual_drive.hpp.
//
// It knows nothing of its host's codec for process data: what RPDO1 and TPDO1 hold is what the host
// has mapped by SDO. Setpoints act on SYNC, on which it also answers. In cyclic torque mode the
// torque is the target; in cyclic position mode, and to stop, it closes a position loop of its own.
// Quick stop: from its present speed down on the ramp of 6085h, then what 605Ah says. A lost host
// (heartbeat consumer 1016h, or NMT "stop"): emergency 8130h and what 6007h says. The maker's own
// code of its motor type (lower_option) lets the joint sink: see DrivesAlone, control/
// failure_policy.hpp. It sinks as a fault reaction, which the host's return ends.
#pragma once

#include <array>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/codec/cia402.hpp"
#include "firmware_hal/virtual_drives/object_dictionary.hpp"
#include "firmware_hal/virtual_drives/virtual_drive.hpp"

namespace clamber {

class VirtualCia402Drive final : public VirtualDrive {
 public:
  VirtualCia402Drive(const Cia402Drive& codec, const Cia402Motor& motor, const WindingHeat& heat,
                     double step);

  void receive(const CanFrame& frame) noexcept override;
  [[nodiscard]] double torque() noexcept override;
  void pass() noexcept override;
  [[nodiscard]] DrivePower power() const noexcept override;

  void power_cycle(double seconds) noexcept override;
  void break_down(std::uint32_t code) noexcept override;

  /// Announces itself, as it does when power comes on.
  void boot() noexcept;
  /// Heartbeats stop, everything else goes on: a half-dead network stack.
  void mute_heartbeat(bool muted) noexcept { heartbeat_muted_ = muted; }
  /// An emergency message about something that is not a fault of the drive's own.
  void emergency(std::uint16_t code, std::uint8_t error_register) noexcept;

  [[nodiscard]] Cia402State state() const noexcept { return state_; }
  [[nodiscard]] NmtState nmt() const noexcept { return nmt_; }
  [[nodiscard]] ObjectDictionary& objects() noexcept { return objects_; }

 private:
  void define_objects();
  void take_nmt(NmtCommand command) noexcept;
  void take_sdo(const Sdo& request) noexcept;
  [[nodiscard]] std::uint32_t refusal(const Sdo& request) noexcept;
  void take_rpdo(const CanFrame& frame) noexcept;
  void take_host_heartbeat(std::uint8_t node) noexcept;
  void take_sync() noexcept;
  void act_on_controlword() noexcept;
  void act_on_setpoint() noexcept;
  void update_actual_values() noexcept;
  [[nodiscard]] CanFrame mapped_tpdo() noexcept;
  void enter(Cia402State state) noexcept;
  void lose_host() noexcept;
  void watch_host() noexcept;
  void beat() noexcept;
  void go_on_stopping() noexcept;
  [[nodiscard]] double sinking_torque() const noexcept;
  [[nodiscard]] std::int32_t counts() const noexcept;
  [[nodiscard]] double hold_torque(double target, double rate) const noexcept;

  Cia402Drive codec_;
  Cia402Motor motor_;
  ObjectDictionary objects_;
  NmtState nmt_ = NmtState::kPreOperational;
  Cia402State state_ = Cia402State::kSwitchOnDisabled;
  std::uint16_t controlword_ = 0;  ///< the last one acted on
  std::array<std::uint8_t, 8> rpdo_{};
  std::uint8_t rpdo_length_ = 0;  ///< 0: none since the last SYNC
  bool heartbeat_muted_ = false;
  bool host_heard_ = false;
  bool host_lost_ = false;
  bool dropped_ = false;
  bool sinking_ = false;       ///< in the fault reaction
  double sunk_for_ = 0.0;      ///< s
  double sinking_from_ = 0.0;  ///< N m, the torque it gave last
  bool limited_ = false;       ///< the torque is at its limit
  std::uint32_t host_silence_ = 0;
  std::uint32_t since_beat_ = 0;
  std::uint32_t deaf_ = 0;
  double target_tau_ = 0.0;   ///< N m
  double target_q_ = 0.0;     ///< rad
  double target_rate_ = 0.0;  ///< rad/s
  bool target_known_ = false;
};

}  // namespace clamber
