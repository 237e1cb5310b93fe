// What a target says of itself (ROOT/etc/clamber/target.yaml), for bundles to be compared with.
// Start-up and tools; allocates, reads a file; throws InputError.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "deploy/manifest.hpp"

namespace clamber {

/// When a version that was just started counts as working.
struct HealthSettings {
  double time = 5.0;      ///< s without a break in which all is well
  double timeout = 60.0;  ///< s from the restart until that must have been seen
  int overruns = 0;       ///< late ticks that are allowed meanwhile
};

struct Target {
  std::string robot;
  std::optional<std::string> model;  ///< hash of the robot model; nothing: any
  std::optional<Hardware> hardware;  ///< nothing: any
  std::vector<std::string>
      restart;  ///< command that restarts the service; empty: nothing runs here
  std::string operator_socket = "/run/clamber/operator.sock";  ///< below the root
  std::string health_file = "/run/clamber/health.json";        ///< below the root
  HealthSettings health;
  bool doctor = false;  ///< the preflight asks `clamber doctor` about this machine, too
};

[[nodiscard]] std::filesystem::path target_file(const std::filesystem::path& root);
[[nodiscard]] Target load_target(const std::filesystem::path& root);
[[nodiscard]] std::string format_target(const Target& target);

/// This machine.
struct Machine {
  std::string name;    ///< uname -m
  std::string kernel;  ///< uname -r
};
[[nodiscard]] Machine this_machine();

/// @throws InputError beginning with `what` when the bundle is for another robot, hardware,
/// machine,
///   kernel or flasher
void require_match(const Manifest& manifest, const Target& target, const Machine& machine,
                   const std::string& what);

}  // namespace clamber
