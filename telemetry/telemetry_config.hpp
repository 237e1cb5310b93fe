// What telemetry is told at start-up: where to send, and what the numbers in a frame mean.
// Start-up only: allocates, reads the environment, throws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace clamber {

struct TelemetryConfig {
  bool enabled = true;  ///< for whoever starts the publisher: when false, none is created
  int domain = 0;       ///< DDS domain, 0 to 232
  /// IPv4 addresses or names of the interfaces that DDS may use; nothing is sent on any other.
  std::vector<std::string> interfaces = {"127.0.0.1"};
  /// Folder with the credentials of DDS Security (scripts/dds_security); empty: in the clear.
  std::string security;
  /// The publisher runs in a process of its own, see publisher_process.hpp.
  bool separate_process = false;
  std::string robot = "coman";  ///< second part of our topics' names, rt/<robot>/telemetry/...
};

/// A link of the robot and how it hangs on the one before, for rt/tf.
struct DescribedLink {
  std::string name;
  std::string parent;
  int joint = -1;                                         ///< that turns it; -1: fixed
  std::array<double, 3> position{};                       ///< m, at joint angle 0
  std::array<double, 4> orientation{1.0, 0.0, 0.0, 0.0};  ///< w x y z, ditto
  std::array<double, 3> axis{0.0, 0.0, 1.0};              ///< of the joint, in the link's frame
};

/// A phase of the plan.
struct DescribedPhase {
  std::string name;
  std::uint32_t contacts = 0;  ///< one bit per contact that is to carry
};

/// What a subscriber needs to read the frames; published once, kept for late joiners.
struct TelemetryDescription {
  std::vector<std::string> joint_names;    ///< in the frames' order, at most 32
  std::vector<double> torque_limits;       ///< N m, magnitude, one per joint
  std::vector<std::string> contact_names;  ///< in the frames' order, at most 16
  double dt = 1e-3;                        ///< s from tick to tick
  std::string plan;                        ///< SHA-256 of what is executed; may be empty
  std::vector<std::string> modes;          ///< names of TelemetryFrame::mode
  std::vector<std::string> faults;         ///< names of TelemetryFrame::fault
  std::vector<DescribedPhase> phases;      ///< of TelemetryFrame::phase, at most 512
  std::string base;                        ///< link that the base pose is of; empty: no rt/tf
  std::vector<DescribedLink> links;        ///< all but the base
  std::string urdf;                        ///< for rt/robot_description; empty: none

  static constexpr std::size_t kMaxPhases = 512;
  static constexpr std::size_t kMaxModes = 16;
  static constexpr std::size_t kMaxFaults = 32;

  /// "" for a phase that is not described.
  [[nodiscard]] std::string_view phase_name(std::uint32_t phase) const noexcept {
    return phase < phases.size() ? std::string_view(phases[phase].name) : std::string_view();
  }
  /// 0 for a phase that is not described.
  [[nodiscard]] std::uint32_t contacts_of(std::uint32_t phase) const noexcept {
    return phase < phases.size() ? phases[phase].contacts : 0;
  }
};

/// `config` with what the environment says: CLAMBER_DDS_DOMAIN (else ROS_DOMAIN_ID) and
/// CLAMBER_DDS_INTERFACES, a list separated by commas, and CLAMBER_DDS_SECURITY, a folder.
/// @throws InputError naming the variable
[[nodiscard]] TelemetryConfig with_environment(TelemetryConfig config);

/// IPv4 addresses of config.interfaces, names resolved.
/// @throws InputError when an interface does not exist or the list is empty
[[nodiscard]] std::vector<std::string> interface_addresses(const TelemetryConfig& config);

/// @throws InputError when a frame could not hold what is described, or a name is no DDS name
void check(const TelemetryConfig& config, const TelemetryDescription& description);

}  // namespace clamber
