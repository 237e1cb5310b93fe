// The firmware of a drive that speaks the MIT protocol. Threads and heap: see virtual_drive.hpp.
//
// Every command is answered at once with what the sensors read. The torque law runs here, at every
// step, with the last setpoint. Silence beyond the watchdog: a drive that reports states (Damiao)
// goes to its error "communication lost" and lets go, another zeroes its setpoint and is limp until
// the next one. As real firmware does, it keeps its last setpoint over "disable" and "enable".
#pragma once

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/codec/mit.hpp"
#include "firmware_hal/virtual_drives/virtual_drive.hpp"

namespace clamber {

class VirtualMitDrive final : public VirtualDrive {
 public:
  /// @param watchdog s without a command; 0: none
  VirtualMitDrive(const MitDrive& codec, double watchdog, const WindingHeat& heat,
                  double step) noexcept;

  void receive(const CanFrame& frame) noexcept override;
  [[nodiscard]] double torque() noexcept override;
  void pass() noexcept override;
  [[nodiscard]] DrivePower power() const noexcept override;

  void power_cycle(double seconds) noexcept override;
  void break_down(std::uint32_t code) noexcept override;

  [[nodiscard]] std::uint8_t error() const noexcept { return error_; }

 private:
  void take_special(MitSpecial special) noexcept;
  void reply() noexcept;
  [[nodiscard]] bool reports_state() const noexcept {
    return codec_.reply == MitReplyKind::kStateNibble;
  }

  MitDrive codec_;
  std::uint32_t watchdog_steps_;
  JointCommand setpoint_;
  bool enabled_ = false;
  bool dropped_ = false;
  bool limp_ = false;  ///< enabled, but the setpoint is too old
  std::uint8_t error_ = 0;
  std::uint32_t silence_ = 0;  ///< steps since the last command
  std::uint32_t deaf_ = 0;     ///< steps until it listens again
};

}  // namespace clamber
