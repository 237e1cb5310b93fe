// Checks a certificate from the plan's text, the robot model and the scenario alone.
// Start-up and tools only: allocates; one thread; deterministic.
//
// Shares no code with planner_offline (and links none of it): reader, interpolation, distances,
// support polygon and statics are this folder's own. Of the robot model it takes loading and
// forward kinematics, and checks the model's gravity torque against differences of potential
// energy.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "certificate/certificate.hpp"

namespace clamber {

/// The worst of one quantity as the verifier found it itself.
struct VerifiedQuantity {
  WorstValue worst;
  double limit = 0.0;
  std::string phase;  ///< of the plan, where it is worst
};

struct VerifyReport {
  bool valid = false;
  std::string reason;          ///< the first thing wrong: when, what, by how much; empty if valid
  std::size_t samples = 0;     ///< checked until then
  std::size_t violations = 0;  ///< samples with something wrong (1 for a header)
  std::size_t unphysical = 0;  ///< of these, samples where a margin or the balance is violated, not
                               ///< only a stored number wrong
  double gravity_error = 0.0;  ///< N m, gravity torque against potential energy
  double stored_error = 0.0;   ///< largest |stored - recomputed|
  std::vector<VerifiedQuantity> quantities;  ///< in the order of kQuantities; empty before samples
};

struct VerifyOptions {
  bool all = false;  ///< go on after the first violation, to count them and find the worst
  bool stored =
      true;  ///< compare stored numbers; false: ask only whether the witness still carries
};

/// Judges. A file that cannot be read as what it should be is an InputError; one that can and does
/// not hold is a report that says why.
/// @throws InputError
[[nodiscard]] VerifyReport verify(const PlannedMotion& motion, const Certificate& certificate,
                                  const RobotModel& model, const Scenario& scenario,
                                  const Acceptance& acceptance, const VerifyOptions& options = {});

/// The same from the files' bytes; a plan that is not the one certified is refused unread.
[[nodiscard]] VerifyReport verify(std::string_view plan, std::string_view certificate,
                                  const RobotModel& model, const Scenario& scenario,
                                  const Acceptance& acceptance, const VerifyOptions& options = {});

/// Empty if the image carries exactly the plan's keyframes and the certificate's digest; else what
/// differs. `certificate_sha256`: of the certificate's bytes.
[[nodiscard]] std::string check_image(std::span<const std::byte> image, const PlannedMotion& motion,
                                      const Certificate& certificate,
                                      const std::string& certificate_sha256);

}  // namespace clamber
