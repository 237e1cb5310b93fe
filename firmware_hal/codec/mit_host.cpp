#include "firmware_hal/codec/mit_host.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

constexpr double kEnableTimeout = 0.5;  // s
// Replies in a row that must say so before a drive that is on is let go of: one alone may be
// garbled, and to switch off a joint that carries the robot is no small thing.
constexpr std::uint8_t kBelieved = 2;

}  // namespace

std::uint32_t MitHost::ticks(double seconds) const noexcept {
  return static_cast<std::uint32_t>(std::ceil(seconds / tick_seconds_));
}

bool MitHost::add_drive(const MitDrive& drive, const Mounting& mounting, double watchdog) noexcept {
  if (size_ == kMaxDrives) return false;
  Drive& added = drives_[add_link(mounting)];
  added.codec = drive;
  added.watchdog_ticks = ticks(watchdog);
  return true;
}

void MitHost::set_goal(HostGoal goal) noexcept {
  // A stop needs drives that are on; from anything else it is just "off".
  if (goal == HostGoal::kQuickStop && goal_ == HostGoal::kOff) return;
  if (goal == HostGoal::kOn && goal_ == HostGoal::kQuickStop) return;
  goal_ = goal;
}

bool MitHost::request_zero(std::size_t drive) noexcept {
  if (drive >= size_ || goal_ != HostGoal::kOff || links_[drive].status.phase != LinkPhase::kOff)
    return false;
  drives_[drive].zero = true;
  return true;
}

void MitHost::begin_tick(std::span<const JointCommand> commands, FrameList& out) noexcept {
  out.clear();
  for (std::size_t i = 0; i < size_; ++i) supervise(i);
  count_tick();
  for (std::size_t i = 0; i < size_; ++i) {
    Link& link = links_[i];
    link.expected = false;
    if (link.status.phase == LinkPhase::kZeroing) {
      if (--drives_[i].wait == 0) link.status.phase = LinkPhase::kOff;
      continue;
    }
    out.push(frame_for(i, commands));
    link.expected = link.status.phase != LinkPhase::kZeroing;
  }
}

/// What the last tick's replies, or their absence, mean.
void MitHost::supervise(std::size_t i) noexcept {
  Link& link = links_[i];
  Drive& drive = drives_[i];
  const bool active =
      link.status.phase == LinkPhase::kOn || link.status.phase == LinkPhase::kEnabling;
  const bool believed = drive.bad_replies >= kBelieved;
  if (active && believed && drive.error != 0) fail(link, LinkFault::kDriveError, drive.error);
  if (link.status.phase == LinkPhase::kOn && believed && !drive.enabled)
    fail(link, LinkFault::kDroppedOut);
  if (link.status.phase == LinkPhase::kOn && drive.watchdog_ticks > 0 &&
      ticks_since_reply(link) >= drive.watchdog_ticks)
    fail(link, LinkFault::kWatchdog);
  if (link.status.phase == LinkPhase::kEnabling && drive.wait > ticks(kEnableTimeout))
    fail(link, LinkFault::kNoReply);
}

CanFrame MitHost::frame_for(std::size_t i, std::span<const JointCommand> commands) noexcept {
  Link& link = links_[i];
  link.saturated = false;
  if (goal_ == HostGoal::kOff) return off_frame(i);
  switch (link.status.phase) {
    case LinkPhase::kOff:
    case LinkPhase::kEnabling:
      return goal_ == HostGoal::kOn ? enabling_frame(i) : off_frame(i);
    case LinkPhase::kOn:
      break;
    default:
      return encode_mit_special(drives_[i].codec, MitSpecial::kDisable);
  }
  if (goal_ == HostGoal::kQuickStop) {
    const MitRanges& ranges = drives_[i].codec.ranges;
    const double middle = 0.5 * (ranges.position.min + ranges.position.max);
    return command_frame(i, {middle, 0.0, 0.0, ranges.kd.max, 0.0});
  }
  const auto joint = static_cast<std::size_t>(link.mounting.joint);
  if (joint >= commands.size()) return command_frame(i, drives_[i].last);
  return command_frame(i, to_drive(link.mounting, commands[joint]));
}

CanFrame MitHost::off_frame(std::size_t i) noexcept {
  Link& link = links_[i];
  Drive& drive = drives_[i];
  link.status = {};
  drive.primed = false;
  if (drive.zero) {
    drive.zero = false;
    link.status.phase = LinkPhase::kZeroing;
    drive.wait = ticks(kMitZeroingSeconds);
    return encode_mit_special(drive.codec, MitSpecial::kSetZero);
  }
  if (drive.error != 0 && drive.codec.reply == MitReplyKind::kStateNibble) {
    drive.error = 0;  // asks once; the next reply tells whether it is gone
    return encode_mit_special(drive.codec, MitSpecial::kClearFault);
  }
  return encode_mit_special(drive.codec, MitSpecial::kDisable);
}

CanFrame MitHost::enabling_frame(std::size_t i) noexcept {
  Link& link = links_[i];
  Drive& drive = drives_[i];
  if (link.status.phase == LinkPhase::kOff) {
    // Only a joint whose position is known this very tick may be enabled.
    const bool fresh = link.reply_tick != 0 && ticks_since_reply(link) <= 1;
    if (!fresh || drive.error != 0) return encode_mit_special(drive.codec, MitSpecial::kDisable);
    if (!drive.primed) {
      drive.primed = true;
      return limp_frame(i);
    }
    link.status.phase = LinkPhase::kEnabling;
    drive.wait = 0;
    drive.enabled = false;
    return encode_mit_special(drive.codec, MitSpecial::kEnable);
  }
  ++drive.wait;
  if (drive.enabled) link.status.phase = LinkPhase::kOn;
  return limp_frame(i);
}

CanFrame MitHost::limp_frame(std::size_t i) noexcept {
  const Link& link = links_[i];
  JointCommand limp;
  limp.q = link.state.q;
  return command_frame(i, to_drive(link.mounting, limp));
}

CanFrame MitHost::command_frame(std::size_t i, const JointCommand& command) noexcept {
  Drive& drive = drives_[i];
  CanFrame frame;
  CodecStatus status = encode_mit_command(drive.codec, command, frame);
  if (status == CodecStatus::kNotFinite) {
    ++counters_.not_finite;
    status = encode_mit_command(drive.codec, drive.last, frame);
  } else {
    drive.last = command;
  }
  if (status == CodecStatus::kClamped) {
    ++counters_.clamped;
    links_[i].saturated = true;
  }
  return frame;
}

CodecStatus MitHost::receive(const CanFrame& frame) noexcept {
  CodecStatus best = CodecStatus::kForeign;
  for (std::size_t i = 0; i < size_; ++i) {
    MitReply reply;
    const CodecStatus status = decode_mit_reply(drives_[i].codec, frame, reply);
    if (status == CodecStatus::kOk) {
      Drive& drive = drives_[i];
      drive.enabled = reply.enabled;
      drive.error = reply.error;
      const bool bad = reply.error != 0 || !reply.enabled;
      drive.bad_replies = bad ? std::min<std::uint8_t>(drive.bad_replies, 254) + 1 : 0;
      const bool off = links_[i].status.phase == LinkPhase::kOff;
      const bool fault = reply.error != 0 && (off || drive.bad_replies >= kBelieved);
      store_reply(links_[i], reply.q, reply.dq, reply.tau, reply.temperature,
                  fault ? std::uint32_t{kJointFault} : std::uint32_t{0});
      return status;
    }
    if (status != CodecStatus::kForeign) best = status;
  }
  return count(best);
}

}  // namespace clamber
