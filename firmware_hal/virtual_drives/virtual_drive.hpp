// A drive's firmware, simulated: frames in, frames and torque out.
// One thread; allocates: never once made; blocks: never. No clock: pass() is its time.
//
//   drive.receive(frame);           // any frame of its bus; answers go to outbox()
//   plant.step(drive.torque());     // the inner loop: the torque for the step that begins
//   drive.sense(motion);            // what its encoder and current sensors read after it
//   drive.pass();                   // its clock goes on by a step: watchdog, heat, heartbeats
//
// Positions and torques are the drive's own: what its mounting makes of them is the plant's side.
#pragma once

#include <cstdint>

#include "firmware_hal/can_frame.hpp"
#include "firmware_hal/codec/bus_host.hpp"
#include "firmware_hal/virtual_drives/joint_plant.hpp"
#include "firmware_hal/virtual_drives/winding.hpp"

namespace clamber {

enum class DrivePower : std::uint8_t {
  kOff,      ///< its host has let go of it, or never took it
  kOn,       ///< it gives torque as it is told, or holds by itself (quick stop)
  kDropped,  ///< it was on and has let go by itself: limp until its host comes for it
};

struct DriveTraffic {
  std::uint64_t heard = 0;      ///< frames meant for this drive
  std::uint64_t malformed = 0;  ///< of these: not what the protocol says; ignored
};

class VirtualDrive {
 public:
  VirtualDrive(const WindingHeat& heat, double step) noexcept : winding_(heat), step_(step) {}
  VirtualDrive(const VirtualDrive&) = delete;
  VirtualDrive& operator=(const VirtualDrive&) = delete;
  virtual ~VirtualDrive() = default;

  virtual void receive(const CanFrame& frame) noexcept = 0;
  /// N m for the coming step, saturated.
  [[nodiscard]] virtual double torque() noexcept = 0;
  virtual void pass() noexcept = 0;
  void sense(const JointMotion& motion) noexcept { motion_ = motion; }

  [[nodiscard]] virtual DrivePower power() const noexcept = 0;
  /// Frames to send, oldest first; whoever sends them clears it.
  [[nodiscard]] FrameList& outbox() noexcept { return outbox_; }
  [[nodiscard]] double temperature() const noexcept { return winding_.temperature(); }
  [[nodiscard]] const DriveTraffic& traffic() const noexcept { return traffic_; }
  /// What its encoder adds to the truth (set_zero, a jump).
  [[nodiscard]] double encoder_offset() const noexcept { return encoder_offset_; }

  // ---- mischief, for rehearsing faults
  /// Power off and on: everything forgotten, no frames for so long (s).
  virtual void power_cycle(double seconds) noexcept = 0;
  /// The drive finds something wrong with itself and lets go. @param code of its protocol: MIT
  /// error, CiA 402 error code (603Fh); 0: the protocol's code for "short circuit" (over-current)
  virtual void break_down(std::uint32_t code) noexcept = 0;
  /// The encoder loses count.
  void jump_encoder(double radians) noexcept { encoder_offset_ += radians; }
  void set_temperature(double celsius) noexcept { winding_.set_temperature(celsius); }

 protected:
  [[nodiscard]] double q() const noexcept { return motion_.q + encoder_offset_; }
  [[nodiscard]] double dq() const noexcept { return motion_.dq; }
  [[nodiscard]] double measured_torque() const noexcept { return motion_.tau; }
  [[nodiscard]] double step() const noexcept { return step_; }

  Winding winding_;
  FrameList outbox_;
  DriveTraffic traffic_;
  double encoder_offset_ = 0.0;

 private:
  double step_;  ///< s
  JointMotion motion_;
};

}  // namespace clamber
