// The host of a bus of MIT drives. One thread; allocates: never; blocks: never.
//
// Off: every tick a "disable" command, which is answered, so joints are read without torque.
// On: a limp setpoint at the measured position first (some firmware keeps the last setpoint and
// would kick with it), then "enable", limp setpoints until the drive answers, then commands.
// Quick stop: MIT drives have none, so the host damps with the drive's largest kd.
#pragma once

#include "firmware_hal/codec/bus_host.hpp"
#include "firmware_hal/codec/mit.hpp"

namespace clamber {

class MitHost final : public BusHost {
 public:
  /// @param tick s between ticks
  explicit MitHost(double tick) noexcept : tick_seconds_(tick) {}
  /// @param watchdog s without a command until the drive goes limp; 0: never. Up to kMaxDrives;
  ///   further ones are refused. @return false: refused
  [[nodiscard]] bool add_drive(const MitDrive& drive, const Mounting& mounting,
                               double watchdog) noexcept;

  void set_goal(HostGoal goal) noexcept override;
  void begin_tick(std::span<const JointCommand> commands, FrameList& out) noexcept override;
  CodecStatus receive(const CanFrame& frame) noexcept override;

  /// Makes the drive's present position its zero, then leaves it alone for kMitZeroingSeconds.
  /// @return false: the drive is not off
  [[nodiscard]] bool request_zero(std::size_t drive) noexcept;

 private:
  struct Drive {
    MitDrive codec;
    JointCommand last;  ///< the drive's values
    std::uint32_t watchdog_ticks = 0;
    std::uint32_t wait = 0;  ///< ticks in the present phase
    bool primed = false;     ///< the limp setpoint has been sent
    bool zero = false;
    bool enabled = false;  ///< as reported
    std::uint8_t error = 0;
    std::uint8_t bad_replies = 0;  ///< in a row that say that something is wrong
  };

  [[nodiscard]] std::uint32_t ticks(double seconds) const noexcept;
  [[nodiscard]] CanFrame frame_for(std::size_t i, std::span<const JointCommand> commands) noexcept;
  [[nodiscard]] CanFrame off_frame(std::size_t i) noexcept;
  [[nodiscard]] CanFrame enabling_frame(std::size_t i) noexcept;
  [[nodiscard]] CanFrame command_frame(std::size_t i, const JointCommand& command) noexcept;
  [[nodiscard]] CanFrame limp_frame(std::size_t i) noexcept;
  void supervise(std::size_t i) noexcept;

  double tick_seconds_;
  HostGoal goal_ = HostGoal::kOff;
  std::array<Drive, kMaxDrives> drives_{};
};

}  // namespace clamber
