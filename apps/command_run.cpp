// clamber run: executes a plan at 1 kHz.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "apps/run_support.hpp"
#include "apps/steps.hpp"
#include "apps/timing_report.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

struct Options {
  std::string plan;
  std::string out = "out/run.log";
  std::string report;
  ExecutionOptions execution;
  RobotOptions robot;
  ScenarioOptions scenario;
};

void save_report(const Options& options, const ExecutorReport& execution, bool success,
                 const std::string& failure) {
  if (options.report.empty()) return;
  nlohmann::ordered_json report{{"success", success}, {"reason", failure}};
  report["execution"] = to_json(execution);
  write_text(options.report, report.dump(2) + '\n');
}

void run_on_drives(const Options& options, const RobotModel& model, const Scenario& scenario) {
  if (options.execution.rehearse) {
    if (!options.execution.operator_socket.empty())
      throw InputError("--operator: a rehearsal has nobody to wait for");
    const RehearsalRun result =
        rehearse_plan(options.robot, model, scenario, options.plan, options.execution, options.out);
    save_report(options, result.execution, result.success(), result.failure());
    std::cout << describe(result) << "written:     " << options.out << std::endl;
    if (!result.success()) throw JobFailed("the rehearsal failed: " + result.failure());
    return;
  }
  if (!options.execution.frame_log.empty() && !options.execution.lock_step)
    throw InputError(
        "--frame-log: needs --lock-step or --rehearse: only then frames have an order of their own "
        "(in real "
        "time: candump -l)");
  const BusRun result = run_plan_on_buses(options.robot, model, scenario, options.plan,
                                          options.execution, options.out);
  save_report(options, result.execution, result.success(), result.failure(model));
  std::cout << describe(result, model) << "written:     " << options.out << std::endl;
  if (!result.success()) throw JobFailed("the run failed: " + result.failure(model));
}

void run(const Options& options) {
  const StopGuard guard;  // what became of a run is told even if it was told to stop at its end
  const RobotModel model = load_robot(options.robot);
  const Scenario scenario = load_scenario(options.scenario);
  if (read_backend(options.execution.hal) == Backend::kSocketCan)
    return run_on_drives(options, model, scenario);
  if (options.execution.lock_step || options.execution.rehearse ||
      !options.execution.frame_log.empty())
    throw InputError(
        "--lock-step, --rehearse and --frame-log: only on motor buses (--hal), not with backend "
        "ode");
  const SimulatedRun result =
      run_plan(options.robot, model, scenario, options.plan, options.execution, options.out);
  save_report(options, result.execution, result.success(), result.failure(model));
  std::cout << describe(result, model) << "written:     " << options.out << std::endl;
  if (!result.success()) throw JobFailed("the climb failed: " + result.failure(model));
}

}  // namespace

void add_run_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("run", "Executes a plan with the 1 kHz controller and judges the climb");
  command->add_option("plan", options->plan, "plan.json")->required();
  command->add_option("-o,--out", options->out, "run log")->capture_default_str();
  command->add_option("--report", options->report, "JSON file: outcome, ticks, timing, guards");
  command->add_option("--certificate", options->execution.certificate,
                      "the plan's certificate (<plan>.cert)");
  command->add_flag("--uncertified", options->execution.uncertified,
                    "run it without a valid certificate, in the simulation");
  command->add_option("--operator", options->execution.operator_socket,
                      "socket for `clamber arm|start|pause|resume|stop|disarm|estop|ack|status`: "
                      "the run waits, drives off, until it is armed and started");
  command->add_flag("--lock-step", options->execution.lock_step,
                    "motor buses: ticks end when the drives of `clamber drives` say so");
  command->add_flag("--rehearse", options->execution.rehearse,
                    "motor buses: simulated, with virtual drives and robot, in this process");
  command->add_option("--inputs", options->execution.inputs,
                      "log of what the controller is given, for `clamber replay`");
  command->add_option("--frame-log", options->execution.frame_log,
                      "motor buses in lock step or rehearsed: every frame, in candump's format");
  add_execution_options(*command, options->execution);
  add_robot_options(*command, options->robot);
  add_scenario_options(*command, options->scenario);
  command->footer(
      "Robot and scenario must be those the plan was made for, and its certificate must hold\n"
      "(see clamber verify). Every tick goes to the log and\n"
      "to DDS (`clamber monitor`): with --realtime a frame that finds no room is dropped and\n"
      "counted, without it the loop waits between ticks, so that none is lost.\n"
      "Exit code 1: the judge, who knows nothing of the plan, does not see the robot on top.\n\n"
      "With a bus map (--hal) the same controller moves drives on CAN buses, by the clock or,\n"
      "with simulated drives, in lock step (clamber drives --help). The drives are off when it "
      "ends, however it ends.\n\n"
      "Examples:\n"
      "  clamber run out/climb/plan.json --realtime --feed-forward none -o pid_only.log\n"
      "  clamber run out/climb/plan.json --hal configs/hal/coman_mit.yaml --lock-step");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
