#include "firmware_hal/can_motor_bus.hpp"

#include <algorithm>
#include <cmath>

#include "firmware_hal/lock_step.hpp"

namespace clamber {
namespace {

constexpr std::int64_t kOfferAgain = 100'000;           // ns, where an interface had no room
constexpr std::int64_t kGreetingInterval = 50'000'000;  // ns

// Ticks in a row in which all joints must be read before they are switched on: a lucky one is not
// enough, and drives with an old error have time to be told to forget it.
constexpr int kReadTicks = 5;

constexpr std::ptrdiff_t index(std::size_t i) noexcept { return static_cast<std::ptrdiff_t>(i); }

constexpr std::int64_t nanoseconds(double seconds) noexcept {
  return static_cast<std::int64_t>(seconds * 1e9);
}

}  // namespace

CanMotorBus::CanMotorBus(const CanBusSettings& settings, PortClock& clock,
                         std::span<const CanSegment> segments) noexcept
    : settings_(settings), clock_(clock), period_ns_(nanoseconds(settings.tick)) {
  for (const CanSegment& segment : segments.first(std::min(segments.size(), kMaxBuses))) {
    segments_[count_].host = segment.host;
    segments_[count_].port = segment.port;
    ++count_;
  }
}

CanMotorBus::~CanMotorBus() { disable(); }

std::uint64_t CanMotorBus::ticks(double seconds) const noexcept {
  return static_cast<std::uint64_t>(std::ceil(seconds / settings_.tick));
}

void CanMotorBus::set_goal(HostGoal goal) noexcept {
  goal_ = goal;
  for (Segment& segment : segments()) segment.host->set_goal(goal);
}

// ---- one tick

BusStatus CanMotorBus::tick(std::span<const JointCommand> commands, std::span<JointState> states,
                            std::int64_t deadline_ns) noexcept {
  if (!settings_.lock_step)  // where nothing is late
    for (Segment& segment : segments()) (void)receive(segment, true);
  tick_start_ = clock_.now_ns();
  ++tick_;
  for (Segment& segment : segments()) begin(segment, commands);
  bool partner = true;
  if (settings_.lock_step)
    partner = wait_for_partner();
  else
    wait_for_replies(deadline_ns);
  bool complete = true;
  bool alive = false;
  for (Segment& segment : segments()) {
    segment.missed = !segment.host->replies_complete();
    complete = complete && !segment.missed;
    if (unsent(segment))
      segment.counters.unsent_frames += segment.frames.frames().size() - segment.next;
    const PortState state = segment.port->state();
    alive = alive || (state != PortState::kDown && state != PortState::kBusOff);
    segment.host->end_tick(states);
  }
  if (settings_.observer != nullptr) settings_.observer->tick_ended(tick_);
  if (partner && alive) return complete ? BusStatus::kOk : BusStatus::kLate;
  if (alive)
    trouble_.what = BusTrouble::kNoPartner;
  else
    trouble_ = {.what = BusTrouble::kNoBus, .bus = 0, .joint = -1, .link = {}};
  return BusStatus::kDown;
}

void CanMotorBus::begin(Segment& segment, std::span<const JointCommand> commands) noexcept {
  segment.port->maintain(tick_start_);
  segment.host->begin_tick(commands, segment.frames);
  if (settings_.lock_step) segment.frames.push(encode_lock_step(LockStepMark::kSent, tick_));
  segment.next = 0;
  segment.sending = may_send(segment);
  offer(segment);
}

/// Never behind frames of an earlier tick, except once what stops the drives.
bool CanMotorBus::may_send(Segment& segment) noexcept {
  const PortState state = segment.port->state();
  if (state == PortState::kDown || state == PortState::kBusOff) return false;
  // All replies of the last tick came: all its frames were sent. That spares the question.
  const bool behind = segment.missed && segment.port->has_unsent();
  const bool stopping = goal_ != HostGoal::kOn;
  if (behind && !(stopping && !segment.forced)) {
    ++segment.counters.held_ticks;
    return false;
  }
  segment.forced = stopping;
  return true;
}

/// Hands over what the interface takes of the tick's frames, in lock step with the mark behind
/// them.
void CanMotorBus::offer(Segment& segment) noexcept {
  const std::span<const CanFrame> all = segment.frames.frames();
  // Frames that must not go out are passed over; the mark goes out in any case.
  const std::size_t own = all.size() - (settings_.lock_step ? 1 : 0);
  if (!segment.sending) segment.next = std::max(segment.next, own);
  const std::span<const CanFrame> rest = all.subspan(segment.next);
  if (rest.empty()) return;
  const SendResult result = segment.port->send(rest);
  if (settings_.observer != nullptr)
    for (std::size_t i = segment.next; i < std::min(segment.next + result.sent, own); ++i)
      settings_.observer->sent(index_of(segment), all[i]);
  segment.next += result.sent;
}

bool CanMotorBus::unsent(const Segment& segment) noexcept {
  return segment.sending && segment.next < segment.frames.frames().size();
}

/// @return frames received
std::size_t CanMotorBus::receive(Segment& segment, bool late) noexcept {
  const std::uint64_t replies = segment.host->counters().replies;
  std::size_t received_frames = 0;
  std::size_t count = inbox_.size();
  while (count == inbox_.size()) {
    count = segment.port->receive(inbox_);
    received_frames += count;
    for (const ReceivedFrame& received : std::span(inbox_).first(count)) {
      std::uint32_t number = 0;
      if (settings_.lock_step && decode_lock_step(received.frame, number) != LockStepMark::kNone) {
        segment.done = number;
        continue;
      }
      if (settings_.observer != nullptr)
        settings_.observer->received(index_of(segment), received.frame);
      const std::uint64_t before = segment.host->counters().replies;
      (void)segment.host->receive(received.frame);
      if (!late && segment.host->counters().replies != before)
        segment.counters.slowest_reply_ns =
            std::max(segment.counters.slowest_reply_ns, received.time_ns - tick_start_);
    }
  }
  if (late) segment.counters.late_replies += segment.host->counters().replies - replies;
  return received_frames;
}

bool CanMotorBus::finished(const Segment& segment) noexcept {
  return !segment.sending || segment.port->state() == PortState::kDown ||
         (!unsent(segment) && segment.host->replies_complete());
}

void CanMotorBus::wait_for_replies(std::int64_t deadline_ns) noexcept {
  const std::int64_t end = deadline_ns > 0 ? deadline_ns : tick_start_ + period_ns_;
  const auto share = static_cast<double>(end - tick_start_) * settings_.reply_share;
  const std::int64_t until = tick_start_ + static_cast<std::int64_t>(share);
  const std::int64_t send_until =
      tick_start_ +
      static_cast<std::int64_t>(static_cast<double>(period_ns_) * settings_.send_share);
  for (;;) {
    bool all = true;
    bool refused = false;
    const std::int64_t now = clock_.now_ns();
    for (Segment& segment : segments()) {
      all = all && finished(segment);
      refused = refused || (unsent(segment) && now < send_until);
    }
    if (all || now >= until) return;
    clock_.wait(refused ? std::min(until, now + kOfferAgain) : until);
    for (Segment& segment : segments()) {
      (void)receive(segment, false);
      if (unsent(segment) && clock_.now_ns() < send_until) offer(segment);
    }
  }
}

bool CanMotorBus::wait_for_partner() noexcept {
  const std::int64_t until = tick_start_ + nanoseconds(settings_.partner_patience);
  // The drives answer bus by bus: who waits for the last one is woken once.
  for (std::size_t i = count_; i-- > 0;) {
    Segment& segment = segments_[i];
    while (segment.done != tick_) {
      trouble_.bus = i;
      if (segment.next < segment.frames.frames().size()) {
        offer(segment);
        clock_.wait(clock_.now_ns() + kOfferAgain);
      } else {
        clock_.wait_for(*segment.port, until);
      }
      if (receive(segment, false) > 0) continue;
      if (clock_.now_ns() >= until) return false;
      // A clock that cannot wait for one port goes on only when the others are empty, too.
      for (Segment& other : segments()) (void)receive(other, false);
    }
  }
  return true;
}

// ---- start

BusStatus CanMotorBus::enable() noexcept {
  trouble_ = {};
  active_ = true;
  for (Segment& segment : segments()) {
    (void)receive(segment, true);  // of before our time
    segment.counters = {};
    segment.missed = true;
    segment.forced = false;
  }
  next_own_tick_ = clock_.now_ns();
  set_goal(HostGoal::kOff);
  if (greet_partner() && read_all_joints() && enable_all()) {
    fresh_ = true;
    return BusStatus::kOk;
  }
  const BusTroubleReport trouble = trouble_;
  disable();
  trouble_ = trouble;
  return BusStatus::kDown;
}

/// Whatever else comes meanwhile is of before the first tick and depends on who was started first:
/// it is not looked at.
bool CanMotorBus::greet_partner() noexcept {
  if (!settings_.lock_step) return true;
  const CanFrame greeting = encode_lock_step(LockStepMark::kSent, 0);
  const std::int64_t until = clock_.now_ns() + nanoseconds(settings_.partner_patience);
  std::array<bool, kMaxBuses> greeted{};
  std::int64_t next = 0;
  while (clock_.now_ns() < until) {
    if (clock_.now_ns() >= next) {
      next = clock_.now_ns() + kGreetingInterval;
      for (Segment& segment : segments())
        if (!greeted[index_of(segment)]) (void)segment.port->send({&greeting, 1});
    }
    clock_.wait(next);
    for (Segment& segment : segments())
      greeted[index_of(segment)] |= answers_greeting(*segment.port);
    if (given_up()) return false;
    const auto silent = std::find(greeted.begin(), greeted.begin() + index(count_), false);
    if (silent == greeted.begin() + index(count_)) return true;
    trouble_.bus = static_cast<std::size_t>(silent - greeted.begin());
  }
  trouble_.what = BusTrouble::kNoPartner;
  return false;
}

bool CanMotorBus::answers_greeting(FramePort& port) noexcept {
  bool answered = false;
  std::size_t count = inbox_.size();
  while (count == inbox_.size()) {
    count = port.receive(inbox_);
    for (const ReceivedFrame& received : std::span(inbox_).first(count)) {
      std::uint32_t number = 1;
      answered |= decode_lock_step(received.frame, number) == LockStepMark::kDone && number == 0;
    }
  }
  return answered;
}

bool CanMotorBus::read_all_joints() noexcept {
  int read_ticks = 0;
  for (std::uint64_t i = ticks(settings_.start_patience); i > 0; --i) {
    if (own_tick() == BusStatus::kDown || find_fault() || given_up()) return false;
    bool all = true;
    for (Segment& segment : segments())
      for (std::size_t d = 0; d < segment.host->size(); ++d) {
        const int joint = segment.host->joint(d);
        const JointState& state = states_[static_cast<std::size_t>(joint)];
        const bool read =
            segment.host->status(d).phase == LinkPhase::kOff && (state.flags & kJointStale) == 0;
        if (all && !read)
          trouble_ = {BusTrouble::kJointSilent, index_of(segment), joint, segment.host->status(d)};
        all = all && read;
      }
    read_ticks = all ? read_ticks + 1 : 0;
    if (read_ticks < kReadTicks) continue;
    trouble_ = {};
    return true;
  }
  return false;
}

bool CanMotorBus::enable_all() noexcept {
  set_goal(HostGoal::kOn);
  for (std::uint64_t i = ticks(settings_.start_patience); i > 0; --i) {
    hold_position();
    if (own_tick() == BusStatus::kDown || find_fault() || given_up()) return false;
    if (std::all_of(segments_.begin(), segments_.begin() + index(count_),
                    [](const Segment& segment) { return segment.host->all_on(); }))
      return true;
  }
  for (Segment& segment : segments())
    for (std::size_t d = 0; d < segment.host->size(); ++d)
      if (segment.host->status(d).phase != LinkPhase::kOn)
        trouble_ = {BusTrouble::kNotEnabled, index_of(segment), segment.host->joint(d),
                    segment.host->status(d)};
  return false;
}

bool CanMotorBus::find_fault() noexcept {
  for (Segment& segment : segments())
    for (std::size_t d = 0; d < segment.host->size(); ++d)
      if (segment.host->status(d).phase == LinkPhase::kFault) {
        trouble_ = {BusTrouble::kDriveFault, index_of(segment), segment.host->joint(d),
                    segment.host->status(d)};
        return true;
      }
  return false;
}

bool CanMotorBus::given_up() noexcept {
  if (!give_up_ || !give_up_()) return false;
  trouble_ = {.what = BusTrouble::kGivenUp, .bus = 0, .joint = -1, .link = {}};
  return true;
}

/// Commands that ask for nothing: no torque, and of a drive in a position mode to stay.
void CanMotorBus::hold_position() noexcept {
  for (std::size_t j = 0; j < commands_.size(); ++j) {
    commands_[j] = {};
    commands_[j].q = states_[j].q;
  }
}

BusStatus CanMotorBus::own_tick() noexcept {
  const auto joints = static_cast<std::size_t>(settings_.joint_count);
  next_own_tick_ = std::max(next_own_tick_ + period_ns_, clock_.now_ns());
  const BusStatus status =
      tick(std::span(commands_).first(joints), std::span(states_).first(joints), next_own_tick_);
  if (!settings_.lock_step)
    while (clock_.now_ns() < next_own_tick_) {
      clock_.wait(next_own_tick_);
      for (Segment& segment : segments()) (void)receive(segment, true);
    }
  return status;
}

// ---- run and end

BusStatus CanMotorBus::exchange(std::span<const JointCommand> commands,
                                std::span<JointState> states, std::int64_t deadline_ns) noexcept {
  const auto joints = static_cast<std::size_t>(settings_.joint_count);
  if (!active_ || commands.size() != joints || states.size() != joints) return BusStatus::kDown;
  ++exchanges_;
  if (fresh_) {
    hold_position();
    commands = std::span(commands_).first(joints);
    fresh_ = false;
  }
  return tick(commands, states, deadline_ns);
}

void CanMotorBus::quick_stop() noexcept {
  if (goal_ == HostGoal::kOn) set_goal(HostGoal::kQuickStop);
}

bool CanMotorBus::set_failure_policy(FailurePolicy policy) noexcept {
  bool all = true;
  for (Segment& segment : segments()) all = segment.host->set_failure_policy(policy) && all;
  return all;
}

double CanMotorBus::failure_policy_delay() const noexcept {
  std::uint32_t most = 0;
  for (std::size_t i = 0; i < count_; ++i) most = std::max(most, segments_[i].host->policy_ticks());
  return most * settings_.tick;
}

bool CanMotorBus::any_on() noexcept {
  for (Segment& segment : segments())
    for (std::size_t d = 0; d < segment.host->size(); ++d)
      if (segment.host->status(d).phase == LinkPhase::kOn) return true;
  return false;
}

void CanMotorBus::disable() noexcept {
  if (!active_) return;
  // Only where something is unsent, so healthy buses lose nothing by it.
  for (Segment& segment : segments())
    if (segment.missed) (void)segment.port->discard_unsent();
  next_own_tick_ = clock_.now_ns();
  bool connected = trouble_.what != BusTrouble::kNoPartner;
  if (any_on()) {
    set_goal(HostGoal::kQuickStop);
    for (std::uint64_t i = ticks(settings_.quick_stop_time); connected && i > 0; --i)
      connected = own_tick() != BusStatus::kDown;
  }
  set_goal(HostGoal::kOff);
  for (Segment& segment : segments()) segment.forced = false;
  // Twice answered: the second answer was given by a drive that had been told.
  int confirmed = 0;
  for (std::uint64_t i = ticks(settings_.off_patience); connected && confirmed < 2 && i > 0; --i) {
    const BusStatus status = own_tick();
    connected = status != BusStatus::kDown;
    confirmed = status == BusStatus::kOk ? confirmed + 1 : 0;
  }
  active_ = false;
}

BusCounters CanMotorBus::counters() const noexcept {
  BusCounters counters;
  counters.exchanges = exchanges_;
  for (std::size_t i = 0; i < count_; ++i) {
    counters.missing_replies += segments_[i].host->counters().missing_replies;
    counters.late += segments_[i].counters.late_replies;
  }
  return counters;
}

}  // namespace clamber
