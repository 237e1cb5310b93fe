// What a running service says of itself in a file, and whether that is good enough to keep a
// version. Any thread; allocates, reads and writes a file of a few lines; throws JobFailed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "deploy/target.hpp"

namespace clamber {

/// What is known of the joints' drives.
struct DriveHealth {
  int heard = 0;        ///< joints that are fresh and without an error
  int faulty = 0;       ///< joints whose drive reports an error
  std::string trouble;  ///< "RKneeSag: no answer, ..."
};

struct ServiceHealth {
  std::string bundle;  ///< id of the one it was started from; empty: of none
  int process = 0;
  bool ready = false;
  bool torque = false;
  std::uint64_t beats = 0;     ///< of the control loop
  std::uint64_t pings = 0;     ///< to the service manager's watchdog, or what would have been some
  std::uint64_t overruns = 0;  ///< late ticks, or looks for the operator while drives are off
  int joints = 0;
  DriveHealth drives;
  std::string problem;  ///< why the watchdog is not fed; empty: it is
};

/// Replaced at once: a reader never sees half of one. Not written to the disk: of this boot only.
void save_health(const ServiceHealth& health, const std::filesystem::path& file);
/// nullopt: there is none, or nothing of the kind.
[[nodiscard]] std::optional<ServiceHealth> load_health(const std::filesystem::path& file);

/// Waits until the bundle has been well for as long as the settings ask, without a break: ready,
/// process alive, loop and watchdog going, every joint heard, no torque, no more late ticks than
/// allowed. A drive with an error, or one that is silent for 5 s, ends the waiting.
/// @param interrupted  ends the waiting
/// @throws JobFailed with the last thing that was wrong
void await_health(const std::filesystem::path& file, const std::string& bundle,
                  const HealthSettings& settings, const std::function<bool()>& interrupted);

}  // namespace clamber
