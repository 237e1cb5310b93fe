#include "control/supervisor.hpp"

#include <algorithm>

namespace clamber {
namespace {

Mode failure_mode(DriveAction reaction) noexcept {
  switch (reaction) {
    case DriveAction::kFollow:
    case DriveAction::kHold:
      return Mode::kHolding;
    case DriveAction::kLower:
      return Mode::kLowering;
    case DriveAction::kLimp:
      return Mode::kLimp;
    case DriveAction::kOff:
      return Mode::kFault;
  }
  return Mode::kFault;
}

/// Severity only grows until the operator acknowledges; no fault switches torque on.
SupervisorState give_up(const SupervisorState& state, FaultCode fault,
                        FailurePolicy planned) noexcept {
  const bool latched = state.fault != FaultCode::kNone;
  const Mode least = latched ? state.mode : Mode::kHolding;
  const Mode reaction = failure_mode(reaction_to(fault, planned));
  const Mode wanted = has_torque(state.mode)      ? reaction
                      : state.mode == Mode::kLimp ? std::max(Mode::kLimp, reaction)
                                                  : Mode::kFault;
  const Mode mode = std::max(least, wanted);
  // The first fault is the cause of what follows, unless something worse decides what is done.
  return {mode, latched && mode == state.mode ? state.fault : fault};
}

/// With a fault latched and none present any more.
SupervisorState acknowledge(const SupervisorState& state, const SupervisorInputs& in) noexcept {
  if (state.mode == Mode::kHolding && !in.unheard) return {Mode::kReady, FaultCode::kNone};
  if (state.mode == Mode::kFault)
    return {in.unheard ? Mode::kBoot : Mode::kDisabled, FaultCode::kNone};
  return state;
}

/// What takes motion away counts at all times; what gives it, only while every joint is heard.
Mode obey(Mode mode, const SupervisorInputs& in) noexcept {
  const bool heard = !in.unheard;
  switch (in.command) {
    case OperatorCommand::kArm:
      return mode == Mode::kDisabled && heard ? Mode::kReady : mode;
    case OperatorCommand::kStart:
      return (mode == Mode::kReady || mode == Mode::kHolding) && heard ? Mode::kMovingToStart
                                                                       : mode;
    case OperatorCommand::kResume:
      if (mode != Mode::kPaused || !heard) return mode;
      return in.done ? Mode::kExecuting : Mode::kMovingToStart;
    case OperatorCommand::kPause:
      return moves_on_plan(mode) ? Mode::kPaused : mode;
    case OperatorCommand::kStop:
      return moves_on_plan(mode) || mode == Mode::kPaused ? Mode::kHolding : mode;
    case OperatorCommand::kDisarm:
      return mode == Mode::kReady || mode == Mode::kHolding ? Mode::kDisabled : mode;
    case OperatorCommand::kNone:
    case OperatorCommand::kAck:
    case OperatorCommand::kEstop:
      return mode;
  }
  return mode;
}

/// Without any fault.
Mode go_on(Mode mode, const SupervisorInputs& in) noexcept {
  if (in.command != OperatorCommand::kNone) return obey(mode, in);
  if (in.unheard) return mode;
  if (mode == Mode::kBoot) return Mode::kDisabled;
  if (in.new_plan && (moves_on_plan(mode) || mode == Mode::kPaused || mode == Mode::kHolding))
    return Mode::kMovingToStart;
  if (mode == Mode::kMovingToStart && in.done) return Mode::kExecuting;
  if (mode == Mode::kExecuting && in.done) return Mode::kHolding;
  return mode;
}

}  // namespace

SupervisorState supervise(const SupervisorState& state, const SupervisorInputs& in) noexcept {
  SupervisorState next = state;
  const FaultSet faults =
      in.faults | (in.command == OperatorCommand::kEstop ? bit(FaultCode::kEstop) : 0u);
  if (faults != 0) next = give_up(state, worst_of(faults, in.planned), in.planned);
  if (next.fault == FaultCode::kNone) return {go_on(state.mode, in), FaultCode::kNone};
  if (next.mode != state.mode) return next;
  if ((next.mode == Mode::kLowering || next.mode == Mode::kLimp) && in.done)
    return {Mode::kFault, next.fault};
  if (next.mode == Mode::kHolding && in.command == OperatorCommand::kDisarm)
    return {Mode::kFault, next.fault};
  if (faults == 0 && in.command == OperatorCommand::kAck) return acknowledge(next, in);
  return next;
}

const char* to_string(Mode mode) noexcept {
  switch (mode) {
    case Mode::kBoot:
      return "boot";
    case Mode::kDisabled:
      return "disabled";
    case Mode::kReady:
      return "ready";
    case Mode::kMovingToStart:
      return "moving to start";
    case Mode::kExecuting:
      return "executing";
    case Mode::kPaused:
      return "paused";
    case Mode::kHolding:
      return "holding";
    case Mode::kLowering:
      return "lowering";
    case Mode::kLimp:
      return "limp";
    case Mode::kFault:
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
    case FaultCode::kSaturation:
      return "torque limit for too long";
    case FaultCode::kOverspeed:
      return "joint too fast";
    case FaultCode::kJointLimit:
      return "joint beyond its range";
    case FaultCode::kTemperature:
      return "drive too hot";
    case FaultCode::kBusDown:
      return "motor bus down";
    case FaultCode::kWatchdog:
      return "the host missed too many ticks";
    case FaultCode::kEstop:
      return "emergency stop";
  }
  return "unknown";
}

const char* to_string(DriveAction action) noexcept {
  switch (action) {
    case DriveAction::kFollow:
      return "follow";
    case DriveAction::kHold:
      return "hold";
    case DriveAction::kLower:
      return "lower";
    case DriveAction::kLimp:
      return "limp";
    case DriveAction::kOff:
      return "off";
  }
  return "unknown";
}

const char* clear_condition(FaultCode fault) noexcept {
  switch (fault) {
    case FaultCode::kNone:
      return "";
    case FaultCode::kNotLoaded:
      return "a plan that the controller accepts is loaded";
    case FaultCode::kStaleState:
      return "every joint has a fresh, finite state";
    case FaultCode::kUnbelievable:
      return "every joint's reading is within reach of its last believed one and moves with it";
    case FaultCode::kDriveFault:
      return "no drive reports a fault";
    case FaultCode::kStartDistance:
      return "at once: it only refuses the start";
    case FaultCode::kTrackingError:
      return "every joint within the limit of where it is held";
    case FaultCode::kSaturation:
      return "no joint at its torque limit";
    case FaultCode::kOverspeed:
      return "no joint measured too fast";
    case FaultCode::kJointLimit:
      return "every joint measured within its range and the margin";
    case FaultCode::kTemperature:
      return "every drive below the limit";
    case FaultCode::kBusDown:
      return "the buses answer";
    case FaultCode::kWatchdog:
      return "at once: ticks come again";
    case FaultCode::kEstop:
      return "at once: the operator takes it back";
  }
  return "";
}

}  // namespace clamber
