// What telemetry is told at start-up: where to send, and what the numbers in a frame mean.
// Start-up only: allocates, reads the environment, throws.
#pragma once

#include <string>
#include <vector>

namespace clamber {

struct TelemetryConfig {
  bool enabled = true;  ///< for whoever starts the publisher: when false, none is created
  int domain = 0;       ///< DDS domain, 0 to 232
  /// IPv4 addresses or names of the interfaces that DDS may use; nothing is sent on any other.
  std::vector<std::string> interfaces = {"127.0.0.1"};
  std::string robot = "coman";  ///< second part of our topics' names, rt/<robot>/telemetry/...
};

/// What a subscriber needs to read the frames; published once, kept for late joiners.
struct TelemetryDescription {
  std::vector<std::string> joint_names;    ///< in the frames' order, at most 32
  std::vector<double> torque_limits;       ///< N m, magnitude, one per joint
  std::vector<std::string> contact_names;  ///< in the frames' order, at most 16
};

/// `config` with what the environment says: CLAMBER_DDS_DOMAIN (else ROS_DOMAIN_ID) and
/// CLAMBER_DDS_INTERFACES, a list separated by commas.
/// @throws InputError naming the variable
[[nodiscard]] TelemetryConfig with_environment(TelemetryConfig config);

/// IPv4 addresses of config.interfaces, names resolved.
/// @throws InputError when an interface does not exist or the list is empty
[[nodiscard]] std::vector<std::string> interface_addresses(const TelemetryConfig& config);

/// @throws InputError when a frame could not hold what is described, or a name is no DDS name
void check(const TelemetryConfig& config, const TelemetryDescription& description);

}  // namespace clamber
