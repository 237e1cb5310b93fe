// clamber plan: contact sequence -> plan.
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "apps/commands.hpp"
#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "apps/steps.hpp"
#include "apps/sweep_case.hpp"

namespace clamber {
namespace {

struct Options {
  std::string contacts;
  bool no_recording = false;
  std::string settings = "configs/planner/default.yaml";
  PlanFiles files{.plan = "out/plan.json",
                  .certificate = {},
                  .image = {},
                  .trajectory = {},
                  .costs = {},
                  .rejected = {}};
  RobotOptions robot;
  ScenarioOptions scenario;
};

std::string joined(const std::vector<std::string>& order) {
  std::string text;
  for (const std::string& links : order) text += (text.empty() ? "" : ", ") + links;
  return text;
}

/// The logs lie beside the plan and are named after it where no other place is given.
PlanFiles with_logs(PlanFiles files) {
  const auto beside = [&files](const char* ending) {
    return std::filesystem::path(files.plan).replace_extension(ending).string();
  };
  if (files.costs.empty()) files.costs = beside(".costs.csv");
  if (files.rejected.empty()) files.rejected = beside(".rejected.txt");
  return files;
}

void run(const Options& options) {
  const RobotModel model = load_robot(options.robot);
  const Scenario scenario = load_scenario(options.scenario);
  std::optional<ContactSequence> recorded;
  if (!options.contacts.empty()) recorded = load_contacts(find_file(options.contacts), model);
  Progress progress;
  progress.stage("planning");
  const PlanningResult result =
      make_plan(model, scenario, options.no_recording ? nullptr : &*recorded, options.settings,
                with_logs(options.files), progress);
  progress.stage("planned");
  std::cout << describe(result, model, recorded ? recorded->notes : std::vector<std::string>());
  std::cout << "order:       " << joined(contact_order(result.plan)) << '\n';
  if (options.no_recording && recorded)
    std::cout << "recorded:    " << contact_order(*recorded) << '\n';
  std::cout << std::flush;
  const Certification certification = certify_plan(model, scenario, options.files);
  std::cout << describe(certification) << "written:     " << options.files.plan << '\n';
  if (!certification.report.valid)
    throw JobFailed("the plan found is not certified: " + certification.report.reason);
}

}  // namespace

void add_plan_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "plan", "Finds a statically stable, torque-feasible climb along a contact sequence");
  auto* contacts = command->add_option("contacts", options->contacts, "contacts.yaml");
  command->add_flag(
      "--no-recording", options->no_recording,
      "searches for contacts, their order and places instead of taking a recording's; "
      "contacts.yaml is compared with then, if given");
  command->add_option("-o,--out", options->files.plan, "the plan")->capture_default_str();
  command->add_option("--certificate", options->files.certificate, "its certificate (<plan>.cert)");
  command->add_option("--export", options->files.trajectory,
                      "CSV at 100 Hz: base pose, joints, feed-forward torques");
  command->add_option("--log", options->files.costs,
                      "CSV: cost of every iteration (<plan>.costs.csv)");
  command->add_option("--rejected", options->files.rejected,
                      "why each candidate was given up, a line each (<plan>.rejected.txt)");
  command->add_option("--image", options->files.image, "the plan as the controller loads it");
  command->add_option("--planner", options->settings, "the planner's settings")
      ->capture_default_str();
  add_robot_options(*command, options->robot);
  add_scenario_options(*command, options->scenario);
  command->footer(
      "Every posture of the plan balances with its contact forces inside the friction cones and\n"
      "its joint torques inside the limits. Exit code 1: no such climb was found, and which\n"
      "move failed at which constraint, or the plan is not certified; the two logs are written "
      "then too.\n\n"
      "Example:\n"
      "  clamber plan contacts.yaml --scenario configs/scenarios/box_0.20.yaml \\\n"
      "    -o plan.json --export trajectory.csv --log costs.csv");
  command->callback([options, contacts] {
    if (contacts->empty() && !options->no_recording)
      throw CLI::RequiredError("contacts (or --no-recording)");
    run(*options);
  });
}

}  // namespace clamber
