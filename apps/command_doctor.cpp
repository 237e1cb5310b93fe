// clamber doctor: is everything ready for a run? Computer, CAN links, configuration, plans, DDS.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/certification.hpp"
#include "apps/commands.hpp"
#include "apps/config_files.hpp"
#include "apps/doctor/can_checks.hpp"
#include "apps/doctor/machine_checks.hpp"
#include "apps/job_failed.hpp"
#include "apps/options.hpp"
#include "apps/steps.hpp"
#include "robot_model/loader.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber {
namespace {

struct Options {
  std::vector<std::string> plans;
  std::string hal = "configs/hal/ode.yaml";
  std::string runtime = "configs/runtime/default.yaml";
  std::string control = "configs/control/default.yaml";
  std::string folder = ".";
  double latency = 0.0;
  bool json = false;
  bool strict = false;
  RobotOptions robot;
  ScenarioOptions scenario;
};

/// What a check threw instead of a finding.
template <class Check>
void look(Findings& findings, const std::string& name, const Check& check) {
  try {
    check();
  } catch (const InputError& error) {
    findings.push_back({name, Verdict::kProblem, error.what(), "put that file right"});
  }
}

void add(Findings& all, Findings more) {
  for (Finding& finding : more) all.push_back(std::move(finding));
}

void check_computer(const Options& options, Findings& findings) {
  const MachineRoot root;
  RuntimeSettings runtime;
  look(findings, "runtime", [&] { runtime = load_runtime_settings(find_file(options.runtime)); });
  findings.push_back(check_kernel(root));
  findings.push_back(check_clocksource(root));
  findings.push_back(check_governor(root));
  findings.push_back(check_isolation(root, runtime));
  add(findings, check_permissions(runtime));
  findings.push_back(check_latency(options.latency, runtime.priority));
  findings.push_back(check_disk(options.folder));
  findings.push_back(check_shared_memory(root));
}

void check_bus_map(const Options& options, const RobotModel& robot, Findings& findings) {
  if (read_backend(options.hal) == Backend::kSimulation) {
    findings.push_back({"can", Verdict::kSkipped, options.hal + " is the simulation",
                        "name the robot's bus map: --hal configs/hal/coman_mit.yaml"});
    return;
  }
  const BusMap map = load_bus_map(find_file(options.hal), robot);
  add(findings, check_buses(map));
  const auto now = std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now());
  findings.push_back(check_calibration(map, now.time_since_epoch().count()));
}

void check_plan(const Options& options, const RobotModel& robot, const std::string& plan,
                Findings& findings) {
  const Certification result =
      verify_plan_file(plan, certificate_beside(plan), robot, load_scenario(options.scenario));
  if (result.report.valid)
    findings.push_back({"plan", Verdict::kFine, plan + ": its certificate holds", ""});
  else
    findings.push_back({"plan", Verdict::kProblem, plan + ": " + result.report.reason,
                        "clamber verify " + plan + " shows more; or plan it again"});
}

void check_dds(const RobotModel& robot, Findings& findings) {
  TelemetryConfig telemetry;
  telemetry.robot = robot.name;
  telemetry = with_environment(telemetry);
  std::string addresses;
  for (const std::string& address : interface_addresses(telemetry))
    addresses += (addresses.empty() ? "" : ", ") + address;
  findings.push_back({"dds", Verdict::kFine,
                      "domain " + std::to_string(telemetry.domain) + " on " + addresses, ""});
}

Findings examine(const Options& options) {
  Findings findings;
  check_computer(options, findings);
  std::optional<RobotModel> robot;
  look(findings, "robot", [&] { robot = load_robot(options.robot); });
  if (!robot) return findings;
  look(findings, "control", [&] {
    static_cast<void>(load_control(options.control, options.robot, *robot));
    findings.push_back({"control", Verdict::kFine, options.control + " suits " + robot->name, ""});
  });
  look(findings, "can", [&] { check_bus_map(options, *robot, findings); });
  for (const std::string& plan : options.plans)
    look(findings, "plan", [&] { check_plan(options, *robot, plan, findings); });
  if (options.plans.empty())
    findings.push_back({"plan", Verdict::kSkipped, "none named", "clamber doctor PLAN..."});
  look(findings, "dds", [&] { check_dds(*robot, findings); });
  return findings;
}

std::ptrdiff_t count(const Findings& findings, Verdict verdict) {
  return std::count_if(findings.begin(), findings.end(),
                       [&](const Finding& finding) { return finding.verdict == verdict; });
}

void print(const Findings& findings) {
  const bool colour = isatty(STDOUT_FILENO) != 0;
  constexpr std::array<const char*, 4> kColours = {"\033[32m", "\033[33m", "\033[31m", "\033[2m"};
  for (const Finding& f : findings) {
    char line[64];
    std::snprintf(line, sizeof line, "%-8s %-18s", to_string(f.verdict), f.check.c_str());
    std::cout << (colour ? kColours[static_cast<std::size_t>(f.verdict)] : "") << line
              << (colour ? "\033[0m" : "") << ' ' << f.seen << '\n';
    if (!f.remedy.empty()) std::cout << std::string(28, ' ') << "-> " << f.remedy << '\n';
  }
}

nlohmann::ordered_json to_json(const Findings& findings, bool ready) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& f : findings)
    list.push_back({{"check", f.check},
                    {"verdict", to_string(f.verdict)},
                    {"seen", f.seen},
                    {"remedy", f.remedy}});
  return {{"ready", ready}, {"findings", list}};
}

void run(const Options& options) {
  const Findings findings = examine(options);
  const auto problems = count(findings, Verdict::kProblem);
  const auto advice = count(findings, Verdict::kAdvice);
  const bool ready = problems == 0 && (!options.strict || advice == 0);
  if (options.json)
    std::cout << to_json(findings, ready).dump(2) << '\n';
  else
    print(findings);
  if (!ready)
    throw JobFailed("not ready: problems: " + std::to_string(problems) +
                    ", advice: " + std::to_string(advice));
}

}  // namespace

void add_doctor_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "doctor", "Looks over computer, CAN links, configuration and plans before a run");
  command->add_option("plan", options->plans, "plan.json, with its certificate beside it");
  command->add_option("--hal,--hal-config", options->hal, "what stands behind the motor bus")
      ->capture_default_str();
  command->add_option("--runtime", options->runtime, "the control thread's settings")
      ->capture_default_str();
  command->add_option("--control", options->control, "the controller's settings")
      ->capture_default_str();
  command->add_option("--latency", options->latency, "s of cyclictest (package rt-tests); 0: none")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 3600.0));
  command->add_option("--logs", options->folder, "folder that the logs go to")
      ->capture_default_str();
  command->add_flag("--json", options->json, "the findings as JSON");
  command->add_flag("--strict", options->strict, "advice counts as a problem");
  add_robot_options(*command, options->robot);
  add_scenario_options(*command, options->scenario);
  command->footer(
      "Every finding comes with what to do about it. Nothing is changed, no motor is touched.\n"
      "problem: a run would be refused, late or unsafe. advice: it works, less well than it "
      "could.\n"
      "Exit codes: 0 ready, 1 a problem (with --strict: or advice), 2 unusable input.\n\n"
      "Examples:\n"
      "  clamber doctor                                             this computer\n"
      "  clamber doctor out/climb/plan.json --hal configs/hal/coman_mit.yaml --latency 10");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
