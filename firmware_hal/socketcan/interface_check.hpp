// Is a CAN interface fit for its bus? What start-up says when it is not.
// Start-up only: allocates; blocks: never.
#pragma once

#include "firmware_hal/socketcan/socketcan_port.hpp"

namespace clamber {

/// @throws InputError: no CAN in the kernel, permission denied, interface absent, of another kind,
///   down, MTU without FD. One line: what, where, how to put it right
void require_interface(const SocketCanSettings& settings);

/// The same for an error of the system calls that open the port.
[[noreturn]] void fail_to_open(const SocketCanSettings& settings, int error);

}  // namespace clamber
