// Allows the calling thread a short list of system calls, for good: any other ends the process
// with SIGSYS and a line on standard error that names it (seccomp).
// Install: once per thread, allocates, throws. Afterwards nothing remains of it but the filter.
#pragma once

#include <cstdint>

namespace clamber {

/// What the thread's bus does in exchange().
enum class BusCalls : std::uint8_t {
  kNone,        ///< pure code
  kSockets,     ///< CAN interfaces, with opening them again when they come back
  kSimulation,  ///< allocates, so it asks the kernel for memory
};

/// Always allowed: clocks and sleeping, page-fault counters, what a thread does to end. Needs no
/// privilege (no_new_privs). Other threads are not concerned.
/// @throws InputError when the kernel has no seccomp or another architecture's
void install_syscall_guard(BusCalls bus);

}  // namespace clamber
