#include "firmware_hal/codec/cia402_host.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

constexpr double kSdoTimeout = 0.1;  // s
constexpr std::uint8_t kSdoAttempts = 3;
constexpr std::uint16_t kLostHostObject = 0x6007;
constexpr double kCallInterval = 0.5;   // s between attempts to find a silent drive
constexpr double kEnableTimeout = 1.0;  // s
constexpr double kReplyTimeout = 0.05;  // s without process data of a running drive

/// Does the drive's answer to a reading step fit the configuration?
bool answer_fits(const Cia402Drive& drive, double rated_motor_torque, std::uint16_t index,
                 std::uint32_t value) noexcept {
  switch (index) {
    case 0x1000:
      return (value & 0xFFFF) == 402;
    case 0x6502: {
      // Bit n - 1 stands for mode n.
      const int bit = static_cast<int>(drive.mode) - 1;
      return (value >> bit & 1u) != 0;
    }
    case 0x6076:  // mN m; a hundredth of it is more than rounding can explain
      return std::abs(value - 1e3 * rated_motor_torque) <= 10.0 * rated_motor_torque + 1.0;
    default:
      return true;
  }
}

}  // namespace

Cia402Host::Cia402Host(const Cia402HostSettings& settings) noexcept
    : settings_(settings), heartbeat_ticks_(std::max(1u, ticks(settings.heartbeat))) {}

std::uint32_t Cia402Host::ticks(double seconds) const noexcept {
  // A multiple of the tick that is not exact in binary must not become one tick more.
  return static_cast<std::uint32_t>(std::ceil(seconds / settings_.tick - 1e-6));
}

bool Cia402Host::add_drive(const Cia402Drive& drive, const Mounting& mounting,
                           double rated_motor_torque) noexcept {
  if (size_ == kMaxDrives) return false;
  Link& link = links_[size_];
  Drive& added = drives_[add_link(mounting)];
  added.codec = drive;
  added.rated_motor_torque = rated_motor_torque;
  link.status.phase = LinkPhase::kStarting;
  return true;
}

void Cia402Host::set_goal(HostGoal goal) noexcept {
  if (goal == HostGoal::kQuickStop && goal_ == HostGoal::kOff) return;
  if (goal == HostGoal::kOn && goal_ == HostGoal::kQuickStop) return;
  if (goal == HostGoal::kOn && goal_ == HostGoal::kOff)
    for (Drive& drive : drives_) drive.reset_fault = drive.state == Cia402State::kFault;
  goal_ = goal;
}

void Cia402Host::begin_tick(std::span<const JointCommand> commands, FrameList& out) noexcept {
  out.clear();
  for (std::size_t i = 0; i < size_; ++i) supervise(i);
  count_tick();
  // First, while the bus is free: with its low priority it would hold up, at the end of the queue,
  // the next tick's commands behind all that is sent meanwhile.
  if ((tick_ - 1) % heartbeat_ticks_ == 0)
    out.push(encode_heartbeat(settings_.node, NmtState::kOperational));
  bool running = false;
  for (std::size_t i = 0; i < size_; ++i) {
    links_[i].expected = drives_[i].stage == Stage::kRunning;
    links_[i].saturated = false;
    if (!links_[i].expected) continue;
    command(i, commands, out);
    running = true;
  }
  if (running) out.push(encode_sync());
  for (std::size_t i = 0; i < size_; ++i)
    if (drives_[i].stage != Stage::kRunning) bring_up(i, out);
  const bool off_beat = (tick_ - 1) % heartbeat_ticks_ == heartbeat_ticks_ / 2;
  if (policy_ && off_beat) tell_policy(out);
}

bool Cia402Host::set_failure_policy(FailurePolicy policy) noexcept {
  if (policy_ != policy)
    for (Drive& drive : drives_) drive.policy_attempts = 0;
  policy_ = policy;
  return true;
}

std::uint32_t Cia402Host::policy_ticks() const noexcept {
  return heartbeat_ticks_ * (static_cast<std::uint32_t>(size_) + 1);
}

std::uint16_t Cia402Host::policy_code(const Drive& drive, FailurePolicy policy) noexcept {
  if (policy == FailurePolicy::kLimp) return static_cast<std::uint16_t>(LostHostReaction::kDisable);
  if (policy == FailurePolicy::kLower && drive.codec.lower_option != 0)
    return static_cast<std::uint16_t>(drive.codec.lower_option);
  return static_cast<std::uint16_t>(LostHostReaction::kQuickStop);
}

/// Asks the first drive that does not have the policy yet. One that does not answer is asked again
/// in its turn, as often as a step of the configuration.
void Cia402Host::tell_policy(FrameList& out) noexcept {
  const auto fewer_attempts = [](const Drive& a, const Drive& b) {
    return a.policy_attempts < b.policy_attempts;
  };
  Drive* next = nullptr;
  for (Drive& drive : std::span(drives_).first(size_)) {
    const bool waits = drive.stage == Stage::kRunning && drive.policy_attempts < kSdoAttempts &&
                       drive.policy_code != policy_code(drive, *policy_);
    if (waits && (next == nullptr || fewer_attempts(drive, *next))) next = &drive;
  }
  if (next == nullptr) return;
  if (++next->policy_attempts == kSdoAttempts) ++counters_.policies_refused;
  next->policy_asked = policy_code(*next, *policy_);
  Sdo sdo;
  sdo.kind = SdoKind::kDownload;
  sdo.node = next->codec.node;
  sdo.index = kLostHostObject;
  sdo.size = 2;
  sdo.value = next->policy_asked;
  out.push(encode_sdo(sdo, true));
}

void Cia402Host::take_policy_answer(Drive& drive, SdoKind answer) noexcept {
  if (drive.policy_attempts == 0) return;  // not asked
  if (answer == SdoKind::kDownloadReply) {
    if (drive.policy_attempts == kSdoAttempts) --counters_.policies_refused;
    drive.policy_attempts = 0;
    drive.policy_code = drive.policy_asked;
  } else if (answer == SdoKind::kAbort && drive.policy_attempts < kSdoAttempts) {
    drive.policy_attempts = kSdoAttempts;
    ++counters_.policies_refused;
  }
}

void Cia402Host::supervise(std::size_t i) noexcept {
  Link& link = links_[i];
  Drive& drive = drives_[i];
  const bool lost =
      drive.heard && tick_ - drive.heartbeat_tick > ticks(kHeartbeatPatience * settings_.heartbeat);
  if (lost && link.status.fault != LinkFault::kHeartbeatLost) fail(link, LinkFault::kHeartbeatLost);
  if (link.status.phase == LinkPhase::kFault) {
    if (goal_ != HostGoal::kOff) return;
    // The operator has let go. A drive that is gone, new or misconfigured starts from the
    // beginning.
    const bool restart = drive.stage != Stage::kRunning || lost;
    link.status = {};
    if (!restart) return;
    drive.stage = Stage::kSilent;
    drive.wait = 0;
    drive.heard = false;
    drive.emergency = {};
    link.status.phase = LinkPhase::kStarting;
    return;
  }
  if (drive.stage != Stage::kRunning) return;
  const bool on = link.status.phase == LinkPhase::kOn;
  const bool active = on || link.status.phase == LinkPhase::kEnabling;
  if (active && drive.emergency.error_register != 0)
    fail(link, LinkFault::kDriveError, drive.emergency.code);
  else if (active && drive.state == Cia402State::kFault && !drive.reset_fault)
    fail(link, LinkFault::kDriveError, drive.emergency.code);
  else if (active && ticks_since_reply(link) > ticks(kReplyTimeout))
    fail(link, LinkFault::kNoReply);
  else if (on && goal_ == HostGoal::kOn && drive.state != Cia402State::kEnabled)
    fail(link, LinkFault::kDroppedOut);
  else if (link.status.phase == LinkPhase::kEnabling && drive.wait > ticks(kEnableTimeout))
    fail(link, LinkFault::kNoReply);
}

void Cia402Host::bring_up(std::size_t i, FrameList& out) noexcept {
  Drive& drive = drives_[i];
  if (links_[i].status.phase == LinkPhase::kFault) return;
  switch (drive.stage) {
    case Stage::kSilent:
      // Not every drive has heartbeats before it is configured: whether it is there shows when it
      // answers the first question.
      if (drive.wait++ % ticks(kCallInterval) != 0) break;
      out.push(encode_nmt(NmtCommand::kPreOperational, drive.codec.node));
      drive.stage = Stage::kConfiguring;
      drive.step = 0;
      drive.asked = false;
      drive.attempts = 0;
      break;
    case Stage::kConfiguring:
      configure(i, out);
      break;
    case Stage::kStarting:
      if (drive.wait++ % ticks(kCallInterval) == 0)
        out.push(encode_nmt(NmtCommand::kStart, drive.codec.node));
      break;
    case Stage::kRunning:
      break;
  }
}

void Cia402Host::configure(std::size_t i, FrameList& out) noexcept {
  Drive& drive = drives_[i];
  if (drive.asked && ++drive.wait < ticks(kSdoTimeout)) return;
  if (drive.asked && drive.step == 0) {
    drive.stage = Stage::kSilent;  // nobody there yet: call again
    drive.wait = 1;
    return;
  }
  if (drive.asked && ++drive.attempts >= kSdoAttempts) {
    const SdoStep step = cia402_step(drive.codec, settings_, drive.step);
    fail(links_[i], LinkFault::kSdoTimeout, step.index);
    return;
  }
  const SdoStep step = cia402_step(drive.codec, settings_, drive.step);
  Sdo sdo;
  sdo.kind = step.size == 0 ? SdoKind::kUpload : SdoKind::kDownload;
  sdo.node = drive.codec.node;
  sdo.index = step.index;
  sdo.sub = step.sub;
  sdo.size = step.size;
  sdo.value = step.value;
  out.push(encode_sdo(sdo, true));
  drive.asked = true;
  drive.wait = 0;
}

void Cia402Host::command(std::size_t i, std::span<const JointCommand> commands,
                         FrameList& out) noexcept {
  Link& link = links_[i];
  Drive& drive = drives_[i];
  Cia402Command command;
  // Nothing moves until the drive has said that it is enabled and the caller could see it.
  const bool passing = link.status.phase == LinkPhase::kOn && goal_ == HostGoal::kOn;
  command.controlword = controlword(i);
  const Cia402Command wanted = passing ? setpoint(i, commands) : Cia402Command{};
  command.tau = wanted.tau;
  command.q = passing ? wanted.q : drive.counts / drive.codec.counts_per_radian;
  CanFrame frame;
  CodecStatus status = encode_cia402_command(drive.codec, command, frame);
  if (status == CodecStatus::kNotFinite) {
    ++counters_.not_finite;
    drive.last.controlword = command.controlword;
    status = encode_cia402_command(drive.codec, drive.last, frame);
  } else {
    drive.last = command;
  }
  if (status == CodecStatus::kClamped) {
    ++counters_.clamped;
    link.saturated = true;
  }
  out.push(frame);
}

std::uint16_t Cia402Host::controlword(std::size_t i) noexcept {
  Link& link = links_[i];
  Drive& drive = drives_[i];
  if (goal_ == HostGoal::kOff || link.status.phase == LinkPhase::kFault) {
    if (goal_ == HostGoal::kOff) link.status = {};
    // Whatever is wrong with it, a drive that still gives torque stops and holds by itself until
    // the operator switches it off: to let go would drop what it carries.
    const bool holds =
        drive.state == Cia402State::kEnabled || drive.state == Cia402State::kQuickStop;
    return goal_ != HostGoal::kOff && holds ? kControlQuickStop : kControlDisableVoltage;
  }
  if (goal_ == HostGoal::kQuickStop) {
    const bool moving =
        drive.state == Cia402State::kEnabled || drive.state == Cia402State::kQuickStop;
    if (!moving) link.status.phase = LinkPhase::kOff;
    return moving ? kControlQuickStop : kControlDisableVoltage;
  }
  if (link.status.phase == LinkPhase::kOff) {
    if (link.reply_tick == 0 || ticks_since_reply(link) > 1) return kControlDisableVoltage;
    link.status.phase = LinkPhase::kEnabling;
    drive.wait = 0;
  }
  ++drive.wait;
  if (drive.reset_fault) {
    drive.reset_fault = false;
    drive.emergency = {};
    return kControlFaultReset;
  }
  if (drive.state == Cia402State::kEnabled) link.status.phase = LinkPhase::kOn;
  return controlword_towards_enabled(drive.state);
}

/// The drive law of joint_types.hpp: what the drive's mode does not do the host adds as torque.
Cia402Command Cia402Host::setpoint(std::size_t i,
                                   std::span<const JointCommand> commands) const noexcept {
  const Link& link = links_[i];
  const Drive& drive = drives_[i];
  const auto joint = static_cast<std::size_t>(link.mounting.joint);
  if (joint >= commands.size()) return drive.last;
  const JointCommand& wanted = commands[joint];
  Cia402Command command;
  const JointCommand mounted = to_drive(link.mounting, wanted);
  command.q = mounted.q;
  command.tau = mounted.tau;
  if (drive.codec.mode == Cia402Mode::kCyclicTorque) {
    const double stiffness = wanted.kp * (wanted.q - link.state.q);
    const double damping = wanted.kd * (wanted.dq - link.state.dq);
    command.tau += link.mounting.direction * (stiffness + damping);
  }
  return command;
}

std::size_t Cia402Host::find(std::uint8_t node) const noexcept {
  for (std::size_t i = 0; i < size_; ++i)
    if (drives_[i].codec.node == node) return i;
  return size_;
}

CodecStatus Cia402Host::receive(const CanFrame& frame) noexcept {
  CanopenId id;
  const CodecStatus status = classify_canopen(frame, id);
  if (status != CodecStatus::kOk) return count(status);
  const std::size_t i = find(id.node);
  if (i == size_) return count(CodecStatus::kForeign);
  switch (id.kind) {
    case CanopenKind::kTpdo:
      return count(id.pdo == 1 ? take_reply(i, frame) : CodecStatus::kForeign);
    case CanopenKind::kHeartbeat: {
      std::uint8_t node = 0;
      NmtState state = NmtState::kBoot;
      const CodecStatus read = decode_heartbeat(frame, node, state);
      if (read == CodecStatus::kOk) take_heartbeat(i, state);
      return count(read);
    }
    case CanopenKind::kEmergency: {
      Emergency emergency;
      const CodecStatus read = decode_emergency(frame, emergency);
      if (read == CodecStatus::kOk) take_emergency(i, emergency);
      return count(read);
    }
    case CanopenKind::kSdoReply: {
      Sdo sdo;
      bool request = false;
      const CodecStatus read = decode_sdo(frame, sdo, request);
      if (read == CodecStatus::kOk) take_sdo(i, sdo);
      return count(read);
    }
    default:
      return count(CodecStatus::kForeign);
  }
}

void Cia402Host::take_heartbeat(std::size_t i, NmtState state) noexcept {
  Drive& drive = drives_[i];
  Link& link = links_[i];
  drive.heartbeat_tick = tick_;
  if (state == NmtState::kBoot) {
    // Its configuration is gone. A drive that was in use has dropped its joint as well.
    const bool used =
        link.status.phase == LinkPhase::kOn || link.status.phase == LinkPhase::kEnabling;
    drive.stage = Stage::kSilent;
    drive.state = Cia402State::kNotReady;
    drive.wait = 0;
    drive.counted = false;
    drive.heard = false;  // it beats again once it has been told to
    if (used)
      fail(link, LinkFault::kRebooted);
    else if (link.status.phase == LinkPhase::kOff)
      link.status.phase = LinkPhase::kStarting;
    return;
  }
  // Heartbeats of the drive's former configuration, if any, say nothing about the new period.
  if (drive.stage == Stage::kStarting || drive.stage == Stage::kRunning) drive.heard = true;
  if (drive.stage == Stage::kStarting && state == NmtState::kOperational) {
    drive.stage = Stage::kRunning;
    if (link.status.phase == LinkPhase::kStarting) link.status = {};
    return;
  }
  if (drive.stage == Stage::kRunning && state != NmtState::kOperational)
    fail(link, LinkFault::kDroppedOut);
}

void Cia402Host::take_sdo(std::size_t i, const Sdo& sdo) noexcept {
  Drive& drive = drives_[i];
  if (drive.stage == Stage::kRunning && sdo.index == kLostHostObject)
    take_policy_answer(drive, sdo.kind);
  if (drive.stage != Stage::kConfiguring || !drive.asked) return;
  const SdoStep step = cia402_step(drive.codec, settings_, drive.step);
  if (sdo.index != step.index || sdo.sub != step.sub) return;  // an answer to an earlier question
  if (sdo.kind == SdoKind::kAbort) {
    if (!step.optional) {
      fail(links_[i], LinkFault::kSdoAbort, sdo.value);
      return;
    }
  } else if (step.size == 0) {
    if (sdo.kind != SdoKind::kUploadReply) return;
    if (!answer_fits(drive.codec, drive.rated_motor_torque, step.index, sdo.value)) {
      fail(links_[i], LinkFault::kWrongDrive, step.index);
      return;
    }
  } else if (sdo.kind != SdoKind::kDownloadReply) {
    return;
  }
  drive.asked = false;
  drive.attempts = 0;
  if (++drive.step < cia402_step_count(drive.codec)) return;
  drive.stage = Stage::kStarting;
  drive.wait = 0;
  drive.policy_code.reset();
  drive.policy_attempts = 0;
}

CodecStatus Cia402Host::take_reply(std::size_t i, const CanFrame& frame) noexcept {
  Drive& drive = drives_[i];
  Link& link = links_[i];
  Cia402Reply reply;
  const CodecStatus status = decode_cia402_reply(drive.codec, frame, reply);
  if (status != CodecStatus::kOk) return status;
  // Not configured by this host: its mapping may be any.
  if (drive.stage != Stage::kRunning) return CodecStatus::kOk;
  // One reply alone may be garbled: a drive that may be on is believed to have left its state when
  // two in a row name the same other one. ("Not ready" is also what no state at all reads as.)
  const Cia402State seen = state_of(reply.statusword);
  const bool may_be_on =
      link.status.phase == LinkPhase::kOn || link.status.phase == LinkPhase::kFault;
  const bool repeated = seen == drive.seen && seen != Cia402State::kNotReady;
  if (!may_be_on || repeated) drive.state = seen;
  drive.seen = seen;
  // The reply has no velocity: the difference of counts over the ticks between two replies.
  double dq = link.mounting.direction * link.state.dq;
  const std::uint64_t passed = ticks_since_reply(link);
  if (!drive.counted) {
    dq = 0.0;
  } else if (passed > 0) {
    // Modulo 2^32, as the counter itself runs.
    const auto moved = static_cast<std::int32_t>(static_cast<std::uint32_t>(reply.counts) -
                                                 static_cast<std::uint32_t>(drive.counts));
    dq = moved / drive.codec.counts_per_radian / (static_cast<double>(passed) * settings_.tick);
  }
  drive.counts = reply.counts;
  drive.counted = true;
  std::uint32_t flags = 0;
  if (drive.state == Cia402State::kFault || drive.state == Cia402State::kFaultReaction)
    flags |= kJointFault;
  if ((reply.statusword & kStatusInternalLimit) != 0) flags |= kJointSaturated;
  store_reply(link, reply.q, dq, reply.tau, 0.0, flags);
  return CodecStatus::kOk;
}

void Cia402Host::take_emergency(std::size_t i, const Emergency& emergency) noexcept {
  drives_[i].emergency = emergency.code == kEmergencyReset ? Emergency{} : emergency;
}

}  // namespace clamber
