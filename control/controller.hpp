// The 1 kHz tick: from measured joint states to joint commands along a plan.
// load() at start-up, everything else in the control thread; allocates: never (the caller lends the
// image and the workspace); blocks: never; throws: never.
//
// It starts in boot and moves nothing until request() has brought `arm` and `start`. Which mode
// follows on what is the supervisor's business (supervisor.hpp, docs/supervisor.md).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "control/blend.hpp"
#include "control/bus_health.hpp"
#include "control/joint_types.hpp"
#include "control/joint_watch.hpp"
#include "control/operator_command.hpp"
#include "control/pid.hpp"
#include "control/plan_clock.hpp"
#include "control/plan_image.hpp"
#include "control/spline.hpp"
#include "control/supervisor.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

struct JointControl {
  PidGains gains;
  double torque_limit = 0.0;    ///< N m
  double lower = 0.0;           ///< rad
  double upper = 0.0;           ///< rad
  double velocity_limit = 0.0;  ///< rad/s
  /// N m/rad of a spring between the encoder and the link; the plan's torque is expected to stretch
  /// it, and the reference leads by as much. 0: rigid, or not made up for.
  double spring_stiffness = 0.0;
};

struct ControllerConfig {
  std::uint32_t joint_count = 0;
  std::array<JointControl, kMaxJoints> joints{};
  double dt = 1e-3;  ///< s
  FeedForward feed_forward = FeedForward::kPlan;
  double torque_rate_limit = 5000.0;  ///< N m/s
  double derivative_filter = 2e-3;    ///< s
  double transfer_time = 0.05;        ///< s, see JointPid
  double time_scale = 1.0;            ///< plan seconds per second
  double start_time = 1.0;            ///< s, shortest move from the measured posture to the plan
  double start_speed = 0.5;           ///< rad/s, fastest joint in that move
  double start_distance_limit = 0.5;  ///< rad, farther from the plan's start: fault
  double hold_time = 4.0;             ///< s at the last keyframe
  double tracking_error_limit = 0.3;  ///< rad; infinity: never
  double overshoot_limit = 0.05;      ///< rad, of the spline beyond its keyframes
  double velocity_factor = 1.0;       ///< refuse a plan faster than this share of the limits
  bool accept_uncertified = false;    ///< see PlanRequirements; no settings file can set it
  std::uint32_t stale_ticks_limit =
      5;                        ///< consecutive ticks of a joint without a usable state: fault
  double jump_limit = 0.05;     ///< rad in a tick beyond the joint's velocity limit: not believed
  double frozen_limit = 0.005;  ///< rad of reference while a joint reads the same to the bit: ditto
  double pause_time = 0.25;     ///< s in which the plan's clock comes from full rate to a stand
  // Infinity: never.
  double saturation_time = 1.0;        ///< s of a joint at its torque limit: fault
  double overspeed_factor = 2.0;       ///< of the velocity limit, measured ...
  double overspeed_time = 0.02;        ///< ... for so many s: fault
  double limit_margin = 0.1;           ///< rad that a joint may be measured beyond its range
  double temperature_limit = 110.0;    ///< degree Celsius of a drive: fault
  double acceleration_limit = 400;     ///< rad/s^2, refuse a plan with more
  double jerk_limit = 20000;           ///< rad/s^3, ditto
  std::uint32_t watchdog_ticks = 100;  ///< grid points in a row that the host may miss
  FailurePolicy failure_policy = FailurePolicy::kHold;  ///< at least, see supervisor.hpp
  double lowering_time = 3.0;                           ///< s in which what carries the robot fades
  double lowering_damping = 20.0;                       ///< N m s/rad while it does

  static constexpr double kNever = std::numeric_limits<double>::infinity();
};

/// Why a plan was not accepted.
enum class LoadStatus : std::uint8_t {
  kOk,
  kBadConfig,  ///< a limit, time or rate is not positive, or the joint count is out of range
  kBadImage,   ///< see LoadReport::image
  kWorkspaceTooSmall,
  kOvershoot,  ///< the spline leaves its keyframes too far, or leaves the joint limits
  kTooFast,    ///< the spline exceeds a velocity limit
  kTooHard,    ///< the acceleration limit
  kTooJerky,   ///< the jerk limit
};

struct LoadReport {
  LoadStatus status = LoadStatus::kOk;
  PlanImageStatus image = PlanImageStatus::kOk;
  PlanImageFault where{};  ///< keyframe and joint of an image's fault; joint of a spline's
  double worst = 0.0;      ///< what the limit was exceeded with, its unit and time_scale applied
  // Of an accepted plan, the largest over all joints, time_scale applied. While the clock brakes,
  // accelerations grow by at most velocity * 1.5 / pause_time.
  double velocity = 0.0;      ///< rad/s
  double acceleration = 0.0;  ///< rad/s^2
  double jerk = 0.0;          ///< rad/s^3; constant between two keyframes
};

/// What a run's loop has to know of a tick; the whole truth is Controller::supervision().
enum class TickStatus : std::uint8_t {
  kMovingToStart,
  kTracking,
  kHolding,   ///< at the last keyframe, for hold_time
  kFinished,  ///< still holding
  kWaiting,   ///< some joint has no usable state: the plan stands, see Controller::command_blind()
  kFault,     ///< see fault(); the plan will not go on
  kIdle,      ///< disabled or ready: waits for the operator
  kPaused,
  kStopped,  ///< held where the operator stopped it
};

[[nodiscard]] const char* to_string(LoadStatus status) noexcept;
[[nodiscard]] const char* to_string(TickStatus status) noexcept;

/// A plan ready to be followed: the checked image and its spline.
struct ControllerPlan {
  using Spline = ClampedSpline<PlanImageView>;
  PlanImageView image;
  Spline spline;
};

/// Whether a running controller takes another plan.
enum class SwitchStatus : std::uint8_t {
  kOk,
  kNotNow,        ///< a fault stands, not loaded, or another switch is under way
  kOtherJoints,   ///< not a plan for this robot
  kTooFar,        ///< beyond start_distance_limit from the present reference
  kLeavesLimits,  ///< the blend would leave the joint range or the velocity limit: pause first
};

class Controller {
 public:
  using Spline = ControllerPlan::Spline;

  /// Doubles of workspace that load() needs for a plan of so many keyframes.
  [[nodiscard]] static constexpr std::size_t workspace_size(std::size_t keyframes) noexcept {
    return Spline::workspace_size(keyframes, kMaxJoints);
  }

  /// Checks configuration and image and builds the spline. The image's bytes and the workspace must
  /// outlive the controller. A controller that refused is in the state of a fault.
  [[nodiscard]] LoadReport load(const ControllerConfig& config, std::string_view robot_hash,
                                std::span<const std::byte> image,
                                std::span<double> workspace) noexcept;

  /// The same checks for a plan to be switched to; any thread.
  [[nodiscard]] static LoadReport open(const ControllerConfig& config, std::string_view robot_hash,
                                       std::span<const std::byte> image,
                                       std::span<double> workspace, ControllerPlan& plan) noexcept;

  /// One tick. `states`, `commands`: joint_count entries in the model's order. Fills every command,
  /// and of the frame all but the simulation's truth.
  [[nodiscard]] TickStatus tick(std::span<const JointState> states,
                                std::span<JointCommand> commands, TelemetryFrame& frame) noexcept;

  /// For the next tick. Of several, a command that takes motion away (pause and above) drops all
  /// lesser ones; commands that give it are taken in the order ack, arm, start, resume. In boot
  /// they wait until every joint has been heard.
  void request(OperatorCommand command) noexcept;
  /// What the next tick will be asked, one bit per OperatorCommand.
  [[nodiscard]] std::uint32_t requests() const noexcept { return requests_; }
  /// For the next tick; said nothing, the buses are well.
  void set_bus_health(const BusHealth& health) noexcept { health_ = health; }
  [[nodiscard]] const BusHealth& bus_health() const noexcept { return health_; }
  /// Share (0 to 1) of time_scale to follow at; the change takes up to pause_time and is smooth.
  void set_speed(double share) noexcept;
  [[nodiscard]] double speed() const noexcept { return speed_; }
  /// From the next tick on blends from the present reference to `plan` at its `time` (s; running
  /// there, at rest at 0) and follows it. Called before its time it is what `start` will start.
  [[nodiscard]] SwitchStatus switch_plan(const ControllerPlan& plan, double time = 0.0) noexcept;

  /// Changes gains or feed-forward between two ticks; the torques go on without a step.
  void set_gains(std::span<const PidGains> gains) noexcept;
  void set_feed_forward(FeedForward feed_forward) noexcept;

  [[nodiscard]] const ControllerConfig& config() const noexcept { return config_; }
  [[nodiscard]] TickStatus status() const noexcept { return status_; }
  [[nodiscard]] SupervisorState supervision() const noexcept { return state_; }
  /// Faults that were present in the last tick, an e-stop not among them.
  [[nodiscard]] FaultSet faults() const noexcept { return faults_; }
  [[nodiscard]] FaultCode fault() const noexcept { return state_.fault; }
  /// The joint that the fault was seen at.
  [[nodiscard]] std::uint32_t fault_joint() const noexcept { return fault_joint_; }
  /// What the robot shall do when it cannot go on, now.
  [[nodiscard]] FailurePolicy failure_policy() const noexcept { return config_.failure_policy; }
  /// What the drives shall do by themselves, from now on, if no command comes any more: the plan's
  /// policy for the phase that the robot is in, or will be in `ahead` seconds from now, which is
  /// how long the drives take to be told. Without a plan: kHold.
  [[nodiscard]] FailurePolicy lost_host_policy(double ahead = 0.0) const noexcept;
  /// Ticks from first to last if nothing holds the plan up and the start move is the shortest.
  [[nodiscard]] std::uint64_t expected_ticks() const noexcept;

 private:
  struct Reference {
    double q = 0.0;
    double dq = 0.0;
    double ddq = 0.0;
    double tau = 0.0;
  };
  /// What the reference follows while the clock runs.
  enum class Path : std::uint8_t { kStand, kToStart, kPlan };
  using States = std::span<const JointState>;

  [[nodiscard]] static LoadReport check_spline(const ControllerConfig& config,
                                               const Spline& spline) noexcept;
  // Inputs of the supervisor.
  [[nodiscard]] bool inspect(States states) noexcept;
  void watch_limits(std::uint32_t joint, const JointState& state) noexcept;
  void watch_tracking(States states) noexcept;
  void see(FaultCode fault, std::uint32_t joint) noexcept;
  [[nodiscard]] bool done() const noexcept;
  void supervise(States states, bool unheard) noexcept;
  void supervise_one(States states, bool unheard, OperatorCommand command) noexcept;
  // What its decisions mean.
  void enter(const SupervisorState& next, States states) noexcept;
  void take_over(States states) noexcept;
  void begin_move() noexcept;
  void begin_plan() noexcept;
  void stand() noexcept;
  void hold_here(States states) noexcept;
  void begin_lowering(States states) noexcept;
  [[nodiscard]] TickStatus progress(bool unheard) const noexcept;
  // The reference.
  void update_reference() noexcept;
  void reference_to_start() noexcept;
  void reference_on_plan() noexcept;
  [[nodiscard]] double stretch(std::size_t joint, double tau) const noexcept;
  [[nodiscard]] Reference plan_at(const ControllerPlan& plan, double time, std::size_t segment,
                                  std::size_t joint) const noexcept;
  [[nodiscard]] MotionPoint present(std::size_t joint) const noexcept;
  [[nodiscard]] SwitchStatus check_blend(const ControllerPlan& plan, double join) const noexcept;
  // Commands.
  void command(States states, std::span<JointCommand> commands) noexcept;
  [[nodiscard]] JointCommand command_held(std::size_t joint, const JointState& state) noexcept;
  [[nodiscard]] JointCommand command_blind(std::size_t joint) const noexcept;
  [[nodiscard]] JointCommand command_lowered(std::size_t joint, const JointState& state) noexcept;
  void count_saturation(States states, std::span<const JointCommand> commands) noexcept;
  void report(States states, std::span<const JointCommand> commands,
              TelemetryFrame& frame) const noexcept;

  ControllerConfig config_;
  ControllerPlan plan_;
  ControllerPlan next_plan_;
  double join_time_ = 0.0;  ///< s on the plan, where the move to its start ends
  double next_join_ = 0.0;
  bool new_plan_ = false;

  SupervisorState state_{.mode = Mode::kFault, .fault = FaultCode::kNotLoaded};
  std::uint32_t requests_ = 0;  ///< bits of OperatorCommand
  BusHealth health_;
  double speed_ = 1.0;
  FaultSet faults_ = 0;  ///< present in this tick
  std::array<std::uint32_t, kFaultCount> seen_at_{};
  std::uint32_t fault_joint_ = 0;
  TickStatus status_ = TickStatus::kFault;  ///< what the last tick returned

  Path path_ = Path::kStand;
  PlanClock clock_;
  std::array<QuinticBlend, kMaxJoints> blend_{};
  std::array<double, kMaxJoints> from_torque_{};  ///< N m, feed-forward at the start of the move
  std::array<double, kMaxJoints> to_torque_{};
  double start_duration_ = 1.0;  ///< s
  double plan_time_ = 0.0;       ///< s
  std::size_t segment_ = 0;
  std::array<Reference, kMaxJoints> reference_{};

  std::array<JointPid, kMaxJoints> pid_{};
  std::array<JointWatch, kMaxJoints> watch_{};
  std::array<double, kMaxJoints> rest_torque_{};  ///< N m, with the last reading that was new
  std::array<double, kMaxJoints> support_{};      ///< N m that carried the joint before lowering
  std::array<JointTrust, kMaxJoints> trust_{};    ///< in this tick's states
  std::array<std::uint32_t, kMaxJoints> lost_ticks_{};  ///< consecutive ones without a usable state
  std::array<std::uint32_t, kMaxJoints> saturated_ticks_{};  ///< ditto at the torque limit
  std::array<std::uint32_t, kMaxJoints> fast_ticks_{};       ///< ditto too fast
  std::uint64_t ticks_ = 0;                                  ///< all
  std::uint64_t mode_ticks_ = 0;  ///< in the mode, without those spent waiting
};

[[nodiscard]] const char* to_string(SwitchStatus status) noexcept;

}  // namespace clamber
