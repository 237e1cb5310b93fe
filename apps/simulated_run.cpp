#include "apps/simulated_run.hpp"

#include <cmath>
#include <sstream>

#include "apps/controller_config.hpp"
#include "apps/run_support.hpp"
#include "apps/timing_report.hpp"
#include "robot_model/loader.hpp"
#include "sim_backend/ode_bus.hpp"

namespace clamber {
namespace {

// The judge looks at every so many ticks.
constexpr std::uint64_t kJudgePeriod = 5;

void note_peak(const RobotModel& model, const TelemetryFrame& frame, SimulatedRun& run) {
  for (std::size_t j = 0; j < frame.joint_count; ++j) {
    if (std::abs(frame.tau_meas[j]) <= run.peak_torque) continue;
    run.peak_torque = std::abs(frame.tau_meas[j]);
    run.peak_joint = model.joints[j].name;
  }
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : " ") + name;
  return text.empty() ? "none" : text;
}

}  // namespace

bool SimulatedRun::success() const {
  return execution.status == TickStatus::kFinished && execution.bus != BusStatus::kDown &&
         verdict.success && !execution.guards.found();
}

double SimulatedRun::real_time_factor() const {
  return execution.wall_time > 0.0 ? execution.duration / execution.wall_time : 0.0;
}

std::string SimulatedRun::failure(const RobotModel& model) const {
  if (success()) return {};
  if (execution.stopped) return "interrupted";
  if (execution.bus == BusStatus::kDown) return "the motor bus went down";
  if (execution.status == TickStatus::kFault) {
    const std::string joint = execution.fault_joint < model.joints.size()
                                  ? " at " + model.joints[execution.fault_joint].name
                                  : "";
    return std::string("the controller gave up: ") + to_string(execution.fault) + joint + "; " +
           describe(verdict);
  }
  if (execution.guards.found()) return execution.guards.finding();
  return describe(verdict);
}

SimulatedRun run_in_simulation(const RobotModel& model, const Scenario& scenario,
                               const std::vector<std::byte>& image,
                               const SimulatedRunOptions& options) {
  ControllerConfig control = options.control;
  Perturbation perturbation = options.perturbation.value_or(Perturbation{});
  perturbation.springs |= options.springs;
  if (!options.perturbation) perturbation.step = control.dt;
  if (perturbation.springs) expect_springs(model, control);
  LoadedController loaded(model, control, image);
  Controller& controller = loaded.controller;

  const Configuration start = options.start.value_or(start_configuration(model, scenario));
  OdeWorld world(perturbed(model, perturbation), perturbed(scenario, perturbation),
                 perturbed(start, scenario, perturbation), perturbed(OdeOptions{}, perturbation));
  OdeBus bus(world, perturbation.drives, control.dt);
  ClimbJudge judge(world.model(), world.scenario());
  std::optional<RunLogWriter> log;
  if (!options.log.empty())
    log.emplace(options.log, make_run_log_header(model, options.plan_sha256, options.control.dt),
                log_capacity(controller, options.realtime));
  const std::unique_ptr<InputLogWriter> inputs =
      log_inputs(options.inputs, model, control, image, options.plan_sha256,
                 log_capacity(controller, options.realtime));
  const StopGuard guard;  // outlives telemetry, whose beginning and end take their time
  std::optional<RunTelemetry> telemetry;
  if (options.dds)
    telemetry.emplace(model, options.runtime.telemetry, options.executed, control.dt);

  SimulatedRun run;
  run.feed_forward = options.control.feed_forward == FeedForward::kPlan;
  std::optional<RunOperator> operator_desk;
  if (!options.runtime.operator_socket.socket.empty())
    operator_desk.emplace(options.runtime.operator_socket, model);
  ExecutorOptions execution{.realtime = options.realtime, .stop = guard.flag()};
  execution.runtime = options.runtime;
  if (operator_desk) execution.desk = &operator_desk->desk();
  execution.log = log ? &*log : nullptr;
  execution.inputs = inputs.get();
  if (telemetry) execution.telemetry = &telemetry->port();
  execution.observe = [&](TelemetryFrame& frame) {
    read_truth(world, frame);
    note_peak(model, frame, run);
    if (options.observe) options.observe(world, frame);
    if (frame.sequence % kJudgePeriod == 0)
      judge.push(world.time(), world.contacts(), world.velocity());
    if (telemetry && !options.realtime) telemetry->wait_for_room();
  };
  RunPulse pulse;
  execution.pulse = &pulse;
  std::shared_ptr<void> companion;
  if (options.companion) companion = options.companion(pulse, telemetry ? &*telemetry : nullptr);
  run.execution = execute(controller, bus, execution);
  if (operator_desk) run.operator_summary = operator_desk->summary();
  if (telemetry) run.telemetry = telemetry->finish();
  run.verdict = judge.verdict();
  return run;
}

std::string describe(const SimulatedRun& run, const RobotModel& model) {
  std::ostringstream out;
  out.precision(3);
  const ExecutorReport& execution = run.execution;
  out << "run:         " << to_string(execution.status) << " after " << execution.ticks
      << " ticks, " << run.real_time_factor() << " times real time\n";
  out << run.operator_summary << describe_timing(execution);
  out << "peak torque: " << run.peak_torque << " N m (" << run.peak_joint << ")\n";
  out << "on top:      " << joined(run.verdict.final_contacts) << ", "
      << 100.0 * run.verdict.weight_on_obstacle << " % of the weight\n";
  if (run.telemetry) out << describe(*run.telemetry);
  out << "judge:       " << (run.success() ? "success" : "failure: " + run.failure(model)) << '\n';
  return out.str();
}

}  // namespace clamber
