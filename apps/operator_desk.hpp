// What passes between the operator's server and the control thread, without a lock.
// The server puts requests and takes answers, the control thread takes requests, puts answers and
// writes the status. Allocates: never; blocks: never.
#pragma once

#include <cstdint>

#include "apps/realtime/mailbox.hpp"
#include "apps/realtime/snapshot.hpp"
#include "control/operator_command.hpp"

namespace clamber {

struct OperatorRequest {
  std::uint64_t id = 0;
  OperatorCommand command = OperatorCommand::kNone;
};

struct OperatorAnswer {
  std::uint64_t id = 0;
  bool done = false;
  // Static texts: why not, in two pieces.
  const char* reason = "";
  const char* detail = "";
};

/// Texts are static, joints count in the model's order.
struct OperatorStatus {
  const char* state = "boot";
  const char* fault = "none";
  std::uint32_t fault_joint = 0;  ///< beyond the robot's: the fault is none of a joint
  std::uint32_t worst_joint = 0;
  double worst_error = 0.0;  ///< rad, largest |reference - measured| of the run so far
  std::uint64_t ticks = 0;
  double time = 0.0;       ///< s since the first tick
  double plan_time = 0.0;  ///< s on the plan's clock
  std::uint64_t overruns = 0;
  std::uint64_t skipped = 0;
  double worst_wakeup = 0.0;  ///< s
  std::uint64_t missing_replies = 0;
};

struct OperatorDesk {
  Mailbox<OperatorRequest> requests;
  Mailbox<OperatorAnswer> answers;
  Snapshot<OperatorStatus> status;
};

}  // namespace clamber
