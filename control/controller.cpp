#include "control/controller.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

bool positive(double x) noexcept { return x > 0.0 && std::isfinite(x); }

bool acceptable(const ControllerConfig& c) noexcept {
  if (c.joint_count == 0 || c.joint_count > kMaxJoints) return false;
  for (const double x : {c.dt, c.torque_rate_limit, c.time_scale, c.start_time, c.start_speed,
                         c.start_distance_limit, c.overshoot_limit, c.velocity_factor})
    if (!positive(x)) return false;
  for (const double x : {c.derivative_filter, c.transfer_time, c.hold_time})
    if (!(x >= 0.0 && std::isfinite(x))) return false;
  if (!(c.tracking_error_limit > 0.0 && c.jump_limit > 0.0 && c.frozen_limit > 0.0)) return false;
  return std::all_of(c.joints.begin(), c.joints.begin() + c.joint_count, [](const auto& j) {
    return positive(j.torque_limit) && positive(j.velocity_limit) && j.lower <= j.upper &&
           j.gains.kp >= 0.0 && j.gains.ki >= 0.0 && j.gains.kd >= 0.0 &&
           std::isfinite(j.gains.kp + j.gains.ki + j.gains.kd) && j.spring_stiffness >= 0.0;
  });
}

std::uint64_t ticks_in(double seconds, double dt) noexcept {
  return static_cast<std::uint64_t>(std::ceil(seconds / dt));
}

}  // namespace

LoadReport Controller::load(const ControllerConfig& config, std::string_view robot_hash,
                            std::span<const std::byte> image,
                            std::span<double> workspace) noexcept {
  *this = Controller();
  LoadReport report;
  if (!acceptable(config)) return {.status = LoadStatus::kBadConfig};
  config_ = config;
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
  report.image = open_plan_image(image, robot, plan_, &report.where);
  if (report.image != PlanImageStatus::kOk) {
    report.status = LoadStatus::kBadImage;
    return report;
  }
  if (spline_.build(plan_, workspace) != SplineStatus::kOk)
    return {.status = LoadStatus::kWorkspaceTooSmall};
  report = check_spline();
  if (report.status != LoadStatus::kOk) return report;
  for (std::size_t j = 0; j < n; ++j) {
    watch_[j].configure({config.joints[j].velocity_limit, config.jump_limit, config.frozen_limit},
                        config.dt);
    pid_[j].configure(config.joints[j].gains, {torque[j], config.torque_rate_limit}, config.dt,
                      config.derivative_filter, config.transfer_time);
  }
  mode_ = status_ = TickStatus::kMovingToStart;
  fault_ = FaultCode::kNone;
  return report;
}

LoadReport Controller::check_spline() const noexcept {
  for (std::uint32_t j = 0; j < config_.joint_count; ++j) {
    const JointControl& joint = config_.joints[j];
    const SplineExtremes e = spline_.extremes(j);
    // Keyframes may rest on a joint limit, where the smallest overshoot leaves it; tick() clamps.
    const double beyond = std::max({e.overshoot, joint.lower - e.lowest, e.highest - joint.upper});
    const PlanImageFault where{.keyframe = 0, .joint = j};
    if (beyond > config_.overshoot_limit)
      return {.status = LoadStatus::kOvershoot, .where = where, .worst = beyond};
    const double fastest = e.fastest * config_.time_scale;
    if (fastest > config_.velocity_factor * joint.velocity_limit)
      return {.status = LoadStatus::kTooFast, .where = where, .worst = fastest};
  }
  return {};
}

TickStatus Controller::tick(std::span<const JointState> states, std::span<JointCommand> commands,
                            TelemetryFrame& frame) noexcept {
  const std::size_t n = config_.joint_count;
  if (n == 0 || spline_.size() == 0 || states.size() != n || commands.size() != n) {
    std::fill(commands.begin(), commands.end(), JointCommand());
    frame = TelemetryFrame();
    raise(FaultCode::kNotLoaded, 0);
    return status_ = TickStatus::kFault;
  }
  const bool all_usable = inspect(states);
  if (!begun_ && all_usable) begun_ = begin(states);
  // A plan that ran on without its robot would be somewhere else when the states come back.
  const bool goes_on = begun_ && all_usable && mode_ != TickStatus::kFault;
  if (goes_on) {
    advance_mode();
    update_reference();
    check_tracking(states);
    ++mode_ticks_;
  }
  command(states, commands);
  report(states, commands, frame);
  ++ticks_;
  return status_ = (mode_ == TickStatus::kFault || goes_on) ? mode_ : TickStatus::kWaiting;
}

/// Sorts the usable states from the others; raises what cannot be waited out.
bool Controller::inspect(std::span<const JointState> states) noexcept {
  bool all = true;
  for (std::uint32_t j = 0; j < states.size(); ++j) {
    const JointState& s = states[j];
    trust_[j] = watch_[j].assess(s, reference_[j].q);
    if ((s.flags & kJointFault) != 0) raise(FaultCode::kDriveFault, j);
    lost_ticks_[j] = trust_[j] == JointTrust::kGood ? 0 : lost_ticks_[j] + 1;
    if (lost_ticks_[j] > config_.stale_ticks_limit)
      raise(trust_[j] == JointTrust::kMissing ? FaultCode::kStaleState : FaultCode::kUnbelievable,
            j);
    all = all && trust_[j] == JointTrust::kGood;
  }
  return all;
}

/// First tick with all states: takes over at the torques the drives report.
bool Controller::begin(std::span<const JointState> states) noexcept {
  double farthest = 0.0;
  for (std::uint32_t j = 0; j < states.size(); ++j) {
    start_q_[j] = states[j].q;
    reference_[j] = {.q = states[j].q, .dq = 0.0, .tau = 0.0};
    watch_[j].rebase(states[j].q);
    const double distance = std::abs(first_reference(j) - states[j].q);
    if (distance > config_.start_distance_limit) raise(FaultCode::kStartDistance, j);
    farthest = std::max(farthest, distance);
    pid_[j].activate(states[j].dq, std::isfinite(states[j].tau) ? states[j].tau : 0.0);
  }
  // 15/8 is the peak rate of the blend in reference_to_start() over its mean rate.
  start_duration_ = std::max(config_.start_time, 1.875 * farthest / config_.start_speed);
  return true;
}

void Controller::advance_mode() noexcept {
  const auto over = [&](double seconds) { return mode_ticks_ >= ticks_in(seconds, config_.dt); };
  const auto enter = [&](TickStatus mode) {
    mode_ = mode;
    mode_ticks_ = 0;
  };
  if (mode_ == TickStatus::kMovingToStart && over(start_duration_)) enter(TickStatus::kTracking);
  if (mode_ == TickStatus::kTracking && over(spline_.end() / config_.time_scale))
    enter(TickStatus::kHolding);
  if (mode_ == TickStatus::kHolding && over(config_.hold_time)) enter(TickStatus::kFinished);
}

void Controller::update_reference() noexcept {
  if (mode_ == TickStatus::kMovingToStart) return reference_to_start();
  plan_time_ = mode_ == TickStatus::kTracking
                   ? static_cast<double>(mode_ticks_) * config_.dt * config_.time_scale
                   : spline_.end();
  reference_on_plan();
}

/// Quintic blend, at rest at both ends, so that it joins the spline's resting start in C2.
void Controller::reference_to_start() noexcept {
  const double s = std::min(static_cast<double>(mode_ticks_) * config_.dt / start_duration_, 1.0);
  const double blend = s * s * s * (10.0 + s * (-15.0 + 6.0 * s));
  const double rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / start_duration_;
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    const double distance = first_reference(j) - start_q_[j];
    reference_[j] = {.q = start_q_[j] + blend * distance,
                     .dq = rate * distance,
                     .tau = blend * plan_.keyframes()[0].tau[j]};
  }
}

void Controller::reference_on_plan() noexcept {
  spline_.locate(plan_time_, segment_);
  const ImageKeyframe& a = plan_.keyframes()[segment_];
  const ImageKeyframe& b = plan_.keyframes()[segment_ + 1];
  for (std::size_t j = 0; j < config_.joint_count; ++j) {
    const JointControl& joint = config_.joints[j];
    const Spline::Sample x = spline_.evaluate(plan_time_, segment_, j);
    const double tau = interpolate_linear(plan_time_, a.time, a.tau[j], b.time, b.tau[j]);
    reference_[j] = {.q = std::clamp(x.value, joint.lower, joint.upper) + stretch(j, tau),
                     .dq = x.rate * config_.time_scale,
                     .tau = tau};
  }
}

/// rad by which the motor has to lead the link that its spring may carry this torque.
double Controller::stretch(std::size_t joint, double tau) const noexcept {
  const double stiffness = config_.joints[joint].spring_stiffness;
  return stiffness > 0.0 ? tau / stiffness : 0.0;
}

/// Of the plan's first keyframe, on the encoder's side of the spring, rad.
double Controller::first_reference(std::size_t joint) const noexcept {
  return plan_.value(0, joint) + stretch(joint, plan_.keyframes()[0].tau[joint]);
}

void Controller::check_tracking(std::span<const JointState> states) noexcept {
  for (std::uint32_t j = 0; j < states.size(); ++j) {
    if (std::abs(reference_[j].q - states[j].q) <= config_.tracking_error_limit) continue;
    raise(FaultCode::kTrackingError, j);
    return hold_here(states);
  }
}

/// Gives up the reference for the measured posture: to go on pulling at what holds a joint back
/// would only load the structure.
void Controller::hold_here(std::span<const JointState> states) noexcept {
  for (std::size_t j = 0; j < states.size(); ++j) {
    reference_[j].q = states[j].q;
    reference_[j].dq = 0.0;
    pid_[j].rebase();
    watch_[j].rebase(states[j].q);
  }
}

/// Keeps the first fault: what follows is its consequence.
void Controller::raise(FaultCode fault, std::uint32_t joint) noexcept {
  mode_ = TickStatus::kFault;
  if (fault_ != FaultCode::kNone) return;
  fault_ = fault;
  fault_joint_ = joint;
}

void Controller::command(std::span<const JointState> states,
                         std::span<JointCommand> commands) noexcept {
  for (std::size_t j = 0; j < states.size(); ++j) {
    const Reference& r = reference_[j];
    if (!begun_ || trust_[j] != JointTrust::kGood) {
      commands[j] = command_blind(j);
      continue;
    }
    const double tau_ff = config_.feed_forward == FeedForward::kPlan ? r.tau : 0.0;
    const double tau = pid_[j].update(r.q, states[j].q, states[j].dq, tau_ff);
    if (!watch_[j].unchanged()) rest_torque_[j] = pid_[j].resting();
    commands[j] = {.q = r.q, .dq = r.dq, .kp = 0.0, .kd = 0.0, .tau = tau};
  }
}

/// For a joint whose state is missing the drive, which knows it, closes the loop that the host
/// cannot (drives without gains of their own get the law of the last state, which is the last
/// torque). Over an encoder that cannot be right nobody closes one: the torque that it rested on.
JointCommand Controller::command_blind(std::size_t joint) const noexcept {
  if (!begun_) return {};
  if (trust_[joint] == JointTrust::kUnbelievable)
    return {.q = reference_[joint].q, .tau = rest_torque_[joint]};
  const PidGains& gains = config_.joints[joint].gains;
  return {.q = reference_[joint].q, .kp = gains.kp, .kd = gains.kd, .tau = pid_[joint].steady()};
}

void Controller::report(std::span<const JointState> states, std::span<const JointCommand> commands,
                        TelemetryFrame& frame) const noexcept {
  frame = TelemetryFrame();
  frame.sequence = ticks_;
  frame.time = static_cast<double>(ticks_) * config_.dt;
  frame.plan_time = plan_time_;
  frame.joint_count = config_.joint_count;
  const bool at_end = plan_time_ >= spline_.end();
  frame.phase = plan_.keyframes()[at_end ? plan_.size() - 1 : segment_].phase;
  for (std::size_t j = 0; j < states.size(); ++j) {
    frame.q_ref[j] = reference_[j].q;
    frame.q[j] = states[j].q;
    frame.dq[j] = states[j].dq;
    frame.tau_ff[j] = config_.feed_forward == FeedForward::kPlan ? reference_[j].tau : 0.0;
    frame.tau_cmd[j] = commands[j].tau;
    frame.tau_meas[j] = states[j].tau;
  }
}

void Controller::set_gains(std::span<const PidGains> gains) noexcept {
  for (std::size_t j = 0; j < std::min<std::size_t>(gains.size(), config_.joint_count); ++j) {
    config_.joints[j].gains = gains[j];
    pid_[j].set_gains(gains[j]);
  }
}

void Controller::set_feed_forward(FeedForward feed_forward) noexcept {
  config_.feed_forward = feed_forward;
  for (std::size_t j = 0; j < config_.joint_count; ++j) pid_[j].rebase();
}

std::uint64_t Controller::expected_ticks() const noexcept {
  if (spline_.size() == 0) return 0;
  return ticks_in(config_.start_time, config_.dt) +
         ticks_in(spline_.end() / config_.time_scale, config_.dt) +
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
  }
  return "unknown";
}

const char* to_string(FaultCode fault) noexcept {
  switch (fault) {
    case FaultCode::kNone:
      return "none";
    case FaultCode::kNotLoaded:
      return "no plan loaded";
    case FaultCode::kStaleState:
      return "no usable joint state";
    case FaultCode::kUnbelievable:
      return "joint reading not believable";
    case FaultCode::kDriveFault:
      return "drive fault";
    case FaultCode::kStartDistance:
      return "too far from the plan's first keyframe";
    case FaultCode::kTrackingError:
      return "tracking error";
  }
  return "unknown";
}

}  // namespace clamber
