// The host's side of one bus, protocol in, frames out: what a transport calls each tick.
// One thread; allocates: never; blocks: never. No sockets, no clock: time is counted in ticks.
//
//   host.begin_tick(commands, frames);            // send `frames`, in this order
//   while (!host.replies_complete()) host.receive(next frame);   // until the deadline
//   host.end_tick(states);
//
// Frames that come between end_tick() and begin_tick() may be given to receive() at any time: they
// update the joint, but count for the tick that is over.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "control/failure_policy.hpp"
#include "control/joint_types.hpp"
#include "firmware_hal/can_frame.hpp"
#include "firmware_hal/codec/codec_status.hpp"

namespace clamber {

inline constexpr std::size_t kMaxDrives = 32;

/// Frames to send, in order. What does not fit is counted, not sent.
class FrameList {
 public:
  void clear() noexcept { size_ = 0; }
  void push(const CanFrame& frame) noexcept {
    if (size_ < frames_.size())
      frames_[size_++] = frame;
    else
      ++dropped_;
  }
  [[nodiscard]] std::span<const CanFrame> frames() const noexcept {
    return {frames_.data(), size_};
  }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  std::array<CanFrame, 4 * kMaxDrives> frames_;
  std::size_t size_ = 0;
  std::uint64_t dropped_ = 0;
};

/// How the joint's values relate to its drive's: joint = direction * (drive - zero).
struct Mounting {
  int joint = 0;           ///< index in the robot's joint order
  double direction = 1.0;  ///< 1 or -1
  double zero = 0.0;       ///< rad
};
[[nodiscard]] JointCommand to_drive(const Mounting& mounting, const JointCommand& command) noexcept;

enum class HostGoal : std::uint8_t {
  kOff,        ///< no torque; joints are still read
  kOn,         ///< drives enabled, commands passed on
  kQuickStop,  ///< drives brought to rest by their own means and kept from falling freely if they
               ///< can
};

enum class LinkPhase : std::uint8_t {
  kOff,       ///< not enabled (cia402: configured, process data running)
  kStarting,  ///< cia402: being found and configured
  kEnabling,
  kOn,
  kFault,    ///< latched until the goal has been kOff
  kZeroing,  ///< mit: deaf while it stores its zero
};

enum class LinkFault : std::uint8_t {
  kNone,
  kDriveError,     ///< the drive reports an error: see code
  kDroppedOut,     ///< the drive left its enabled state by itself
  kWatchdog,       ///< no reply for longer than the drive's watchdog: by now it is limp
  kNoReply,        ///< did not answer while being enabled
  kHeartbeatLost,  ///< cia402
  kRebooted,       ///< cia402: boot-up message of a running node
  kSdoAbort,       ///< cia402: the drive refuses its configuration; code: the abort code
  kSdoTimeout,     ///< cia402
  kWrongDrive,     ///< cia402: it is not what the configuration says; code: the object's index
};
[[nodiscard]] const char* to_string(LinkFault fault) noexcept;

struct LinkStatus {
  LinkPhase phase = LinkPhase::kOff;
  LinkFault fault = LinkFault::kNone;
  std::uint32_t code = 0;  ///< belongs to the fault
};

struct HostCounters {
  std::uint64_t replies = 0;
  std::uint64_t missing_replies = 0;
  std::uint64_t foreign = 0;           ///< frames of nobody on this bus
  std::uint64_t malformed = 0;         ///< right id, wrong format, length or content
  std::uint64_t clamped = 0;           ///< commands beyond a drive's range
  std::uint64_t policies_refused = 0;  ///< a drive did not take a failure policy
  std::uint64_t not_finite = 0;  ///< commands that were not numbers: the last good one was repeated
};

class BusHost {
 public:
  BusHost() = default;
  BusHost(const BusHost&) = delete;
  BusHost& operator=(const BusHost&) = delete;
  virtual ~BusHost() = default;

  /// From kOff to kOn also resets faults in the drives. From kQuickStop only kOff is accepted, from
  /// kOff no kQuickStop: such calls change nothing. Only kOn ever leads to an enabling frame.
  virtual void set_goal(HostGoal goal) noexcept = 0;
  /// What the drives shall do when this host falls silent. They are told one after the other, all
  /// of them within policy_ticks(). @return false: they cannot be told
  [[nodiscard]] virtual bool set_failure_policy(FailurePolicy /*policy*/) noexcept { return false; }
  [[nodiscard]] virtual std::uint32_t policy_ticks() const noexcept { return 0; }
  /// Counts a tick and lists the frames to send in it. `commands` in the robot's joint order.
  virtual void begin_tick(std::span<const JointCommand> commands, FrameList& out) noexcept = 0;
  /// Takes any frame at all. @return kOk: it was a drive's and has been used
  virtual CodecStatus receive(const CanFrame& frame) noexcept = 0;

  /// True when every drive that owes a reply in this tick has given it.
  [[nodiscard]] bool replies_complete() const noexcept;
  /// Writes the states of this bus's joints and counts the replies that did not come.
  void end_tick(std::span<JointState> states) noexcept;

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// By drive, 0 to size() - 1, in the order of the bus map.
  [[nodiscard]] LinkStatus status(std::size_t drive) const noexcept { return links_[drive].status; }
  [[nodiscard]] int joint(std::size_t drive) const noexcept { return links_[drive].mounting.joint; }
  /// True when every drive is on (after set_goal(kOn)) or none is.
  [[nodiscard]] bool all_on() const noexcept;
  [[nodiscard]] bool all_off() const noexcept;
  [[nodiscard]] const HostCounters& counters() const noexcept { return counters_; }

 protected:
  struct Link {
    Mounting mounting;
    LinkStatus status;
    JointState state;              ///< of the joint; flags of the drive only
    std::uint64_t reply_tick = 0;  ///< tick of the last reply; 0: none ever
    bool expected = false;         ///< owes a reply in this tick
    bool saturated = false;        ///< the last command was clamped
  };

  std::size_t add_link(const Mounting& mounting) noexcept;
  void count_tick() noexcept { ++tick_; }
  /// Stores what a reply says about the joint; values are the drive's.
  void store_reply(Link& link, double q, double dq, double tau, double temperature,
                   std::uint32_t flags) noexcept;
  [[nodiscard]] std::uint64_t ticks_since_reply(const Link& link) const noexcept {
    return tick_ - link.reply_tick;
  }
  CodecStatus count(CodecStatus status) noexcept;
  static void fail(Link& link, LinkFault fault, std::uint32_t code = 0) noexcept {
    if (link.status.phase != LinkPhase::kFault) link.status = {LinkPhase::kFault, fault, code};
  }

  std::array<Link, kMaxDrives> links_{};
  std::size_t size_ = 0;
  std::uint64_t tick_ = 0;  ///< 1 in the first
  HostCounters counters_;
};

}  // namespace clamber
