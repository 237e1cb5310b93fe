// clamber report: makes the report again from the files of a climb.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/out_folder.hpp"

namespace clamber {
namespace {

struct Options {
  std::string folder;
  std::optional<std::string> robot;
  std::optional<std::string> scenario;
};

void run(const Options& options) {
  const OutFolder out(options.folder);
  ClimbInputs inputs = load_inputs(out);
  if (options.robot) inputs.robot.robot = *options.robot;
  if (options.scenario) inputs.scenario.scenario = *options.scenario;
  const RobotModel model = load_robot(inputs.robot);
  const Scenario scenario = load_scenario(inputs.scenario);
  print_summary(write_report_of(out, model, scenario), std::cout);
  std::cout << "written: " << (out.path() / "report.html").string() << '\n';
}

}  // namespace

void add_report_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("report", "Writes report.html and its pictures from a climb's files");
  command->add_option("folder", options->folder, "what `clamber climb --out` wrote")->required();
  command->add_option("--robot", options->robot, "the robot (else as summary.json says)");
  command->add_option("--scenario", options->scenario, "the scenario (else as summary.json says)");
  command->footer(
      "Reads plan.json, contacts.yaml, climb.log, playback.log (if there) and summary.json.\n\n"
      "Example:\n"
      "  clamber report out/climb");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
