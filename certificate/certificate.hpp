// A plan's certificate: for every sample of the motion the contact forces that carry the robot and
// every margin, bound to the plan, robot and scenario it was made for; and its file.
// Start-up and tools only: allocates, reads and writes files, throws InputError.
//
// File: one line of JSON (the header), then the samples, little-endian:
//   per sample  f64 time | u64 touching points (bit i: candidate i) | f64 value[27] | f64 gap[27] |
//               f64[3] force per set bit, in bit order.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "certificate/acceptance.hpp"
#include "certificate/measure.hpp"

namespace clamber {

struct CertificateHeader {
  std::string tool_version;
  std::string plan_sha256;   ///< of the plan file's bytes
  std::string image_sha256;  ///< of the plan image, its certificate field zeroed
  std::string robot, robot_hash;
  std::string scenario, scenario_hash;
  std::string limits_sha256;     ///< of joint names and limits as text
  double friction = 0.0;         ///< the scenario's
  double obstacle_height = 0.0;  ///< m
  double ballast_mass = 0.0;     ///< kg
  double total_mass = 0.0;       ///< kg
  double spacing = 0.01;         ///< s, largest between two samples
  Acceptance acceptance;
};

struct CertificateSample {
  double time = 0.0;  ///< s
  TouchMask touching = 0;
  Measured measured;
  std::vector<Eigen::Vector3d> forces;  ///< one per bit of `touching`
};

struct Certificate {
  CertificateHeader header;
  std::vector<CertificateSample> samples;
};

/// Joint names, position, velocity and torque limits, as one digest.
[[nodiscard]] std::string limits_digest(const RobotModel& model);

/// SHA-256 of the plan image (control/plan_image.hpp) that these keyframes make, without a
/// certificate's digest in it.
[[nodiscard]] std::string image_digest(const PlannedMotion& motion, const RobotModel& model);

/// The file's bytes. The header's `worst` table and `covers` text are derived when written.
[[nodiscard]] std::string format_certificate(const Certificate& certificate);
/// @throws InputError for anything that is not a certificate, or is cut short or too long
[[nodiscard]] Certificate parse_certificate(std::string_view bytes, const std::string& file);

void save_certificate(const Certificate& certificate, const std::filesystem::path& file);

/// What of an uncertain world was asked for, and what the margins hold for at the worst sample.
struct HeldUncertainty {
  const char* what;
  const char* unit;
  double stated = 0.0;
  double holds = 0.0;
};
[[nodiscard]] std::vector<HeldUncertainty> held_uncertainty(const Certificate& certificate);

/// The worst of one quantity over all samples, and the worst that may be between them.
struct WorstValue {
  double value = 0.0;
  double proven = 0.0;  ///< value and gap of the sample where they are worst together
  double time = 0.0;    ///< s, of `proven`
};
[[nodiscard]] WorstValue worst_of(const Certificate& certificate, Quantity quantity);

}  // namespace clamber
