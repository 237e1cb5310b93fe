// The steps of a climb, as `clamber climb` and the single commands both do them.
// One thread; allocates; reads and writes files; throws InputError, PlanningFailed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/bus_run.hpp"
#include "apps/certification.hpp"
#include "apps/options.hpp"
#include "apps/progress.hpp"
#include "apps/rehearsal.hpp"
#include "apps/simulated_run.hpp"
#include "planner_offline/contacts/contact_sequence.hpp"
#include "planner_offline/planner.hpp"

namespace clamber {

/// Per joint what the mapping had to clamp, as a table.
[[nodiscard]] std::string clamp_table(const RobotMotion& motion);

/// Full and reduced contact table and the notes.
[[nodiscard]] std::string contact_tables(const ContactSequence& sequence);

/// Runs the direct playback (settings: configs/control/playback.yaml) and writes its log.
[[nodiscard]] SimulatedRun run_playback(const RobotModel& model, const LoadedMotion& loaded,
                                        const Scenario& scenario, const ControllerConfig& control,
                                        const std::string& log);
/// Joints whose torque went over their plan limit in the logged run, worst first, as a table.
[[nodiscard]] std::string overload_table(const RobotModel& model, const std::string& log);

/// Where the planner's results go; empty: nowhere.
struct PlanFiles {
  std::string plan;
  std::string certificate;  ///< empty: beside the plan
  std::string image;
  std::string trajectory;
  std::string costs;     ///< written also when planning fails
  std::string rejected;  ///< written also when planning fails
};
/// @param sequence  nullptr: without a recording
/// @throws PlanningFailed naming the file that lists what was tried, if there is one
[[nodiscard]] PlanningResult make_plan(const RobotModel& model, const Scenario& scenario,
                                       const ContactSequence* sequence, const std::string& settings,
                                       const PlanFiles& files, Progress& progress);
/// Certifies the plan file just written, and writes the image that names the certificate. The
/// image of a plan whose certificate is not valid is not written.
[[nodiscard]] Certification certify_plan(const RobotModel& model, const Scenario& scenario,
                                         const PlanFiles& files);
/// Keyframes, duration, torques and margins of a plan and what the planner noted beyond the notes
/// of its contact sequence, as lines.
[[nodiscard]] std::string describe(const PlanningResult& result, const RobotModel& model,
                                   const std::vector<std::string>& known_notes);

/// What `clamber run` and `clamber climb` let one choose.
struct ExecutionOptions {
  std::string control = "configs/control/default.yaml";
  std::string hal = "configs/hal/ode.yaml";
  std::optional<std::string> feed_forward;  ///< plan or none; nothing: as in `control`
  bool realtime = false;
  bool dds = true;
  bool springs = false;
  std::optional<std::uint64_t> perturbed;  ///< seed of what the world differs by
  std::string certificate;                 ///< empty: beside the plan
  bool uncertified = false;  ///< runs a plan without one: to look at it in the simulation
  bool lock_step = false;    ///< motor buses: see lock_step.hpp
  bool rehearse = false;     ///< motor buses: simulated, with virtual drives, in this process
  std::string inputs;        ///< file for `clamber replay`; empty: none
  std::string frame_log;     ///< motor buses in lock step or rehearsed: file for every frame
  std::string runtime = "configs/runtime/default.yaml";
  std::string guard;                    ///< see parse_guards(); empty: as in `runtime`
  std::string operator_socket;          ///< empty: as in `runtime`
  RunCompanion companion;               ///< of a service; empty: nobody watches
  std::function<void()> before_enable;  ///< motor buses: see ExecutorOptions
};
void add_execution_options(CLI::App& command, ExecutionOptions& options);

/// Executes the plan file once its certificate is verified.
/// @throws InputError also when it was made for another robot or scenario, or has no certificate
/// @throws JobFailed when its certificate is refused
[[nodiscard]] SimulatedRun run_plan(const RobotOptions& robot, const RobotModel& model,
                                    const Scenario& scenario, const std::string& plan_file,
                                    const ExecutionOptions& options, const std::string& log);

/// What stands behind the motor bus.
enum class Backend : std::uint8_t { kSimulation, kSocketCan };
/// @throws InputError
[[nodiscard]] Backend read_backend(const std::string& hal_file);

/// The same on the drives of the bus map `options.hal`.
[[nodiscard]] BusRun run_plan_on_buses(const RobotOptions& robot, const RobotModel& model,
                                       const Scenario& scenario, const std::string& plan_file,
                                       const ExecutionOptions& options, const std::string& log);

/// The same on virtual drives and simulated buses of that map, in this process.
[[nodiscard]] RehearsalRun rehearse_plan(const RobotOptions& robot, const RobotModel& model,
                                         const Scenario& scenario, const std::string& plan_file,
                                         const ExecutionOptions& options, const std::string& log);

}  // namespace clamber
