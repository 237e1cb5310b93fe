// clamber run: executes a plan at 1 kHz.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "apps/steps.hpp"

namespace clamber {
namespace {

struct Options {
  std::string plan;
  std::string out = "out/run.log";
  ExecutionOptions execution;
  RobotOptions robot;
  ScenarioOptions scenario;
};

void run(const Options& options) {
  const RobotModel model = load_robot(options.robot);
  const Scenario scenario = load_scenario(options.scenario);
  const SimulatedRun result =
      run_plan(options.robot, model, scenario, options.plan, options.execution, options.out);
  std::cout << describe(result, model) << "written:     " << options.out << '\n';
  if (!result.success()) throw JobFailed("the climb failed: " + result.failure(model));
}

}  // namespace

void add_run_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("run", "Executes a plan with the 1 kHz controller and judges the climb");
  command->add_option("plan", options->plan, "plan.json")->required();
  command->add_option("-o,--out", options->out, "run log")->capture_default_str();
  command->add_option("--certificate", options->execution.certificate,
                      "the plan's certificate (<plan>.cert)");
  command->add_flag("--uncertified", options->execution.uncertified,
                    "run it without a valid certificate, in the simulation");
  add_execution_options(*command, options->execution);
  add_robot_options(*command, options->robot);
  add_scenario_options(*command, options->scenario);
  command->footer(
      "Robot and scenario must be those the plan was made for, and its certificate must hold\n"
      "(see clamber verify). Every tick goes to the log and\n"
      "to DDS (`clamber monitor`): with --realtime a frame that finds no room is dropped and\n"
      "counted, without it the loop waits between ticks, so that none is lost.\n"
      "Exit code 1: the judge, who knows nothing of the plan, does not see the robot on top.\n\n"
      "Example:\n"
      "  clamber run out/climb/plan.json --realtime --feed-forward none -o pid_only.log");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
