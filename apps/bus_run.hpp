// One run of a plan image on the drives of a bus map: controller, CAN buses, log, telemetry.
// One thread; allocates before and after the run; throws InputError.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "apps/executed_plan.hpp"
#include "apps/executor.hpp"
#include "apps/run_support.hpp"
#include "control/controller.hpp"
#include "firmware_hal/bus_map.hpp"
#include "robot_model/model.hpp"
#include "telemetry/publisher.hpp"

namespace clamber {

struct BusRunOptions {
  ControllerConfig control;
  std::string log;          ///< file; empty: no log
  std::string plan_sha256;  ///< of what is executed, for the log
  std::string inputs;       ///< file for what `clamber replay` needs; empty: none
  bool lock_step = false;   ///< ticks end when the (simulated) drives say so; else by the clock
  std::string frame_log;    ///< every frame in candump's format, in lock step; empty: none
  bool dds = false;
  ExecutedPlan executed;                ///< what telemetry tells of the plan
  RuntimeSettings runtime;              ///< of a run paced by the clock
  RunCompanion companion;               ///< empty: nobody watches
  std::function<void()> before_enable;  ///< see ExecutorOptions
};

struct BusRun {
  ExecutorReport execution;
  double peak_torque = 0.0;  ///< N m, largest |measured|
  std::string peak_joint;
  std::uint32_t oldest_state = 0;  ///< ticks, while the plan was executed
  std::string oldest_joint;
  BusCounters counters;
  std::string table;                ///< per bus, for people
  std::string trouble;              ///< why the buses could not be used; empty: they could
  std::vector<std::string> faults;  ///< of drives at the end, one line each
  std::string frame_log_sha256;
  std::uint64_t frames = 0;  ///< in the frame log
  std::optional<PublisherCounters> telemetry;
  std::string operator_summary;  ///< a line; empty: nobody could command

  /// The plan was executed to its end. Whether the robot is on top nobody here can see.
  [[nodiscard]] bool success() const;
  /// Why not, in one line; empty on success.
  [[nodiscard]] std::string failure(const RobotModel& model) const;
};

/// The drives are off when it returns or throws, also after SIGINT and SIGTERM.
/// @throws InputError when map, interfaces or image are refused; no drive was switched on then
[[nodiscard]] BusRun run_on_buses(const RobotModel& model, const BusMap& map,
                                  const std::vector<std::byte>& image,
                                  const BusRunOptions& options);

/// Ticks, torques, ages and the table of buses as lines for the terminal.
[[nodiscard]] std::string describe(const BusRun& run, const RobotModel& model);

}  // namespace clamber
