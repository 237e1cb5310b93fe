// The motor bus over CAN: several buses, each a host (protocol) on a port (transport).
// enable(), exchange() and disable() from one thread; allocates: never; blocks: exchange() until
// the replies are in or the deadline is near, enable() and disable() for the times in
// CanBusSettings.
//
// What it promises about stale commands: a bus that is down or bus-off is given no frames, and one
// whose last frames are still unsent gets no new ones behind them, so at most one tick's frames can
// ever be late. Stopping takes back what the transport can take back, lets only "quick stop" and
// "off" follow, and after disable() nothing is sent at all.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "firmware_hal/codec/bus_host.hpp"
#include "firmware_hal/frame_port.hpp"
#include "firmware_hal/motor_bus.hpp"

namespace clamber {

inline constexpr std::size_t kMaxBuses = 16;

/// Sees every frame of the hosts' protocols, in lock step only. Same thread; must not throw.
class FrameObserver {
 public:
  virtual ~FrameObserver() = default;
  virtual void sent(std::size_t bus, const CanFrame& frame) noexcept = 0;
  virtual void received(std::size_t bus, const CanFrame& frame) noexcept = 0;
  virtual void tick_ended(std::uint64_t tick) noexcept = 0;
};

struct CanBusSettings {
  int joint_count = 0;
  double tick = 0.001;  ///< s
  /// Ticks end when the drives say so (lock_step.hpp), not by the clock.
  bool lock_step = false;
  FrameObserver* observer = nullptr;
  double reply_share = 0.95;       ///< of the time to the deadline: replies are waited for
  double send_share = 0.5;         ///< of the tick: frames still refused by then are given up
  double start_patience = 5.0;     ///< s for all joints to be read, and again to be enabled
  double quick_stop_time = 0.3;    ///< s of quick stop before the drives are switched off
  double off_patience = 0.1;       ///< s for the drives to confirm
  double partner_patience = 10.0;  ///< s of the clock without an answer in lock step
};

struct CanSegment {
  BusHost* host = nullptr;
  FramePort* port = nullptr;
};

/// Why the buses cannot be used.
enum class BusTrouble : std::uint8_t {
  kNone,
  kJointSilent,  ///< enable(): the joint's drive does not answer
  kDriveFault,   ///< enable(): see the drive's LinkStatus
  kNotEnabled,   ///< enable(): in time; see the drive's LinkStatus
  kNoBus,        ///< every bus is down or bus-off
  kNoPartner,    ///< lock step: the drives do not answer
  kGivenUp,      ///< enable(): whoever wanted it wants it no more
};

struct BusTroubleReport {
  BusTrouble what = BusTrouble::kNone;
  std::size_t bus = 0;
  int joint = -1;  ///< -1: the whole bus
  LinkStatus link;
};

struct SegmentCounters {
  std::uint64_t held_ticks = 0;     ///< ticks without frames: unsent ones would have been in front
  std::uint64_t unsent_frames = 0;  ///< given up: the interface had no room
  std::uint64_t late_replies = 0;   ///< came after their tick
  std::int64_t slowest_reply_ns = 0;  ///< from the start of a tick, of the replies in time
};

class CanMotorBus final : public MotorBus {
 public:
  /// Hosts, ports and clock must outlive it. At most kMaxBuses segments.
  CanMotorBus(const CanBusSettings& settings, PortClock& clock,
              std::span<const CanSegment> segments) noexcept;
  ~CanMotorBus() override;

  [[nodiscard]] int joint_count() const noexcept override { return settings_.joint_count; }
  /// Reads every joint without torque first; only then switches on. kDown: see trouble(); the
  /// drives are off again then.
  [[nodiscard]] BusStatus enable() noexcept override;
  void set_give_up(GiveUp asked) override { give_up_ = std::move(asked); }
  /// kLate: some joint gave no reply (its state says so). kDown: see trouble(). The first call
  /// after enable() passes no commands on: drives hold still, in position modes where they are.
  [[nodiscard]] BusStatus exchange(std::span<const JointCommand> commands,
                                   std::span<JointState> states,
                                   std::int64_t deadline_ns) noexcept override;
  /// From the next exchange() on; only disable() leads out of it.
  void quick_stop() noexcept;
  /// False when the drives of some bus cannot be told: they do what they are set to.
  [[nodiscard]] bool set_failure_policy(FailurePolicy policy) noexcept override;
  [[nodiscard]] double failure_policy_delay() const noexcept override;
  void disable() noexcept override;
  [[nodiscard]] BusCounters counters() const noexcept override;

  [[nodiscard]] const BusTroubleReport& trouble() const noexcept { return trouble_; }
  [[nodiscard]] std::size_t bus_count() const noexcept { return count_; }
  [[nodiscard]] const SegmentCounters& segment_counters(std::size_t bus) const noexcept {
    return segments_[bus].counters;
  }

 private:
  struct Segment {
    BusHost* host = nullptr;
    FramePort* port = nullptr;
    FrameList frames;
    std::size_t next = 0;    ///< of `frames`, to be offered
    bool sending = false;    ///< this tick's frames go out
    bool missed = false;     ///< last tick ended without all replies
    bool forced = false;     ///< the frames that stop the drives were queued behind unsent ones
    std::uint32_t done = 0;  ///< lock step: last "done"
    SegmentCounters counters;
  };

  [[nodiscard]] std::span<Segment> segments() noexcept { return {segments_.data(), count_}; }
  void set_goal(HostGoal goal) noexcept;
  [[nodiscard]] BusStatus tick(std::span<const JointCommand> commands, std::span<JointState> states,
                               std::int64_t deadline_ns) noexcept;
  /// A tick of enable() or disable(), on a grid of its own.
  [[nodiscard]] BusStatus own_tick() noexcept;
  void begin(Segment& segment, std::span<const JointCommand> commands) noexcept;
  [[nodiscard]] bool may_send(Segment& segment) noexcept;
  void offer(Segment& segment) noexcept;
  std::size_t receive(Segment& segment, bool late) noexcept;
  [[nodiscard]] static bool unsent(const Segment& segment) noexcept;
  [[nodiscard]] static bool finished(const Segment& segment) noexcept;
  void wait_for_replies(std::int64_t deadline_ns) noexcept;
  [[nodiscard]] bool wait_for_partner() noexcept;
  [[nodiscard]] bool greet_partner() noexcept;
  [[nodiscard]] bool answers_greeting(FramePort& port) noexcept;
  [[nodiscard]] bool read_all_joints() noexcept;
  [[nodiscard]] bool enable_all() noexcept;
  [[nodiscard]] bool find_fault() noexcept;
  [[nodiscard]] bool given_up() noexcept;
  [[nodiscard]] bool any_on() noexcept;
  void hold_position() noexcept;
  [[nodiscard]] std::size_t index_of(const Segment& segment) const noexcept {
    return static_cast<std::size_t>(&segment - segments_.data());
  }
  [[nodiscard]] std::uint64_t ticks(double seconds) const noexcept;

  CanBusSettings settings_;
  GiveUp give_up_;
  PortClock& clock_;
  std::array<Segment, kMaxBuses> segments_{};
  std::size_t count_ = 0;
  HostGoal goal_ = HostGoal::kOff;
  bool active_ = false;  ///< between enable() and disable()
  bool fresh_ = false;   ///< the next exchange() is the first
  std::uint32_t tick_ = 0;
  std::int64_t period_ns_;
  std::int64_t tick_start_ = 0;
  std::int64_t next_own_tick_ = 0;
  std::uint64_t exchanges_ = 0;
  BusTroubleReport trouble_;
  std::array<JointCommand, kMaxDrives * 2> commands_{};  ///< of own ticks
  std::array<JointState, kMaxDrives * 2> states_{};      ///< of own ticks
  std::array<ReceivedFrame, 64> inbox_{};
};

}  // namespace clamber
