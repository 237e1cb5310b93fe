#include "apps/certification.hpp"

#include <cstdio>
#include <filesystem>

#include "apps/config_files.hpp"
#include "apps/options.hpp"
#include "certificate/writer.hpp"
#include "planner_offline/plan_image.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

Json coverage_of(const std::string& certificate) {
  // parse_certificate() has seen the header before.
  return Json::parse(certificate.substr(0, certificate.find('\n'))).at("coverage");
}

/// Stated uncertainty against what the plan holds for, as a table.
std::string uncertainty_table(const Json& coverage) {
  char text[160];
  std::string out;
  std::snprintf(text, sizeof text, "%-22s %11s %11s  %s\n", "certified for", "stated", "holds",
                "unit");
  out += text;
  for (const Json& row : coverage.at("uncertainty")) {
    std::snprintf(text, sizeof text, "%-22s %11.4g %11.4g  %-6s%s\n",
                  row.at("what").get<std::string>().c_str(), row.at("stated").get<double>(),
                  row.at("holds").get<double>(), row.at("unit").get<std::string>().c_str(),
                  row.at("covered").get<bool>() ? "" : "  LESS THAN STATED");
    out += text;
  }
  return out;
}

/// The plan says of itself what its certificate says of it. Empty, or what differs.
std::string check_statement(const Plan& plan, const Certificate& certificate) {
  const std::vector<HeldUncertainty> held = held_uncertainty(certificate);
  const bool same = std::equal(held.begin(), held.end(), plan.certified_for.begin(),
                               plan.certified_for.end(), [](const auto& a, const auto& b) {
                                 return a.what == b.what && a.unit == b.unit &&
                                        a.stated == b.stated && a.holds == b.holds;
                               });
  return same ? "" : "the plan's certified_for is not what its certificate holds for";
}

bool judged(std::size_t quantity) { return kQuantities[quantity].sense != Sense::kRecord; }

}  // namespace

std::string certificate_beside(const std::string& plan_file) {
  return std::filesystem::path(plan_file).replace_extension(".cert").string();
}

Certification certify_plan_file(const std::string& plan_file, const std::string& certificate_file,
                                const RobotModel& model, const Scenario& scenario,
                                const std::string& margins) {
  const PlannedMotion motion(read_file(plan_file, kPlanBytes), plan_file, model, scenario);
  make_folder_of(certificate_file);
  save_certificate(certify(motion, model, scenario, load_acceptance(find_file(margins))),
                   certificate_file);
  return verify_plan_file(plan_file, certificate_file, model, scenario, margins);
}

std::string why_not_certified(Plan& plan, const RobotModel& model, const Scenario& scenario,
                              const std::string& margins) {
  const PlannedMotion motion(format_plan(plan), "the plan found", model, scenario);
  const Acceptance acceptance = load_acceptance(find_file(margins));
  const Certificate certificate = certify(motion, model, scenario, acceptance);
  const VerifyReport report =
      verify(motion, certificate, model, scenario, acceptance, {.all = false});
  if (!report.valid) return "not certified: " + report.reason;
  plan.certified_for.clear();
  for (const HeldUncertainty& held : held_uncertainty(certificate))
    plan.certified_for.push_back({held.what, held.unit, held.stated, held.holds});
  return "";
}

Certification verify_plan_file(const std::string& plan_file, const std::string& certificate_file,
                               const RobotModel& model, const Scenario& scenario,
                               const std::string& margins) {
  std::error_code error;
  if (!std::filesystem::exists(certificate_file, error))
    throw InputError(certificate_file + ": no such file: the plan has no certificate");
  const std::string bytes = read_file(certificate_file, kPlanBytes),
                    plan = read_file(plan_file, kPlanBytes);
  const Certificate certificate = parse_certificate(bytes, certificate_file);
  Certification out{sha256_hex(bytes), {}, coverage_of(bytes)};
  if (const std::string sha256 = sha256_hex(plan); sha256 != certificate.header.plan_sha256) {
    out.report.violations = 1;
    out.report.reason = "the plan is not the one certified: its SHA-256 is " + sha256 + ", not " +
                        certificate.header.plan_sha256;
    return out;
  }
  if (out.report.reason = check_statement(load_plan(plan_file), certificate);
      !out.report.reason.empty()) {
    out.report.violations = 1;
    return out;
  }
  const PlannedMotion motion(plan, plan_file, model, scenario);
  out.report = verify(motion, certificate, model, scenario, load_acceptance(find_file(margins)),
                      {.all = true});
  return out;
}

std::string check_image_file(const std::string& image_file, const std::string& plan_file,
                             const std::string& certificate_file, const RobotModel& model,
                             const Scenario& scenario) {
  const std::string bytes = read_file(certificate_file, kPlanBytes);
  const PlannedMotion motion(read_file(plan_file, kPlanBytes), plan_file, model, scenario);
  return check_image(read_plan_image(image_file), motion,
                     parse_certificate(bytes, certificate_file), sha256_hex(bytes));
}

std::string describe(const Certification& certification) {
  const VerifyReport& report = certification.report;
  char text[200];
  std::string out;
  if (!report.quantities.empty()) {
    std::snprintf(text, sizeof text, "%-22s %11s %11s %11s  %-6s %8s  %s\n", "quantity", "worst",
                  "with gaps", "limit", "unit", "time (s)", "phase");
    out += text;
  }
  for (std::size_t q = 0; q < report.quantities.size(); ++q) {
    if (!judged(q)) continue;
    const VerifiedQuantity& v = report.quantities[q];
    std::snprintf(text, sizeof text, "%-22s %11.4g %11.4g %11.4g  %-6s %8.3f  %s\n",
                  kQuantities[q].name, v.worst.value, v.worst.proven, v.limit, kQuantities[q].unit,
                  v.worst.time, v.phase.c_str());
    out += text;
  }
  if (report.valid) {
    out += uncertainty_table(certification.coverage);
    std::snprintf(text, sizeof text, "certificate: valid, %zu samples\n", report.samples);
    return out + text;
  }
  std::snprintf(text, sizeof text, "certificate: REFUSED, %zu violations: ", report.violations);
  return out + text + report.reason + '\n';
}

Json to_json(const Certification& certification) {
  const VerifyReport& report = certification.report;
  Json margins = Json::array();
  for (std::size_t q = 0; q < report.quantities.size(); ++q) {
    if (!judged(q)) continue;
    const VerifiedQuantity& v = report.quantities[q];
    margins.push_back({{"name", kQuantities[q].name},
                       {"unit", kQuantities[q].unit},
                       {"worst", v.worst.value},
                       {"with_gap", v.worst.proven},
                       {"limit", v.limit},
                       {"time", v.worst.time},
                       {"phase", v.phase}});
  }
  return {{"valid", report.valid},
          {"reason", report.reason},
          {"sha256", certification.sha256},
          {"samples", report.samples},
          {"violations", report.violations},
          {"gravity_error", report.gravity_error},
          {"margins", margins},
          {"uncertainty", certification.coverage.at("uncertainty")},
          {"covered", certification.coverage.at("covered")},
          {"not_covered", certification.coverage.at("not_covered")}};
}

}  // namespace clamber
