#include "firmware_hal/codec/bus_host.hpp"

#include <algorithm>

namespace clamber {

JointCommand to_drive(const Mounting& mounting, const JointCommand& command) noexcept {
  return {mounting.direction * command.q + mounting.zero, mounting.direction * command.dq,
          command.kp, command.kd, mounting.direction * command.tau};
}

const char* to_string(LinkFault fault) noexcept {
  switch (fault) {
    case LinkFault::kNone:
      return "none";
    case LinkFault::kDriveError:
      return "drive error";
    case LinkFault::kDroppedOut:
      return "drive switched itself off";
    case LinkFault::kWatchdog:
      return "drive's watchdog has run out";
    case LinkFault::kNoReply:
      return "no reply while being enabled";
    case LinkFault::kHeartbeatLost:
      return "heartbeat lost";
    case LinkFault::kRebooted:
      return "drive rebooted";
    case LinkFault::kSdoAbort:
      return "configuration refused by the drive";
    case LinkFault::kSdoTimeout:
      return "configuration not answered";
    case LinkFault::kWrongDrive:
      return "not the configured drive";
  }
  return "?";
}

std::size_t BusHost::add_link(const Mounting& mounting) noexcept {
  links_[size_].mounting = mounting;
  return size_++;
}

void BusHost::store_reply(Link& link, double q, double dq, double tau, double temperature,
                          std::uint32_t flags) noexcept {
  const double direction = link.mounting.direction;
  link.state.q = direction * (q - link.mounting.zero);
  link.state.dq = direction * dq;
  link.state.tau = direction * tau;
  link.state.temperature = temperature;
  link.state.flags = flags;
  ++link.state.sequence;
  link.reply_tick = tick_;
  ++counters_.replies;
}

CodecStatus BusHost::count(CodecStatus status) noexcept {
  if (status == CodecStatus::kForeign)
    ++counters_.foreign;
  else if (status != CodecStatus::kOk && status != CodecStatus::kClamped)
    ++counters_.malformed;
  return status;
}

bool BusHost::replies_complete() const noexcept {
  return std::all_of(links_.begin(), links_.begin() + size_, [this](const Link& link) {
    return !link.expected || link.reply_tick == tick_;
  });
}

bool BusHost::all_on() const noexcept {
  return std::all_of(links_.begin(), links_.begin() + size_,
                     [](const Link& link) { return link.status.phase == LinkPhase::kOn; });
}

bool BusHost::all_off() const noexcept {
  return std::all_of(links_.begin(), links_.begin() + size_,
                     [](const Link& link) { return link.status.phase == LinkPhase::kOff; });
}

void BusHost::end_tick(std::span<JointState> states) noexcept {
  for (Link& link : std::span(links_).first(size_)) {
    if (link.expected && link.reply_tick != tick_) ++counters_.missing_replies;
    const auto joint = static_cast<std::size_t>(link.mounting.joint);
    if (joint >= states.size()) continue;
    JointState& state = states[joint];
    state = link.state;
    state.age = static_cast<std::uint32_t>(std::min<std::uint64_t>(ticks_since_reply(link), ~0u));
    if (link.status.phase == LinkPhase::kOn) state.flags |= kJointEnabled;
    if (link.status.phase == LinkPhase::kFault) state.flags |= kJointFault;
    if (link.saturated) state.flags |= kJointSaturated;
    if (state.age > 0 || link.reply_tick == 0) state.flags |= kJointStale;
  }
}

}  // namespace clamber
