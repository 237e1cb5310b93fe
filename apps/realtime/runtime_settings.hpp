// How the control thread runs on this machine (configs/runtime/*.yaml): priority, processors,
// memory, guards, the operator's socket, telemetry.
// Start-up only: allocates, reads a file, throws InputError.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "telemetry/telemetry_config.hpp"

namespace clamber {

enum class GuardAction : std::uint8_t {
  kOff,
  kCount,  ///< the run goes on and fails at its end
  kAbort,  ///< the process ends at once, with a line that says which call it was
};

/// What watches the control thread, see tick_guards.hpp.
struct GuardSettings {
  GuardAction malloc = GuardAction::kOff;
  GuardAction syscalls = GuardAction::kOff;  ///< off or abort
  GuardAction faults = GuardAction::kOff;    ///< off or count

  [[nodiscard]] bool any() const noexcept {
    return malloc != GuardAction::kOff || syscalls != GuardAction::kOff ||
           faults != GuardAction::kOff;
  }
};

struct OperatorSettings {
  std::string socket;    ///< path; empty: no operator, the run starts by itself
  std::string group;     ///< owner of the socket besides the user; empty: the user's own
  unsigned mode = 0660;  ///< of the socket
};

struct RuntimeSettings {
  int priority = 80;               ///< of SCHED_FIFO, 1 to 99; 0: as it is
  std::vector<int> processors;     ///< that the thread may run on; empty: as it is
  bool lock_memory = true;         ///< of the whole process, mlockall()
  std::size_t stack = 512 * 1024;  ///< bytes, of the control thread, touched before the first tick
  bool required = false;           ///< refuse to run with less than that; else say it and go on
  double warm_up = 0.5;            ///< s from the first tick in which page faults are not counted
  GuardSettings guards;
  OperatorSettings operator_socket;
  TelemetryConfig telemetry;  ///< of any run, paced or not
};

/// A thread like any other.
[[nodiscard]] inline RuntimeSettings ordinary_thread() {
  RuntimeSettings settings;
  settings.priority = 0;
  settings.lock_memory = false;
  return settings;
}

/// @throws InputError naming file, line and key
[[nodiscard]] RuntimeSettings load_runtime_settings(const std::filesystem::path& file);

/// "malloc,syscalls,faults", any of them: each in its strictest form.
/// @throws InputError
[[nodiscard]] GuardSettings parse_guards(const std::string& list);

}  // namespace clamber
