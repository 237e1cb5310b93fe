// What every executed plan needs around the run loop: a controller with the plan loaded, telemetry
// over DDS and a way to stop it.
// Main thread, before and after the run; wait_for_room() between ticks. Allocates.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/executed_plan.hpp"
#include "apps/input_log.hpp"
#include "apps/operator_server.hpp"
#include "apps/run_pulse.hpp"
#include "control/controller.hpp"
#include "robot_model/model.hpp"
#include "telemetry/port.hpp"
#include "telemetry/publisher.hpp"
#include "telemetry/publisher_process.hpp"

namespace clamber {

/// A controller that has a plan image loaded, with the memory that it works in.
struct LoadedController {
  /// @throws InputError with what the controller has against the image
  LoadedController(const RobotModel& model, const ControllerConfig& config,
                   std::span<const std::byte> image);
  Controller controller;

 private:
  std::vector<double> workspace_;
};

/// A log of the controller's inputs; nothing when `file` is empty. @throws InputError
[[nodiscard]] std::unique_ptr<InputLogWriter> log_inputs(
    const std::string& file, const RobotModel& model, const ControllerConfig& config,
    std::span<const std::byte> image, const std::string& plan_sha256, std::size_t capacity);

/// Turns SIGINT and SIGTERM into a request to stop for as long as it lives. Guards nest: a command
/// whose run has ended still heeds signals while it writes down how, if it holds one of its own.
class StopGuard {
 public:
  StopGuard();
  ~StopGuard();
  StopGuard(const StopGuard&) = delete;
  StopGuard& operator=(const StopGuard&) = delete;
  [[nodiscard]] const std::atomic<bool>* flag() const noexcept;

 private:
  void (*interrupt_before_)(int);
  void (*terminate_before_)(int);
};

/// Desk and server of a run that an operator commands. Construct it before the control thread.
class RunOperator {
 public:
  /// @throws InputError when the socket cannot be served
  RunOperator(const OperatorSettings& settings, const RobotModel& model);

  [[nodiscard]] OperatorDesk& desk() { return desk_; }
  /// "operator:    2 commands from 3 clients, ..."
  [[nodiscard]] std::string summary() const;

 private:
  OperatorDesk desk_;
  OperatorServer server_;
};

/// What a subscriber is told about the robot's frames.
[[nodiscard]] TelemetryDescription description_of(const RobotModel& model);
/// With what is executed. @param dt s from tick to tick
[[nodiscard]] TelemetryDescription description_of(const RobotModel& model, const ExecutedPlan& plan,
                                                  double dt);

/// Port and publisher; constructed before the run, finished after it.
class RunTelemetry {
 public:
  /// @throws InputError for an interface or environment that cannot be
  RunTelemetry(const RobotModel& model, const TelemetryConfig& config, const ExecutedPlan& plan,
               double dt);

  [[nodiscard]] TelemetryPort& port() { return port_; }
  /// Outside the tick: waits until the publisher has made room. One that makes none for 5 s, within
  /// which one that is dead or hangs is replaced, is not waited for again: the run goes on, and
  /// what is lost is counted.
  void wait_for_room();
  PublisherCounters finish();
  /// How often the publisher has looked for frames. Any thread.
  [[nodiscard]] std::uint64_t rounds() const { return counters_of(memory_.block()).rounds; }

 private:
  TelemetryMemory memory_;
  TelemetryPort port_;
  // One of the two.
  std::optional<Publisher> publisher_;
  std::optional<PublisherProcess> process_;
  bool waits_ = true;  ///< for room; not after a publisher that made none
};

/// Makes what lives as long as a run and watches it; telemetry: nullptr if there is none.
using RunCompanion =
    std::function<std::shared_ptr<void>(const RunPulse& pulse, const RunTelemetry* telemetry)>;

/// First argument of the command that is the publisher's process.
inline constexpr const char* kPublisherCommand = "telemetry-publisher";

/// "telemetry:   12000 frames published, 0 dropped, ..."
[[nodiscard]] std::string describe(const PublisherCounters& counters);

}  // namespace clamber
