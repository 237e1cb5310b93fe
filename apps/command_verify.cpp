// clamber verify: checks a plan's certificate from plan, robot and scenario alone.
#include <iostream>
#include <memory>

#include "apps/certification.hpp"
#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "apps/options.hpp"

namespace clamber {
namespace {

struct Options {
  std::string plan;
  std::string certificate;
  std::string image;
  std::string margins = kDefaultMargins;
  bool json = false;
  RobotOptions robot;
  ScenarioOptions scenario;
};

void run(const Options& options) {
  const RobotModel model = load_robot(options.robot);
  const Scenario scenario = load_scenario(options.scenario);
  const std::string certificate =
      options.certificate.empty() ? certificate_beside(options.plan) : options.certificate;
  Certification result =
      verify_plan_file(options.plan, certificate, model, scenario, options.margins);
  if (result.report.valid && !options.image.empty()) {
    result.report.reason =
        check_image_file(options.image, options.plan, certificate, model, scenario);
    result.report.valid = result.report.reason.empty();
    result.report.violations = result.report.valid ? 0 : 1;
  }
  if (options.json) {
    std::cout << to_json(result).dump(2) << '\n';
  } else {
    std::cout << describe(result);
  }
  if (!result.report.valid) throw JobFailed("the plan is refused: " + result.report.reason);
}

}  // namespace

void add_verify_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("verify", "Checks a plan against its certificate, without the planner");
  command->add_option("plan", options->plan, "plan.json")->required();
  command->add_option("--certificate", options->certificate, "its certificate (<plan>.cert)");
  command->add_option("--image", options->image, "also check that this plan image is that plan");
  command->add_option("--margins", options->margins, "what a plan must keep")
      ->capture_default_str();
  command->add_flag("--json", options->json, "the result as JSON");
  add_robot_options(*command, options->robot);
  add_scenario_options(*command, options->scenario);
  command->footer(
      "Every number of the certificate is computed again, at most 10 ms apart, from the plan's\n"
      "spline, the robot model and the scenario: balance of the contact forces, friction cones,\n"
      "torques, limits, distances, support. The table shows the worst of each, and the worst that\n"
      "may be between two samples. Exit codes: 0 valid, 1 refused and why, 2 unusable input.\n\n"
      "Example:\n"
      "  clamber verify out/climb/plan.json --image out/climb/plan.img");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
