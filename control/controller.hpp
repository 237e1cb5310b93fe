// The 1 kHz tick: from measured joint states to joint commands along a plan.
// load() at start-up, tick() in the control thread; allocates: never (the caller lends the image
// and the workspace); blocks: never; throws: never.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "control/joint_types.hpp"
#include "control/joint_watch.hpp"
#include "control/pid.hpp"
#include "control/plan_image.hpp"
#include "control/spline.hpp"
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
};

/// Why a plan was not accepted.
enum class LoadStatus : std::uint8_t {
  kOk,
  kBadConfig,  ///< a limit, time or rate is not positive, or the joint count is out of range
  kBadImage,   ///< see LoadReport::image
  kWorkspaceTooSmall,
  kOvershoot,  ///< the spline leaves its keyframes too far, or leaves the joint limits
  kTooFast,    ///< the spline exceeds a velocity limit
};

struct LoadReport {
  LoadStatus status = LoadStatus::kOk;
  PlanImageStatus image = PlanImageStatus::kOk;
  PlanImageFault where{};  ///< keyframe and joint of an image's fault; joint of a spline's
  double worst = 0.0;      ///< rad or rad/s, for kOvershoot and kTooFast
};

enum class TickStatus : std::uint8_t {
  kMovingToStart,
  kTracking,
  kHolding,   ///< at the last keyframe, for hold_time
  kFinished,  ///< still holding
  kWaiting,   ///< some joint has no usable state: the plan stands, see Controller::command_blind()
  kFault,     ///< see fault(); the robot is held, the plan will not go on
};

enum class FaultCode : std::uint8_t {
  kNone,
  kNotLoaded,      ///< no plan, or spans of another size than the robot's
  kStaleState,     ///< a joint had no usable state (stale, not finite) for too long
  kUnbelievable,   ///< a joint's reading could not be believed for too long, see joint_watch.hpp
  kDriveFault,     ///< a drive reports a fault
  kStartDistance,  ///< the robot stands too far from the plan's first keyframe
  kTrackingError,
};

[[nodiscard]] const char* to_string(LoadStatus status) noexcept;
[[nodiscard]] const char* to_string(TickStatus status) noexcept;
[[nodiscard]] const char* to_string(FaultCode fault) noexcept;

class Controller {
 public:
  using Spline = ClampedSpline<PlanImageView>;

  /// Doubles of workspace that load() needs for a plan of so many keyframes.
  [[nodiscard]] static constexpr std::size_t workspace_size(std::size_t keyframes) noexcept {
    return Spline::workspace_size(keyframes, kMaxJoints);
  }

  /// Checks configuration and image and builds the spline. The image's bytes and the workspace must
  /// outlive the controller. A controller that refused is in the state of a fault.
  [[nodiscard]] LoadReport load(const ControllerConfig& config, std::string_view robot_hash,
                                std::span<const std::byte> image,
                                std::span<double> workspace) noexcept;

  /// One tick. `states`, `commands`: joint_count entries in the model's order. Fills every command,
  /// and of the frame all but the simulation's truth.
  [[nodiscard]] TickStatus tick(std::span<const JointState> states,
                                std::span<JointCommand> commands, TelemetryFrame& frame) noexcept;

  /// Changes gains or feed-forward between two ticks; the torques go on without a step.
  void set_gains(std::span<const PidGains> gains) noexcept;
  void set_feed_forward(FeedForward feed_forward) noexcept;

  [[nodiscard]] const ControllerConfig& config() const noexcept { return config_; }
  [[nodiscard]] TickStatus status() const noexcept { return status_; }
  [[nodiscard]] FaultCode fault() const noexcept { return fault_; }
  /// The joint that the fault was seen at.
  [[nodiscard]] std::uint32_t fault_joint() const noexcept { return fault_joint_; }
  /// Ticks from first to last if nothing holds the plan up and the start move is the shortest.
  [[nodiscard]] std::uint64_t expected_ticks() const noexcept;

 private:
  struct Reference {
    double q = 0.0;
    double dq = 0.0;
    double tau = 0.0;
  };

  [[nodiscard]] LoadReport check_spline() const noexcept;
  [[nodiscard]] bool inspect(std::span<const JointState> states) noexcept;
  [[nodiscard]] bool begin(std::span<const JointState> states) noexcept;
  void advance_mode() noexcept;
  void update_reference() noexcept;
  void reference_to_start() noexcept;
  void reference_on_plan() noexcept;
  [[nodiscard]] double stretch(std::size_t joint, double tau) const noexcept;
  [[nodiscard]] double first_reference(std::size_t joint) const noexcept;
  void check_tracking(std::span<const JointState> states) noexcept;
  void hold_here(std::span<const JointState> states) noexcept;
  void raise(FaultCode fault, std::uint32_t joint) noexcept;
  void command(std::span<const JointState> states, std::span<JointCommand> commands) noexcept;
  [[nodiscard]] JointCommand command_blind(std::size_t joint) const noexcept;
  void report(std::span<const JointState> states, std::span<const JointCommand> commands,
              TelemetryFrame& frame) const noexcept;

  ControllerConfig config_;
  PlanImageView plan_;
  Spline spline_;
  std::array<JointPid, kMaxJoints> pid_{};
  std::array<double, kMaxJoints> start_q_{};  ///< measured at the first tick, rad
  std::array<Reference, kMaxJoints> reference_{};
  std::array<JointWatch, kMaxJoints> watch_{};
  std::array<double, kMaxJoints> rest_torque_{};        ///< N m, with the last reading that was new
  std::array<JointTrust, kMaxJoints> trust_{};          ///< in this tick's states
  std::array<std::uint32_t, kMaxJoints> lost_ticks_{};  ///< consecutive ones without a usable state
  double start_duration_ = 0.0;                         ///< s
  double plan_time_ = 0.0;                              ///< s
  std::size_t segment_ = 0;
  std::uint64_t ticks_ = 0;                 ///< all
  std::uint64_t mode_ticks_ = 0;            ///< in mode_, without those spent waiting
  TickStatus mode_ = TickStatus::kFault;    ///< never kWaiting
  TickStatus status_ = TickStatus::kFault;  ///< what the last tick returned
  bool begun_ = false;
  FaultCode fault_ = FaultCode::kNotLoaded;
  std::uint32_t fault_joint_ = 0;
};

}  // namespace clamber
