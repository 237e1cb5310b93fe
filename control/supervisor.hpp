// The safety supervisor: which mode the controller is in, as a pure function of the mode before,
// the operator's command and what is wrong. No clock, no memory, no floating point: every state and
// every combination of inputs is enumerated by tests/control/supervisor_test.cpp, which also
// generates docs/supervisor.md from it.
// Any thread; allocates: never; blocks: never; throws: never.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "control/failure_policy.hpp"
#include "control/operator_command.hpp"

namespace clamber {

enum class Mode : std::uint8_t {
  kBoot,      ///< not every joint has been heard yet; no torque
  kDisabled,  ///< all is well, nobody has asked for torque
  kReady,     ///< armed: the robot is held where it was
  kMovingToStart,
  kExecuting,
  kPaused,    ///< the plan's clock brakes and stands, the robot is held on the plan
  kHolding,   ///< held at the plan's end, where it was stopped, or (with a fault) where it failed
  kLowering,  ///< sinks, damped, while what carries it fades; fault
  kLimp,      ///< no torque, perhaps still in motion; fault
  kFault,     ///< no torque
};
inline constexpr std::size_t kModeCount = 10;

/// What made the controller give up. Kept until the operator acknowledges it.
enum class FaultCode : std::uint8_t {
  kNone,
  kNotLoaded,      ///< no plan, or spans of another size than the robot's
  kStaleState,     ///< a joint had no usable state (stale, not finite) for too long
  kUnbelievable,   ///< a joint's reading could not be believed for too long, see joint_watch.hpp
  kDriveFault,     ///< a drive reports a fault
  kStartDistance,  ///< the robot stands too far from the plan's first keyframe
  kTrackingError,
  kSaturation,   ///< a joint at its torque limit for too long
  kOverspeed,    ///< a joint measured too fast for too long
  kJointLimit,   ///< a joint measured beyond its range
  kTemperature,  ///< a drive is about to switch itself off
  kBusDown,
  kWatchdog,  ///< the host itself missed too many ticks in a row
  kEstop,
};
inline constexpr std::size_t kFaultCount = 14;

/// Faults present in a tick, one bit each.
using FaultSet = std::uint32_t;
[[nodiscard]] constexpr FaultSet bit(FaultCode fault) noexcept {
  return fault == FaultCode::kNone ? 0u : 1u << static_cast<unsigned>(fault);
}

/// The fault was seen at one joint, not at all of the robot.
[[nodiscard]] constexpr bool concerns_a_joint(FaultCode fault) noexcept {
  return fault != FaultCode::kNone && fault != FaultCode::kNotLoaded &&
         fault != FaultCode::kEstop && fault != FaultCode::kBusDown &&
         fault != FaultCode::kWatchdog;
}

/// What the drives do, in ascending severity.
enum class DriveAction : std::uint8_t {
  kFollow,  ///< loops on a moving reference
  kHold,    ///< loops on a reference that stands or brakes
  kLower,   ///< damping, and the torque that carried the robot, fading
  kLimp,    ///< no torque
  kOff,     ///< no torque, and the drives may be switched off
};

struct SupervisorState {
  Mode mode = Mode::kBoot;
  /// Never kNone in lowering, limp and fault; in holding, kNone is a hold in good order.
  FaultCode fault = FaultCode::kNone;
  friend bool operator==(const SupervisorState&, const SupervisorState&) = default;
};

struct SupervisorInputs {
  OperatorCommand command = OperatorCommand::kNone;
  FaultSet faults = 0;    ///< present now; an e-stop is a command
  bool unheard = false;   ///< some joint has no usable state in this tick
  bool new_plan = false;  ///< another plan is to be blended into
  /// The mode has run its course: at the plan's start (moving), at its end (executing), sunk
  /// (lowering), at rest (limp). In paused: the plan's start has been reached before.
  bool done = false;
  /// What the plan (or the settings) wants of a robot that cannot go on.
  FailurePolicy planned = FailurePolicy::kHold;
};

[[nodiscard]] constexpr bool has_torque(Mode mode) noexcept {
  return mode >= Mode::kReady && mode <= Mode::kLowering;
}

[[nodiscard]] constexpr bool moves_on_plan(Mode mode) noexcept {
  return mode == Mode::kMovingToStart || mode == Mode::kExecuting;
}

[[nodiscard]] constexpr DriveAction drive_action(Mode mode) noexcept {
  if (mode == Mode::kLowering) return DriveAction::kLower;
  if (mode == Mode::kLimp) return DriveAction::kLimp;
  if (!has_torque(mode)) return DriveAction::kOff;
  return moves_on_plan(mode) ? DriveAction::kFollow : DriveAction::kHold;
}

/// The least that a fault demands of drives that carry torque: kHold, kLower, kLimp or kOff.
[[nodiscard]] constexpr DriveAction reaction_to(FaultCode fault, FailurePolicy planned) noexcept {
  const DriveAction as_planned = planned == FailurePolicy::kHold    ? DriveAction::kHold
                                 : planned == FailurePolicy::kLower ? DriveAction::kLower
                                                                    : DriveAction::kLimp;
  switch (fault) {
    case FaultCode::kNone:
      return DriveAction::kFollow;
    case FaultCode::kNotLoaded:
      return DriveAction::kOff;
    // Every joint answers and obeys: to stand still takes nothing away from what carries the robot.
    case FaultCode::kStartDistance:
    case FaultCode::kTrackingError:
    case FaultCode::kSaturation:
    case FaultCode::kOverspeed:
    case FaultCode::kJointLimit:
      return DriveAction::kHold;
    // Holding heats on until the drive lets go; to sink while one still can is the better end.
    case FaultCode::kTemperature:
      return as_planned == DriveAction::kLimp ? DriveAction::kLimp : DriveAction::kLower;
    // The host has lost its grip on a joint, or is told that its grip does harm.
    case FaultCode::kStaleState:
    case FaultCode::kUnbelievable:
    case FaultCode::kDriveFault:
    case FaultCode::kBusDown:
    case FaultCode::kWatchdog:
    case FaultCode::kEstop:
      return as_planned;
  }
  return DriveAction::kOff;
}

/// Of faults that demand the same, the one to report: nearer to the cause comes first.
inline constexpr std::array<FaultCode, kFaultCount - 1> kFaultOrder = {
    FaultCode::kNotLoaded,    FaultCode::kEstop,         FaultCode::kDriveFault,
    FaultCode::kBusDown,      FaultCode::kWatchdog,      FaultCode::kStaleState,
    FaultCode::kUnbelievable, FaultCode::kTemperature,   FaultCode::kJointLimit,
    FaultCode::kOverspeed,    FaultCode::kStartDistance, FaultCode::kTrackingError,
    FaultCode::kSaturation};

/// The most severe of the faults in the set, kNone if it is empty.
[[nodiscard]] constexpr FaultCode worst_of(FaultSet faults, FailurePolicy planned) noexcept {
  FaultCode worst = FaultCode::kNone;
  if (faults == 0) return worst;
  for (const FaultCode fault : kFaultOrder)
    if ((faults & bit(fault)) != 0 && reaction_to(fault, planned) > reaction_to(worst, planned))
      worst = fault;
  return worst;
}

/// The state after one tick, or after one of several commands in a tick.
[[nodiscard]] SupervisorState supervise(const SupervisorState& state,
                                        const SupervisorInputs& inputs) noexcept;

[[nodiscard]] const char* to_string(Mode mode) noexcept;
[[nodiscard]] const char* to_string(FaultCode fault) noexcept;
[[nodiscard]] const char* to_string(DriveAction action) noexcept;
/// What has to be so before an acknowledgement of the fault is taken.
[[nodiscard]] const char* clear_condition(FaultCode fault) noexcept;

}  // namespace clamber
