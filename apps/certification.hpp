// Certificates of plan files: made after planning, verified before running.
// One thread; allocates; reads and writes files; throws InputError.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "certificate/verify.hpp"
#include "planner_offline/plan.hpp"

namespace clamber {

inline constexpr const char* kDefaultMargins = "configs/certificate/default.yaml";

struct Certification {
  std::string sha256;  ///< of the certificate's bytes
  VerifyReport report;
  nlohmann::ordered_json coverage;  ///< what the certificate says it holds for, and what not
};

/// The plan's file name with the ending .cert.
[[nodiscard]] std::string certificate_beside(const std::string& plan_file);

/// Writes the certificate of a plan file and verifies it as anybody would, from the files.
[[nodiscard]] Certification certify_plan_file(const std::string& plan_file,
                                              const std::string& certificate_file,
                                              const RobotModel& model, const Scenario& scenario,
                                              const std::string& margins = kDefaultMargins);

/// Why a plan would get no valid certificate, found without files; empty: it would, and the plan
/// says for what uncertainty.
[[nodiscard]] std::string why_not_certified(Plan& plan, const RobotModel& model,
                                            const Scenario& scenario,
                                            const std::string& margins = kDefaultMargins);

/// Verifies a plan file against its certificate.
[[nodiscard]] Certification verify_plan_file(const std::string& plan_file,
                                             const std::string& certificate_file,
                                             const RobotModel& model, const Scenario& scenario,
                                             const std::string& margins = kDefaultMargins);

/// Verifies that the image is the certified plan. Empty, or what differs.
[[nodiscard]] std::string check_image_file(const std::string& image_file,
                                           const std::string& plan_file,
                                           const std::string& certificate_file,
                                           const RobotModel& model, const Scenario& scenario);

/// The worst of every quantity as a table, and the verdict.
[[nodiscard]] std::string describe(const Certification& certification);
/// valid, reason, samples, violations, gravity_error, margins [{name, unit, worst, with_gap, limit,
/// time, phase}], covered, not_covered.
[[nodiscard]] nlohmann::ordered_json to_json(const Certification& certification);

}  // namespace clamber
