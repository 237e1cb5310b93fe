// One row of the fault matrix: a robot of six joints on two buses, brought into a state, a fault
// put on its first bus or that bus's first drive, and what came of it.
#pragma once

#include <string>

#include "firmware_hal/bus_map.hpp"

namespace clamber::test {

enum class RobotState { kDisabled, kReady, kExecuting, kHolding };
inline constexpr RobotState kRobotStates[] = {RobotState::kDisabled, RobotState::kReady,
                                              RobotState::kExecuting, RobotState::kHolding};
[[nodiscard]] const char* to_string(RobotState state);

struct FaultOutcome {
  /// Disabled: "enables" or "refuses". Else what the host does: "goes on", "waits" (the plan stands
  /// for some ticks), "holds" (fault: all joints held where they are); without a host: "none".
  std::string host;
  /// What the drives of the bus do at the end: "on", "off", "let go" (some, by themselves), "stop"
  /// (some hold by themselves).
  std::string drives;
  std::string detail;  ///< the fault's name, if there is one
  int ticks = 0;       ///< until the reaction; 0: there is none
  int moved = 0;       ///< mrad, farthest that a joint got from its reference, rounded up
};

/// How long a fault lasts and is watched.
inline constexpr int kFaultTicks = 300;

/// @throws InputError for a fault that does not exist, or not with this protocol
[[nodiscard]] FaultOutcome rehearse_fault(const std::string& fault, BusProtocol protocol,
                                          RobotState state);

}  // namespace clamber::test
