// One run of a plan image on the simulated robot: controller, bus, log, telemetry and the judge.
// One thread, and no other OdeWorld at the same time; allocates; throws InputError.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/executed_plan.hpp"
#include "apps/executor.hpp"
#include "apps/run_support.hpp"
#include "control/controller.hpp"
#include "robot_model/model.hpp"
#include "sim_backend/judge.hpp"
#include "sim_backend/perturbation.hpp"
#include "telemetry/publisher.hpp"

namespace clamber {

struct SimulatedRunOptions {
  ControllerConfig control;
  std::optional<Configuration> start;  ///< nothing: the scenario's start configuration
  std::string log;                     ///< file; empty: no log
  std::string plan_sha256;             ///< of what is executed, for the log
  std::string inputs;                  ///< file for what `clamber replay` needs; empty: none
  bool realtime = false;
  RuntimeSettings runtime = ordinary_thread();  ///< of a real-time run
  RunCompanion companion;                       ///< empty: nobody watches
  /// Springs of the robot file between motors and links; the controller expects them.
  bool springs = false;
  /// The world differs from model and scenario by this; the controller does not know (but of
  /// springs).
  std::optional<Perturbation> perturbation;
  /// Sees the world and every tick's frame, the truth in it.
  std::function<void(const OdeWorld&, const TelemetryFrame&)> observe;
  /// Telemetry over DDS. Paced by the clock, a frame that finds the ring full is dropped and
  /// counted. As fast as possible, the loop waits between two ticks until the ring has room.
  bool dds = false;
  ExecutedPlan executed;  ///< what telemetry tells of the plan
};

struct SimulatedRun {
  ExecutorReport execution;
  ClimbVerdict verdict;
  double peak_torque = 0.0;  ///< N m, largest |measured|
  std::string peak_joint;
  bool feed_forward = false;
  std::optional<PublisherCounters> telemetry;
  std::string operator_summary;  ///< a line; empty: nobody could command

  /// The plan was executed to its end and the judge saw the robot on top.
  [[nodiscard]] bool success() const;
  [[nodiscard]] double real_time_factor() const;
  /// Why not, in one line; empty on success.
  [[nodiscard]] std::string failure(const RobotModel& model) const;
};

/// SIGINT and SIGTERM end the run after the current tick.
/// @throws InputError when the controller refuses the image or the log cannot be written
[[nodiscard]] SimulatedRun run_in_simulation(const RobotModel& model, const Scenario& scenario,
                                             const std::vector<std::byte>& image,
                                             const SimulatedRunOptions& options);

/// Verdict, peaks and counts as lines for the terminal.
[[nodiscard]] std::string describe(const SimulatedRun& run, const RobotModel& model);

}  // namespace clamber
