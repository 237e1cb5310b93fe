#include "apps/bus_run.hpp"

#include <cmath>
#include <sstream>

#include "apps/controller_config.hpp"
#include "apps/run_support.hpp"
#include "apps/timing_report.hpp"
#include "firmware_hal/frame_log.hpp"
#include "firmware_hal/socketcan/socketcan_bus.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

/// Looks at what passes; the bus behind it does the work.
class WatchedBus final : public MotorBus {
 public:
  explicit WatchedBus(CanMotorBus& bus) : bus_(bus) {}

  [[nodiscard]] int joint_count() const noexcept override { return bus_.joint_count(); }
  [[nodiscard]] BusStatus enable() override { return bus_.enable(); }
  [[nodiscard]] BusStatus exchange(std::span<const JointCommand> commands,
                                   std::span<JointState> states,
                                   std::int64_t deadline_ns) noexcept override {
    const BusStatus status = bus_.exchange(commands, states, deadline_ns);
    for (std::size_t j = 0; j < states.size(); ++j) {
      if (std::abs(states[j].tau) > peak_torque) {
        peak_torque = std::abs(states[j].tau);
        peak_joint = j;
      }
      if (states[j].age > oldest) {
        oldest = states[j].age;
        oldest_joint = j;
      }
    }
    return status;
  }
  [[nodiscard]] bool set_failure_policy(FailurePolicy policy) noexcept override {
    return bus_.set_failure_policy(policy);
  }
  [[nodiscard]] double failure_policy_delay() const noexcept override {
    return bus_.failure_policy_delay();
  }
  void set_give_up(GiveUp asked) override { bus_.set_give_up(std::move(asked)); }
  void disable() noexcept override { bus_.disable(); }
  [[nodiscard]] BusCounters counters() const noexcept override { return bus_.counters(); }

  double peak_torque = 0.0;
  std::size_t peak_joint = 0;
  std::uint32_t oldest = 0;
  std::size_t oldest_joint = 0;

 private:
  CanMotorBus& bus_;
};

void require_same_rate(const BusMap& map, const ControllerConfig& control) {
  if (std::abs(map.rate * control.dt - 1.0) > 1e-9)
    throw InputError(map.file + ": hal: rate: " + std::to_string(map.rate) +
                     " Hz, but the controller's tick is " + std::to_string(control.dt) + " s");
}

}  // namespace

bool BusRun::success() const {
  return execution.status == TickStatus::kFinished && execution.bus != BusStatus::kDown &&
         !execution.guards.found();
}

std::string BusRun::failure(const RobotModel& model) const {
  if (success()) return {};
  if (!trouble.empty()) return trouble;
  if (execution.stopped) return "interrupted";
  const std::string drives = faults.empty() ? "" : "; " + faults.front();
  if (execution.bus == BusStatus::kDown) return "the motor bus went down" + drives;
  if (execution.status == TickStatus::kFinished) return execution.guards.finding();
  const std::string joint = execution.fault_joint < model.joints.size()
                                ? " at " + model.joints[execution.fault_joint].name
                                : "";
  return std::string("the controller gave up: ") + to_string(execution.fault) + joint + drives;
}

BusRun run_on_buses(const RobotModel& model, const BusMap& map, const std::vector<std::byte>& image,
                    const BusRunOptions& options) {
  require_same_rate(map, options.control);
  LoadedController loaded(model, options.control, image);
  Controller& controller = loaded.controller;

  std::optional<FrameLog> frame_log;
  if (!options.frame_log.empty()) frame_log.emplace(options.frame_log, map);
  SocketCanBus buses(map, options.lock_step, frame_log ? &*frame_log : nullptr);
  WatchedBus bus(buses.bus());
  std::optional<RunLogWriter> log;
  if (!options.log.empty())
    log.emplace(options.log, make_run_log_header(model, options.plan_sha256, options.control.dt),
                log_capacity(controller, !options.lock_step));
  const std::unique_ptr<InputLogWriter> inputs =
      log_inputs(options.inputs, model, options.control, image, options.plan_sha256,
                 log_capacity(controller, !options.lock_step));
  const StopGuard guard;  // outlives telemetry, whose beginning and end take their time
  std::optional<RunTelemetry> telemetry;
  if (options.dds)
    telemetry.emplace(model, options.runtime.telemetry, options.executed, options.control.dt);

  std::optional<RunOperator> operator_desk;
  if (!options.runtime.operator_socket.socket.empty())
    operator_desk.emplace(options.runtime.operator_socket, model);
  ExecutorOptions execution{.realtime = !options.lock_step, .stop = guard.flag()};
  execution.log = log ? &*log : nullptr;
  execution.inputs = inputs.get();
  if (telemetry) execution.telemetry = &telemetry->port();
  if (telemetry && options.lock_step)
    execution.observe = [&](TelemetryFrame&) { telemetry->wait_for_room(); };
  execution.runtime = options.runtime;
  if (operator_desk) execution.desk = &operator_desk->desk();
  execution.bus_calls = BusCalls::kSockets;
  execution.before_enable = options.before_enable;
  if (options.lock_step) (void)stay_on_this_processor();

  RunPulse pulse;
  execution.pulse = &pulse;
  std::shared_ptr<void> companion;
  if (options.companion) companion = options.companion(pulse, telemetry ? &*telemetry : nullptr);
  BusRun run;
  run.execution = execute(controller, bus, execution);
  run.peak_torque = bus.peak_torque;
  run.peak_joint = model.joints[bus.peak_joint].name;
  run.oldest_state = bus.oldest;
  run.oldest_joint = model.joints[bus.oldest_joint].name;
  run.counters = bus.counters();
  run.trouble = buses.trouble();
  run.faults = buses.faults();
  run.table = buses.table();
  if (frame_log) {
    frame_log->close();
    run.frames = frame_log->frames();
    run.frame_log_sha256 = sha256_file(options.frame_log);
  }
  if (operator_desk) run.operator_summary = operator_desk->summary();
  if (telemetry) run.telemetry = telemetry->finish();
  return run;
}

std::string describe(const BusRun& run, const RobotModel& model) {
  std::ostringstream out;
  out.precision(3);
  const ExecutorReport& execution = run.execution;
  out << "run:         " << to_string(execution.status) << " after " << execution.ticks
      << " ticks in " << execution.wall_time << " s\n";
  out << run.operator_summary << describe_timing(execution);
  out << "peak torque: " << run.peak_torque << " N m (" << run.peak_joint << ")\n";
  out << "states:      " << run.counters.missing_replies << " replies missing, "
      << run.counters.late << " late; oldest state used " << run.oldest_state << " ticks";
  if (run.oldest_state > 0) out << " (" << run.oldest_joint << ')';
  out << '\n' << run.table;
  for (const std::string& fault : run.faults) out << "fault:       " << fault << '\n';
  if (run.telemetry) out << describe(*run.telemetry);
  if (!run.frame_log_sha256.empty())
    out << "frame log:   " << run.frames << " frames, sha256 " << run.frame_log_sha256 << '\n';
  out << "plan:        " << (run.success() ? "executed" : "failure: " + run.failure(model)) << '\n';
  return out.str();
}

}  // namespace clamber
