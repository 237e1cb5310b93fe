// What an operator may ask of the controller, and which of two commands counts.
// Any thread; plain data; allocates: never; blocks: never; throws: never.
//
// Commands reach the controller between two ticks by Controller::request(); of several in one tick
// the more severe counts, so that an e-stop is never lost behind a resume.
#pragma once

#include <cstdint>

namespace clamber {

/// In ascending severity: a command that takes motion away outranks one that gives it.
/// What each does in which state: docs/supervisor.md.
enum class OperatorCommand : std::uint8_t {
  kNone,
  kAck,     ///< has seen the fault; the only way out of one
  kArm,     ///< drives may carry torque: the robot is held where it is
  kStart,   ///< move to the plan's start, then execute it
  kResume,  ///< the plan's clock runs on
  kPause,   ///< the plan's clock slows down to a stand, the robot is held
  kStop,    ///< as pause, but the plan is given up
  kDisarm,  ///< no torque; taken only where nothing moves
  kEstop,   ///< the failure action at once, latched as a fault
};

inline constexpr std::uint8_t kOperatorCommandCount = 9;

[[nodiscard]] constexpr OperatorCommand more_severe(OperatorCommand a, OperatorCommand b) noexcept {
  return a < b ? b : a;
}

/// The word of the command line and of the operator's socket.
[[nodiscard]] constexpr const char* to_string(OperatorCommand command) noexcept {
  switch (command) {
    case OperatorCommand::kNone:
      return "none";
    case OperatorCommand::kAck:
      return "ack";
    case OperatorCommand::kArm:
      return "arm";
    case OperatorCommand::kStart:
      return "start";
    case OperatorCommand::kResume:
      return "resume";
    case OperatorCommand::kPause:
      return "pause";
    case OperatorCommand::kStop:
      return "stop";
    case OperatorCommand::kDisarm:
      return "disarm";
    case OperatorCommand::kEstop:
      return "estop";
  }
  return "unknown";
}

}  // namespace clamber
