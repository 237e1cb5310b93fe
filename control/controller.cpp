#include "control/controller.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

bool positive(double x) noexcept { return x > 0.0 && std::isfinite(x); }

bool acceptable(const ControllerConfig& c) noexcept {
  if (c.joint_count == 0 || c.joint_count > kMaxJoints) return false;
  for (const double x : {c.dt, c.torque_rate_limit, c.time_scale, c.start_time, c.start_speed,
                         c.start_distance_limit, c.overshoot_limit, c.velocity_factor, c.pause_time,
                         c.lowering_time})
    if (!positive(x)) return false;
  for (const double x : {c.derivative_filter, c.transfer_time, c.hold_time, c.lowering_damping})
    if (!(x >= 0.0 && std::isfinite(x))) return false;
  for (const double x : {c.tracking_error_limit, c.jump_limit, c.frozen_limit, c.acceleration_limit,
                         c.jerk_limit, c.saturation_time, c.overspeed_factor, c.overspeed_time,
                         c.limit_margin, c.temperature_limit})
    if (!(x > 0.0)) return false;
  return std::all_of(c.joints.begin(), c.joints.begin() + c.joint_count, [](const auto& j) {
    return positive(j.torque_limit) && positive(j.velocity_limit) && j.lower <= j.upper &&
           j.gains.kp >= 0.0 && j.gains.ki >= 0.0 && j.gains.kd >= 0.0 &&
           std::isfinite(j.gains.kp + j.gains.ki + j.gains.kd) && j.spring_stiffness >= 0.0;
  });
}

std::uint64_t ticks_in(double seconds, double dt) noexcept {
  return static_cast<std::uint64_t>(std::ceil(seconds / dt));
}

constexpr std::uint32_t bit(OperatorCommand command) noexcept {
  return command == OperatorCommand::kNone ? 0u : 1u << static_cast<unsigned>(command);
}

/// Any of the commands that take motion away.
constexpr std::uint32_t kTaking = ~0u << static_cast<unsigned>(OperatorCommand::kPause);

/// The slowest that a move over this distance (rad) may take.
double move_time(const ControllerConfig& c, double distance) noexcept {
  return std::max(c.start_time, RestingQuintic::kPeak * distance / c.start_speed);
}

}  // namespace

LoadReport Controller::load(const ControllerConfig& config, std::string_view robot_hash,
                            std::span<const std::byte> image,
                            std::span<double> workspace) noexcept {
  *this = Controller();
  ControllerPlan plan;
  const LoadReport report = open(config, robot_hash, image, workspace, plan);
  if (report.status != LoadStatus::kOk) return report;
  config_ = config;
  plan_ = plan;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointControl& joint = config.joints[j];
    watch_[j].configure({joint.velocity_limit, config.jump_limit, config.frozen_limit}, config.dt);
    pid_[j].configure(joint.gains, {joint.torque_limit, config.torque_rate_limit}, config.dt,
                      config.derivative_filter, config.transfer_time);
  }
  clock_.configure(config.pause_time, config.dt);
  state_ = {.mode = Mode::kBoot, .fault = FaultCode::kNone};
  status_ = TickStatus::kWaiting;
  return report;
}

LoadReport Controller::open(const ControllerConfig& config, std::string_view robot_hash,
                            std::span<const std::byte> image, std::span<double> workspace,
                            ControllerPlan& plan) noexcept {
  if (!acceptable(config)) return {.status = LoadStatus::kBadConfig};
  const std::size_t n = config.joint_count;
  std::array<double, kMaxJoints> lower{}, upper{}, torque{};
  for (std::size_t j = 0; j < n; ++j) {
    lower[j] = config.joints[j].lower;
    upper[j] = config.joints[j].upper;
    torque[j] = config.joints[j].torque_limit;
  }
  const PlanRequirements robot{.robot_hash = robot_hash,
                               .lower = std::span(lower).first(n),
                               .upper = std::span(upper).first(n),
                               .torque_limit = std::span(torque).first(n),
                               .accept_uncertified = config.accept_uncertified};
  LoadReport report;
  report.image = open_plan_image(image, robot, plan.image, &report.where);
  if (report.image != PlanImageStatus::kOk) {
    report.status = LoadStatus::kBadImage;
    return report;
  }
  if (plan.spline.build(plan.image, workspace) != SplineStatus::kOk)
    return {.status = LoadStatus::kWorkspaceTooSmall};
  return check_spline(config, plan.spline);
}

LoadReport Controller::check_spline(const ControllerConfig& config, const Spline& spline) noexcept {
  LoadReport report;
  const double scale = config.time_scale;
  for (std::uint32_t j = 0; j < config.joint_count; ++j) {
    const JointControl& joint = config.joints[j];
    const SplineExtremes e = spline.extremes(j);
    // Keyframes may rest on a joint limit, where the smallest overshoot leaves it; tick() clamps.
    const double beyond = std::max({e.overshoot, joint.lower - e.lowest, e.highest - joint.upper});
    const double fastest = e.fastest * scale;
    const double hardest = e.hardest * scale * scale;
    const double jerkiest = e.jerkiest * scale * scale * scale;
    const auto refuse = [&](LoadStatus status, double worst) {
      return LoadReport{.status = status, .where = {.keyframe = 0, .joint = j}, .worst = worst};
    };
    if (beyond > config.overshoot_limit) return refuse(LoadStatus::kOvershoot, beyond);
    if (fastest > config.velocity_factor * joint.velocity_limit)
      return refuse(LoadStatus::kTooFast, fastest);
    if (hardest > config.acceleration_limit) return refuse(LoadStatus::kTooHard, hardest);
    if (jerkiest > config.jerk_limit) return refuse(LoadStatus::kTooJerky, jerkiest);
    report.velocity = std::max(report.velocity, fastest);
    report.acceleration = std::max(report.acceleration, hardest);
    report.jerk = std::max(report.jerk, jerkiest);
  }
  return report;
}

TickStatus Controller::tick(std::span<const JointState> states, std::span<JointCommand> commands,
                            TelemetryFrame& frame) noexcept {
  const std::size_t n = config_.joint_count;
  if (n == 0 || plan_.spline.size() == 0 || states.size() != n || commands.size() != n) {
    std::fill(commands.begin(), commands.end(), JointCommand());
    frame = TelemetryFrame();
    state_ = clamber::supervise(state_, {.faults = clamber::bit(FaultCode::kNotLoaded)});
    return status_ = TickStatus::kFault;
  }
  const bool unheard = !inspect(states);
  if (!unheard && path_ == Path::kToStart && clock_.reached(start_duration_)) begin_plan();
  supervise(states, unheard);
  // A plan that ran on without its robot would be somewhere else when the states come back.
  const DriveAction action = drive_action(state_.mode);
  const bool follows = !unheard && action <= DriveAction::kHold && path_ != Path::kStand;
  if (follows) update_reference();
  status_ = progress(unheard);
  command(states, commands);
  report(states, commands, frame);
  if (follows) clock_.advance();
  if (!unheard || action > DriveAction::kHold) ++mode_ticks_;
  ++ticks_;
  health_ = BusHealth();
  return status_;
}

void Controller::see(FaultCode fault, std::uint32_t joint) noexcept {
  if ((faults_ & clamber::bit(fault)) == 0) seen_at_[static_cast<std::size_t>(fault)] = joint;
  faults_ |= clamber::bit(fault);
}

/// Sorts the usable states from the others and finds what is wrong. @returns all are usable
bool Controller::inspect(States states) noexcept {
  faults_ = 0;
  if (health_.down) see(FaultCode::kBusDown, 0);
  if (health_.skipped_ticks > config_.watchdog_ticks) see(FaultCode::kWatchdog, 0);
  bool all = true;
  for (std::uint32_t j = 0; j < states.size(); ++j) {
    const JointState& s = states[j];
    trust_[j] = watch_[j].assess(s, reference_[j].q);
    if ((s.flags & kJointFault) != 0) see(FaultCode::kDriveFault, j);
    lost_ticks_[j] = trust_[j] == JointTrust::kGood ? 0 : lost_ticks_[j] + 1;
    if (lost_ticks_[j] > config_.stale_ticks_limit)
      see(trust_[j] == JointTrust::kMissing ? FaultCode::kStaleState : FaultCode::kUnbelievable, j);
    if (trust_[j] == JointTrust::kGood) watch_limits(j, s);
    all = all && trust_[j] == JointTrust::kGood;
  }
  if (all && drive_action(state_.mode) <= DriveAction::kHold) watch_tracking(states);
  return all;
}

void Controller::watch_limits(std::uint32_t joint, const JointState& s) noexcept {
  const JointControl& limits = config_.joints[joint];
  const auto ticks_over = [&](std::uint32_t ticks, double seconds) {
    return static_cast<double>(ticks) * config_.dt >= seconds;
  };
  const bool fast = std::abs(s.dq) > config_.overspeed_factor * limits.velocity_limit;
  fast_ticks_[joint] = fast ? fast_ticks_[joint] + 1 : 0;
  if (fast && ticks_over(fast_ticks_[joint], config_.overspeed_time))
    see(FaultCode::kOverspeed, joint);
  if (saturated_ticks_[joint] > 0 && ticks_over(saturated_ticks_[joint], config_.saturation_time))
    see(FaultCode::kSaturation, joint);
  if (s.q < limits.lower - config_.limit_margin || s.q > limits.upper + config_.limit_margin)
    see(FaultCode::kJointLimit, joint);
  if (s.temperature > config_.temperature_limit) see(FaultCode::kTemperature, joint);
}

void Controller::watch_tracking(States states) noexcept {
  for (std::uint32_t j = 0; j < states.size(); ++j)
    if (std::abs(reference_[j].q - states[j].q) > config_.tracking_error_limit)
      see(FaultCode::kTrackingError, j);
}

/// The present mode has run its course.
bool Controller::done() const noexcept {
  switch (state_.mode) {
    case Mode::kMovingToStart:
    case Mode::kPaused:
      return path_ == Path::kPlan;
    case Mode::kExecuting:
      return clock_.reached(plan_.spline.end());
    case Mode::kLowering:
    case Mode::kLimp:
      return mode_ticks_ >= ticks_in(config_.lowering_time, config_.dt);
    default:
      return false;
  }
}

/// First the course of things, then what the operator wants of it.
void Controller::supervise(States states, bool unheard) noexcept {
  supervise_one(states, unheard, OperatorCommand::kNone);
  const std::uint32_t taking = requests_ & kTaking;
  if (state_.mode == Mode::kBoot && taking == 0) return;
  for (unsigned i = kOperatorCommandCount; i-- > 1 && taking != 0;) {
    if ((taking & 1u << i) == 0) continue;
    supervise_one(states, unheard, static_cast<OperatorCommand>(i));
    break;
  }
  for (unsigned i = 1; i < kOperatorCommandCount && taking == 0; ++i)
    if ((requests_ & 1u << i) != 0) supervise_one(states, unheard, static_cast<OperatorCommand>(i));
  requests_ = 0;
}

void Controller::supervise_one(States states, bool unheard, OperatorCommand command) noexcept {
  SupervisorInputs in{.command = command,
                      .faults = faults_,
                      .unheard = unheard,
                      .new_plan = new_plan_,
                      .done = done(),
                      .planned = failure_policy()};
  const bool starts = command == OperatorCommand::kStart &&
                      (state_ == SupervisorState{Mode::kReady, FaultCode::kNone} ||
                       state_ == SupervisorState{Mode::kHolding, FaultCode::kNone});
  for (std::uint32_t j = 0; starts && !unheard && j < states.size(); ++j) {
    const double start = plan_at(plan_, join_time_, 0, j).q;
    if (std::abs(start - states[j].q) <= config_.start_distance_limit) continue;
    in.faults |= clamber::bit(FaultCode::kStartDistance);
    seen_at_[static_cast<std::size_t>(FaultCode::kStartDistance)] = j;
    break;
  }
  enter(clamber::supervise(state_, in), states);
}

void Controller::enter(const SupervisorState& next, States states) noexcept {
  const Mode before = state_.mode;
  const bool failed = next.fault != FaultCode::kNone && state_.fault == FaultCode::kNone;
  if (next.fault != state_.fault) fault_joint_ = seen_at_[static_cast<std::size_t>(next.fault)];
  state_ = next;
  if (failed) new_plan_ = false;
  const bool blends = new_plan_ && next.mode == Mode::kMovingToStart;
  if (next.mode == before && !failed && !blends) return;
  mode_ticks_ = 0;
  switch (next.mode) {
    case Mode::kReady:
      // Acknowledged: goes on holding, also while the clock still brakes.
      return before == Mode::kDisabled ? take_over(states) : void();
    case Mode::kMovingToStart:
      return before == Mode::kPaused && !blends ? clock_.aim(speed_) : begin_move();
    case Mode::kExecuting:
      return clock_.aim(speed_);
    case Mode::kPaused:
      return clock_.aim(0.0);
    case Mode::kHolding:
      if (before == Mode::kExecuting && !failed && clock_.reached(plan_.spline.end()))
        return clock_.start(plan_.spline.end(), config_.time_scale, 0.0);
      if (!failed || next.fault == FaultCode::kEstop) return clock_.aim(0.0);
      // To go on pulling at what holds a joint back would only load the structure.
      if (next.fault == FaultCode::kTrackingError || next.fault == FaultCode::kSaturation)
        hold_here(states);
      return stand();
    case Mode::kLowering:
      return begin_lowering(states);
    default:
      return stand();
  }
}

/// Switches torque on: at the torques the drives report, where the robot is.
void Controller::take_over(States states) noexcept {
  stand();
  for (std::uint32_t j = 0; j < states.size(); ++j) {
    reference_[j] = {.q = states[j].q};
    watch_[j].rebase(states[j].q);
    saturated_ticks_[j] = 0;
    pid_[j].set_gains(config_.joints[j].gains);
    pid_[j].activate(states[j].dq, std::isfinite(states[j].tau) ? states[j].tau : 0.0);
  }
}

/// Where the reference is and how it moves, from which a move starts.
MotionPoint Controller::present(std::size_t joint) const noexcept {
  const Reference& r = reference_[joint];
  if (path_ == Path::kStand || clock_.stands()) return {.q = r.q};
  return {.q = r.q, .dq = r.dq, .ddq = r.ddq};
}

/// From the present reference to the plan at its join time.
void Controller::begin_move() noexcept {
  if (new_plan_) {
    plan_ = next_plan_;
    join_time_ = next_join_;
    segment_ = 0;
    new_plan_ = false;
  }
  const bool moves = path_ != Path::kStand && !clock_.stands();
  std::size_t segment = 0;
  plan_.spline.locate(join_time_, segment);
  double farthest = 0.0;
  for (std::size_t j = 0; j < config_.joint_count; ++j)
    farthest =
        std::max(farthest, std::abs(plan_at(plan_, join_time_, segment, j).q - reference_[j].q));
  start_duration_ = move_time(config_, farthest);
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    const Reference to = plan_at(plan_, join_time_, segment, j);
    blend_[j] = QuinticBlend(present(j), {to.q, to.dq, to.ddq}, start_duration_);
    from_torque_[j] = reference_[j].tau;
    to_torque_[j] = to.tau;
  }
  path_ = Path::kToStart;
  plan_time_ = join_time_;
  segment_ = segment;
  clock_.start(0.0, 1.0, 1.0);
  // The present reference is the last tick's.
  if (moves) clock_.advance();
  clock_.aim(speed_);
}

void Controller::begin_plan() noexcept {
  // A plan joined at rest may start with this tick; one joined in motion must not lose the rest of
  // the move's last tick.
  const double beyond = join_time_ > 0.0 ? clock_.time() - start_duration_ : 0.0;
  path_ = Path::kPlan;
  clock_.transfer(join_time_ + beyond * config_.time_scale, config_.time_scale);
}

void Controller::stand() noexcept {
  path_ = Path::kStand;
  for (std::size_t j = 0; j < config_.joint_count; ++j) reference_[j].dq = reference_[j].ddq = 0.0;
}

/// Gives up the reference for the measured posture.
void Controller::hold_here(States states) noexcept {
  for (std::size_t j = 0; j < states.size(); ++j) {
    if (trust_[j] != JointTrust::kGood) continue;
    reference_[j].q = states[j].q;
    pid_[j].rebase();
    watch_[j].rebase(states[j].q);
  }
}

/// From now on nothing but damping and a fading support.
void Controller::begin_lowering(States states) noexcept {
  hold_here(states);
  stand();
  for (std::size_t j = 0; j < states.size(); ++j) {
    support_[j] = pid_[j].resting();
    pid_[j].set_gains({.kp = 0.0, .ki = 0.0, .kd = config_.lowering_damping});
    pid_[j].clear_integral();
  }
}

TickStatus Controller::progress(bool unheard) const noexcept {
  if (state_.fault != FaultCode::kNone) return TickStatus::kFault;
  if (unheard) return TickStatus::kWaiting;
  switch (state_.mode) {
    case Mode::kDisabled:
    case Mode::kReady:
      return TickStatus::kIdle;
    case Mode::kMovingToStart:
      return TickStatus::kMovingToStart;
    case Mode::kExecuting:
      return TickStatus::kTracking;
    case Mode::kPaused:
      return TickStatus::kPaused;
    case Mode::kHolding:
      if (path_ != Path::kPlan || plan_time_ < plan_.spline.end()) return TickStatus::kStopped;
      return mode_ticks_ >= ticks_in(config_.hold_time, config_.dt) ? TickStatus::kFinished
                                                                    : TickStatus::kHolding;
    default:
      return TickStatus::kWaiting;
  }
}

void Controller::update_reference() noexcept {
  if (path_ == Path::kToStart) return reference_to_start();
  plan_time_ = std::min(clock_.time(), plan_.spline.end());
  reference_on_plan();
}

void Controller::reference_to_start() noexcept {
  const double s = std::min(clock_.time() / start_duration_, 1.0);
  const RestingQuintic base = RestingQuintic::at(s, start_duration_);
  const double rate = clock_.rate();
  const double acceleration = clock_.acceleration();
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    const MotionPoint x = blend_[j].at(base);
    const double from = from_torque_[j];
    reference_[j] = {.q = x.q,
                     .dq = x.dq * rate,
                     .ddq = x.ddq * rate * rate + x.dq * acceleration,
                     .tau = from == 0.0 ? base.value * to_torque_[j]
                                        : from + base.value * (to_torque_[j] - from)};
  }
}

void Controller::reference_on_plan() noexcept {
  const ControllerPlan& plan = plan_;
  plan.spline.locate(plan_time_, segment_);
  const ImageKeyframe& a = plan.image.keyframes()[segment_];
  const ImageKeyframe& b = plan.image.keyframes()[segment_ + 1];
  const double rate = clock_.rate();
  const double acceleration = clock_.acceleration();
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    const JointControl& joint = config_.joints[j];
    const Spline::Sample x = plan.spline.evaluate(plan_time_, segment_, j);
    const double tau = interpolate_linear(plan_time_, a.time, a.tau[j], b.time, b.tau[j]);
    reference_[j] = {.q = std::clamp(x.value, joint.lower, joint.upper) + stretch(j, tau),
                     .dq = x.rate * rate,
                     .ddq = x.acceleration * rate * rate + x.rate * acceleration,
                     .tau = tau};
  }
}

/// The reference where a move joins the plan: at rest at its first keyframe, else as the plan
/// passes there.
Controller::Reference Controller::plan_at(const ControllerPlan& plan, double time,
                                          std::size_t segment, std::size_t joint) const noexcept {
  if (time <= 0.0) {
    const double tau = plan.image.keyframes()[0].tau[joint];
    return {.q = plan.image.value(0, joint) + stretch(joint, tau), .tau = tau};
  }
  plan.spline.locate(time, segment);
  const ImageKeyframe& a = plan.image.keyframes()[segment];
  const ImageKeyframe& b = plan.image.keyframes()[segment + 1];
  const Spline::Sample x = plan.spline.evaluate(time, segment, joint);
  const double tau = interpolate_linear(time, a.time, a.tau[joint], b.time, b.tau[joint]);
  const double rate = config_.time_scale;
  return {.q = x.value + stretch(joint, tau),
          .dq = x.rate * rate,
          .ddq = x.acceleration * rate * rate,
          .tau = tau};
}

/// rad by which the motor has to lead the link that its spring may carry this torque.
double Controller::stretch(std::size_t joint, double tau) const noexcept {
  const double stiffness = config_.joints[joint].spring_stiffness;
  return stiffness > 0.0 ? tau / stiffness : 0.0;
}

void Controller::command(States states, std::span<JointCommand> commands) noexcept {
  const DriveAction action = drive_action(state_.mode);
  for (std::size_t j = 0; j < states.size(); ++j) {
    if (action > DriveAction::kLower)
      commands[j] = {};
    else if (action == DriveAction::kLower)
      commands[j] = command_lowered(j, states[j]);
    else
      commands[j] = trust_[j] == JointTrust::kGood ? command_held(j, states[j]) : command_blind(j);
  }
  count_saturation(states, commands);
}

JointCommand Controller::command_held(std::size_t joint, const JointState& state) noexcept {
  const Reference& r = reference_[joint];
  const double tau_ff = config_.feed_forward == FeedForward::kPlan ? r.tau : 0.0;
  const double tau = pid_[joint].update(r.q, state.q, state.dq, tau_ff);
  if (!watch_[joint].unchanged()) rest_torque_[joint] = pid_[joint].resting();
  return {.q = r.q, .dq = r.dq, .kp = 0.0, .kd = 0.0, .tau = tau};
}

/// For a joint whose state is missing the drive, which knows it, closes the loop that the host
/// cannot (drives without gains of their own get the law of the last state, which is the last
/// torque). Over an encoder that cannot be right nobody closes one: the torque that it rested on.
JointCommand Controller::command_blind(std::size_t joint) const noexcept {
  if (trust_[joint] == JointTrust::kUnbelievable)
    return {.q = reference_[joint].q, .tau = rest_torque_[joint]};
  const PidGains& gains = config_.joints[joint].gains;
  return {.q = reference_[joint].q, .kp = gains.kp, .kd = gains.kd, .tau = pid_[joint].steady()};
}

/// Sinks: the torque that carried the joint fades along a cubic, damping keeps it slow. A joint
/// that is not heard gets the same from its drive.
JointCommand Controller::command_lowered(std::size_t joint, const JointState& state) noexcept {
  const double u =
      std::min(static_cast<double>(mode_ticks_) * config_.dt / config_.lowering_time, 1.0);
  const double support = support_[joint] * (1.0 - u * u * (3.0 - 2.0 * u));
  if (trust_[joint] == JointTrust::kUnbelievable) return {.tau = support};
  if (trust_[joint] == JointTrust::kMissing)
    return {.q = reference_[joint].q, .kd = config_.lowering_damping, .tau = support};
  return {.q = reference_[joint].q, .tau = pid_[joint].update(state.q, state.q, state.dq, support)};
}

void Controller::count_saturation(States states, std::span<const JointCommand> commands) noexcept {
  for (std::size_t j = 0; j < states.size(); ++j) {
    const bool full = std::abs(commands[j].tau) >= config_.joints[j].torque_limit ||
                      (states[j].flags & kJointSaturated) != 0;
    saturated_ticks_[j] = full ? saturated_ticks_[j] + 1 : 0;
  }
}

void Controller::report(States states, std::span<const JointCommand> commands,
                        TelemetryFrame& frame) const noexcept {
  frame = TelemetryFrame();
  frame.sequence = ticks_;
  frame.time = static_cast<double>(ticks_) * config_.dt;
  frame.plan_time = plan_time_;
  frame.joint_count = config_.joint_count;
  const bool at_end = plan_time_ >= plan_.spline.end();
  frame.phase = plan_.image.keyframes()[at_end ? plan_.image.size() - 1 : segment_].phase;
  frame.mode = static_cast<std::uint32_t>(state_.mode);
  frame.fault = static_cast<std::uint32_t>(state_.fault);
  if (concerns_a_joint(state_.fault)) frame.fault_joint = fault_joint_;
  for (std::size_t j = 0; j < states.size(); ++j) {
    frame.q_ref[j] = reference_[j].q;
    frame.q[j] = states[j].q;
    frame.dq[j] = states[j].dq;
    frame.tau_ff[j] = config_.feed_forward == FeedForward::kPlan ? reference_[j].tau : 0.0;
    frame.tau_cmd[j] = commands[j].tau;
    frame.tau_meas[j] = states[j].tau;
    frame.tau_limit[j] = config_.joints[j].torque_limit;
    frame.temperature[j] = states[j].temperature;
    frame.age[j] = states[j].age;
    if ((states[j].flags & kJointFault) != 0) frame.joint_faults |= 1u << j;
  }
}

void Controller::request(OperatorCommand command) noexcept { requests_ |= bit(command); }

void Controller::set_speed(double share) noexcept {
  if (!(share >= 0.0)) return;
  speed_ = std::min(share, 1.0);
  if (moves_on_plan(state_.mode)) clock_.aim(speed_);
}

SwitchStatus Controller::switch_plan(const ControllerPlan& plan, double time) noexcept {
  if (state_.fault != FaultCode::kNone || new_plan_) return SwitchStatus::kNotNow;
  if (plan.spline.size() == 0 || plan.image.dimensions() != config_.joint_count)
    return SwitchStatus::kOtherJoints;
  const double join = std::clamp(time, 0.0, plan.spline.end());
  const Mode mode = state_.mode;
  if (mode == Mode::kBoot || mode == Mode::kDisabled || mode == Mode::kReady) {
    plan_ = plan;
    plan_time_ = join_time_ = join;
    segment_ = 0;
    plan_.spline.locate(join, segment_);
    return SwitchStatus::kOk;
  }
  const SwitchStatus status = check_blend(plan, join);
  if (status != SwitchStatus::kOk) return status;
  next_plan_ = plan;
  next_join_ = join;
  new_plan_ = true;
  return SwitchStatus::kOk;
}

/// Of a blend that started now. Looked at in steps: its quintics turn at most four times.
SwitchStatus Controller::check_blend(const ControllerPlan& plan, double join) const noexcept {
  constexpr int kSteps = 64;
  std::size_t segment = 0;
  plan.spline.locate(join, segment);
  double farthest = 0.0;
  for (std::size_t j = 0; j < config_.joint_count; ++j)
    farthest = std::max(farthest, std::abs(plan_at(plan, join, segment, j).q - reference_[j].q));
  if (!(farthest <= config_.start_distance_limit)) return SwitchStatus::kTooFar;
  const double duration = move_time(config_, farthest);
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    const JointControl& joint = config_.joints[j];
    const Reference to = plan_at(plan, join, segment, j);
    const QuinticBlend blend(present(j), {to.q, to.dq, to.ddq}, duration);
    for (int i = 0; i <= kSteps; ++i) {
      const MotionPoint x = blend.at(RestingQuintic::at(static_cast<double>(i) / kSteps, duration));
      const bool inside = x.q >= joint.lower - config_.overshoot_limit &&
                          x.q <= joint.upper + config_.overshoot_limit;
      if (!inside || std::abs(x.dq) > config_.velocity_factor * joint.velocity_limit)
        return SwitchStatus::kLeavesLimits;
    }
  }
  return SwitchStatus::kOk;
}

void Controller::set_gains(std::span<const PidGains> gains) noexcept {
  for (std::size_t j = 0; j < std::min<std::size_t>(gains.size(), config_.joint_count); ++j) {
    config_.joints[j].gains = gains[j];
    if (state_.mode != Mode::kLowering) pid_[j].set_gains(gains[j]);
  }
}

void Controller::set_feed_forward(FeedForward feed_forward) noexcept {
  config_.feed_forward = feed_forward;
  for (std::size_t j = 0; j < config_.joint_count; ++j) pid_[j].rebase();
}

FailurePolicy Controller::lost_host_policy(double ahead) const noexcept {
  if (plan_.spline.size() == 0) return FailurePolicy::kHold;
  const double then = plan_time_ + ahead * config_.time_scale;
  std::size_t segment = segment_;
  while (segment + 1 < plan_.image.size() && plan_.image.time(segment + 1) <= then) ++segment;
  return plan_.image.failure_policy(segment);
}

std::uint64_t Controller::expected_ticks() const noexcept {
  if (plan_.spline.size() == 0) return 0;
  return ticks_in(config_.start_time, config_.dt) +
         ticks_in(plan_.spline.end() / config_.time_scale, config_.dt) +
         ticks_in(config_.hold_time, config_.dt);
}

const char* to_string(LoadStatus status) noexcept {
  switch (status) {
    case LoadStatus::kOk:
      return "ok";
    case LoadStatus::kBadConfig:
      return "controller configuration out of range";
    case LoadStatus::kBadImage:
      return "plan image refused";
    case LoadStatus::kWorkspaceTooSmall:
      return "workspace too small for the plan";
    case LoadStatus::kOvershoot:
      return "the spline leaves its keyframes or the joint limits";
    case LoadStatus::kTooFast:
      return "the plan exceeds a joint's velocity limit";
    case LoadStatus::kTooHard:
      return "the plan exceeds the acceleration limit";
    case LoadStatus::kTooJerky:
      return "the plan exceeds the jerk limit";
  }
  return "unknown";
}

const char* to_string(TickStatus status) noexcept {
  switch (status) {
    case TickStatus::kMovingToStart:
      return "moving to start";
    case TickStatus::kTracking:
      return "tracking";
    case TickStatus::kHolding:
      return "holding";
    case TickStatus::kFinished:
      return "finished";
    case TickStatus::kWaiting:
      return "waiting for joint states";
    case TickStatus::kFault:
      return "fault";
    case TickStatus::kIdle:
      return "waiting for the operator";
    case TickStatus::kPaused:
      return "paused";
    case TickStatus::kStopped:
      return "stopped";
  }
  return "unknown";
}

const char* to_string(SwitchStatus status) noexcept {
  switch (status) {
    case SwitchStatus::kOk:
      return "ok";
    case SwitchStatus::kNotNow:
      return "not now";
    case SwitchStatus::kOtherJoints:
      return "not a plan for this robot";
    case SwitchStatus::kTooFar:
      return "too far from the present posture";
    case SwitchStatus::kLeavesLimits:
      return "the blend would leave the joint or velocity limits";
  }
  return "unknown";
}

}  // namespace clamber
