#include "apps/steps.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "apps/playback_plan.hpp"
#include "planner_offline/contacts/contact_table.hpp"
#include "planner_offline/plan_image.hpp"
#include "planner_offline/settings_file.hpp"
#include "report/peaks.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/sha256.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

template <typename... Values>
std::string line(const char* format, Values... values) {
  std::array<char, 256> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

/// Refuses a plan that was not made for what it shall be executed on.
void check_made_for(const Plan& plan, const std::string& file, const RobotModel& model,
                    const Scenario& scenario) {
  const auto refuse = [&](const std::string& what, const std::string& made_for,
                          const std::string& given) {
    throw InputError(file + ": made for another " + what + ": " + made_for + ", not " + given);
  };
  const auto named = [](const std::string& name, const std::string& hash) {
    return "'" + name + "' (" + hash.substr(0, 12) + ")";
  };
  if (plan.robot_hash != model.hash)
    refuse("robot", named(plan.robot, plan.robot_hash), named(model.name, model.hash));
  if (plan.scenario_hash != scenario.hash)
    refuse("scenario", named(plan.scenario, plan.scenario_hash),
           named(scenario.name, scenario.hash));
}

/// SHA-256 of the plan's certificate, which was found valid just now.
std::string verified_certificate(const std::string& plan_file, const ExecutionOptions& options,
                                 const RobotModel& model, const Scenario& scenario) {
  const Certification found = verify_plan_file(
      plan_file, options.certificate.empty() ? certificate_beside(plan_file) : options.certificate,
      model, scenario);
  if (!found.report.valid)
    throw JobFailed(plan_file + ": its certificate is refused: " + found.report.reason);
  return found.sha256;
}

/// What is executed and how, once the plan is known to be made for this robot and scenario and its
/// certificate holds.
struct PreparedRun {
  ControllerConfig control;
  std::vector<std::byte> image;
  std::string plan_sha256;
  ExecutedPlan executed;
};

PreparedRun prepare_run(const RobotOptions& robot, const RobotModel& model,
                        const Scenario& scenario, const std::string& plan_file,
                        const ExecutionOptions& options) {
  const Plan plan = load_plan(plan_file);
  check_made_for(plan, plan_file, model, scenario);
  std::optional<FeedForward> feed_forward;
  if (options.feed_forward)
    feed_forward = *options.feed_forward == "plan" ? FeedForward::kPlan : FeedForward::kNone;
  PreparedRun run;
  run.control = load_control(options.control, robot, model, feed_forward);
  run.control.accept_uncertified = options.uncertified;
  run.plan_sha256 = sha256_file(plan_file);
  if (options.dds)
    run.executed = {.sha256 = run.plan_sha256,
                    .urdf = read_urdf(robot),
                    .phases = describe_phases(plan, model)};
  const std::string certificate = options.uncertified
                                      ? std::string()
                                      : verified_certificate(plan_file, options, model, scenario);
  run.image = plan_to_image(plan, certificate);
  return run;
}

/// @param paced  by the clock
RuntimeSettings runtime_settings(const ExecutionOptions& options, bool paced) {
  RuntimeSettings settings = load_runtime_settings(find_file(options.runtime));
  if (!options.guard.empty()) {
    settings.guards = parse_guards(options.guard);
    if (!paced)
      throw InputError(
          "--guard: only in a run paced by the clock (--realtime, or --hal without --lock-step)");
  }
  if (!options.operator_socket.empty()) settings.operator_socket.socket = options.operator_socket;
  return settings;
}

void save_costs(const std::vector<CostSample>& costs, const std::string& file) {
  std::string text = "state,phase,iteration,cost,ik_error_m\n";
  for (const CostSample& c : costs)
    text += line("%d,%d,%d,%.9g,%.9g\n", c.state, c.phase, c.iteration, c.cost, c.ik_error);
  write_text(file, text);
}

void save_log(const PlanningLog& log, const PlanFiles& files) {
  if (!files.costs.empty()) save_costs(log.costs, files.costs);
  if (files.rejected.empty()) return;
  std::string text;
  for (const std::string& why : log.rejected) text += why + '\n';
  write_text(files.rejected, text);
}

/// @param sequence  nullptr: without a recording
PlanningResult plan_or_leave_log(const RobotModel& model, const Scenario& scenario,
                                 const ContactSequence* sequence, const PlannerSettings& settings,
                                 const PlanFiles& files, Progress& progress) {
  const auto show = [&](double share, const std::string& what) { progress.update(share, what); };
  const auto check = [&](Plan& plan) { return why_not_certified(plan, model, scenario); };
  try {
    return sequence != nullptr ? plan_climb(model, scenario, *sequence, settings, show, check)
                               : plan_without_recording(model, scenario, settings, show, check);
  } catch (const PlanningFailed& error) {
    progress.clear();
    if (error.log() == nullptr) throw;
    save_log(*error.log(), files);
    if (files.rejected.empty()) throw;
    throw PlanningFailed(std::string(error.what()) + " (all attempts: " + files.rejected + ")",
                         error.log());
  }
}

}  // namespace

std::string clamp_table(const RobotMotion& motion) {
  if (motion.clamped.empty()) return "no joint had to be clamped to its limits\n";
  std::string out = "clamped to the joint limits:\n  joint         worst (deg)  frames (%)\n";
  for (const RobotMotion::ClampReport& clamp : motion.clamped)
    out += line("  %-12s %12.1f %11.1f\n", clamp.joint.c_str(), clamp.worst * 180.0 / M_PI,
                100.0 * clamp.share);
  return out;
}

std::string contact_tables(const ContactSequence& sequence) {
  std::string out = "contact states, (brackets): on the floor\n" + contact_table(sequence.states) +
                    "\nwith absolute stability only\n" + contact_table(sequence.reduced);
  for (const std::string& note : sequence.notes) out += "note: " + note + '\n';
  return out;
}

SimulatedRun run_playback(const RobotModel& model, const LoadedMotion& loaded,
                          const Scenario& scenario, const ControllerConfig& control,
                          const std::string& log) {
  SimulatedRunOptions options;
  options.control = control;
  options.start = playback_start(loaded.motion, scenario);
  options.log = log;
  options.plan_sha256 = sha256_hex(loaded.text);
  // A recorded motion is no plan: to show what happens without one is what this run is for.
  options.control.accept_uncertified = true;
  make_folder_of(log);
  return run_in_simulation(model, scenario,
                           plan_to_image(playback_plan(model, loaded.motion, scenario)), options);
}

std::string overload_table(const RobotModel& model, const std::string& log) {
  RunData run;
  run.model = model;
  run.frames = load_run_log(log).frames;
  std::vector<std::pair<double, std::string>> lines;
  const std::vector<TorquePeak> peaks = torque_peaks(run);
  for (std::size_t j = 0; j < peaks.size(); ++j) {
    const double limit = model.joints[j].torque_limit;
    if (peaks[j].value > limit)
      lines.emplace_back(limit - peaks[j].value,
                         line("  %-12s %8.1f %8.1f %8.2f\n", peaks[j].joint.c_str(), peaks[j].value,
                              limit, peaks[j].time));
  }
  if (lines.empty()) return "no joint went over its torque limit\n";
  std::sort(lines.begin(), lines.end());
  std::string out = "over the torque limit:\n  joint        peak(Nm)    limit  time (s)\n";
  for (const auto& [margin, text] : lines) out += text;
  return out;
}

PlanningResult make_plan(const RobotModel& model, const Scenario& scenario,
                         const ContactSequence* sequence, const std::string& settings,
                         const PlanFiles& files, Progress& progress) {
  PlanningResult result = plan_or_leave_log(
      model, scenario, sequence, load_planner_settings(find_file(settings)), files, progress);
  progress.clear();
  for (const std::string& file : {files.plan, files.trajectory}) make_folder_of(file);
  if (!files.plan.empty()) save_plan(result.plan, files.plan);
  if (!files.trajectory.empty()) export_trajectory(result.plan, files.trajectory);
  save_log(result, files);
  return result;
}

Certification certify_plan(const RobotModel& model, const Scenario& scenario,
                           const PlanFiles& files) {
  Certification certification = certify_plan_file(
      files.plan, files.certificate.empty() ? certificate_beside(files.plan) : files.certificate,
      model, scenario);
  if (certification.report.valid && !files.image.empty()) {
    make_folder_of(files.image);
    save_plan_image(plan_to_image(load_plan(files.plan), certification.sha256), files.image);
  }
  return certification;
}

std::string describe(const PlanningResult& result, const RobotModel& model,
                     const std::vector<std::string>& known_notes) {
  const Plan& plan = result.plan;
  double peak = 0.0;
  double support = std::numeric_limits<double>::infinity();
  double clearance = support;
  std::string joint;
  for (const Keyframe& keyframe : plan.keyframes) {
    Eigen::Index at = 0;
    const double largest = keyframe.tau.cwiseAbs().maxCoeff(&at);
    if (largest > peak) {
      peak = largest;
      joint = model.joints[static_cast<std::size_t>(at)].name;
    }
    support = std::min(support, keyframe.support_margin);
    clearance = std::min({clearance, keyframe.obstacle_clearance, keyframe.self_clearance});
  }
  std::string out = line("plan:        %zu keyframes, %zu phases, %.1f s\n", plan.keyframes.size(),
                         plan.phases.size(), plan.keyframes.back().time);
  out += line("search:      %zu candidates, %zu given up, %zu backtracks\n", result.candidates,
              result.rejected.size(), result.backtracks);
  out += line("torque:      %.1f N m at most (%s)\n", peak, joint.c_str());
  out += line("margins:     support %.1f mm, clearance %.1f mm\n", 1e3 * support, 1e3 * clearance);
  for (const std::string& note : plan.notes)
    if (std::find(known_notes.begin(), known_notes.end(), note) == known_notes.end())
      out += "note: " + note + '\n';
  return out;
}

Backend read_backend(const std::string& hal_file) {
  if (hal_file == "ode" || hal_file == "socketcan")
    throw InputError("--hal " + hal_file + ": expected a file that says which drives are where: " +
                     (hal_file == "ode" ? "configs/hal/ode.yaml"
                                        : "configs/hal/coman_mit.yaml or coman_cia402.yaml"));
  const YamlNode root = YamlNode::load(find_file(hal_file));
  root.allow_only({"hal"});
  const YamlNode hal = root.at("hal");
  const YamlNode backend = hal.at("backend");
  if (backend.text() == "socketcan") return Backend::kSocketCan;
  if (backend.text() != "ode") backend.fail("expected ode or socketcan, found " + backend.text());
  hal.allow_only({"backend"});
  return Backend::kSimulation;
}

void add_execution_options(CLI::App& command, ExecutionOptions& options) {
  command.add_option("--control", options.control, "the controller's settings")
      ->capture_default_str();
  command.add_option("--hal,--hal-config", options.hal, "what stands behind the motor bus")
      ->capture_default_str();
  command
      .add_option("--feed-forward", options.feed_forward,
                  "plan: the plan's torques are added to the PID; none: PID alone")
      ->check(CLI::IsMember({"plan", "none"}));
  command.add_flag("--realtime", options.realtime, "paced by the clock, not as fast as possible");
  command
      .add_option("--runtime", options.runtime,
                  "paced by the clock: priority, processors, memory, guards (docs/realtime.md)")
      ->capture_default_str();
  command.add_option(
      "--guard", options.guard,
      "paced by the clock: malloc,syscalls,faults: trap these in the control thread");
  command.add_flag("--springs", options.springs,
                   "series springs of the robot file, and references that make up for them");
  command.add_option("--perturbed", options.perturbed,
                     "seed: masses, friction, obstacle, start, drives and simulator differ from "
                     "the model (docs/results/robustness.md)");
  command.add_flag("--dds,!--no-dds", options.dds, "telemetry over DDS (on)");
}

SimulatedRun run_plan(const RobotOptions& robot, const RobotModel& model, const Scenario& scenario,
                      const std::string& plan_file, const ExecutionOptions& options,
                      const std::string& log) {
  if (read_backend(options.hal) != Backend::kSimulation)
    throw InputError(options.hal +
                     ": hal: backend: only `clamber run` drives motors, expected ode");
  const PreparedRun prepared = prepare_run(robot, model, scenario, plan_file, options);
  SimulatedRunOptions run;
  run.control = prepared.control;
  run.log = log;
  run.plan_sha256 = prepared.plan_sha256;
  run.executed = prepared.executed;
  run.realtime = options.realtime;
  run.runtime = runtime_settings(options, options.realtime);
  run.dds = options.dds;
  run.springs = options.springs;
  if (options.perturbed) run.perturbation = draw_perturbation({}, model, *options.perturbed);
  run.inputs = options.inputs;
  run.companion = options.companion;
  for (const std::string& file : {log, options.inputs})
    if (!file.empty()) make_folder_of(file);
  return run_in_simulation(model, scenario, prepared.image, run);
}

BusRun run_plan_on_buses(const RobotOptions& robot, const RobotModel& model,
                         const Scenario& scenario, const std::string& plan_file,
                         const ExecutionOptions& options, const std::string& log) {
  if (options.uncertified)
    throw InputError("--uncertified: not on a motor bus, only in the simulation");
  const BusMap map = load_bus_map(find_file(options.hal), model);
  const PreparedRun prepared = prepare_run(robot, model, scenario, plan_file, options);
  BusRunOptions run;
  run.control = prepared.control;
  run.plan_sha256 = prepared.plan_sha256;
  run.executed = prepared.executed;
  run.log = log;
  run.lock_step = options.lock_step;
  run.runtime = runtime_settings(options, !options.lock_step);
  run.frame_log = options.frame_log;
  run.inputs = options.inputs;
  run.companion = options.companion;
  run.before_enable = options.before_enable;
  run.dds = options.dds;
  for (const std::string& file : {log, options.frame_log, options.inputs})
    if (!file.empty()) make_folder_of(file);
  return run_on_buses(model, map, prepared.image, run);
}

RehearsalRun rehearse_plan(const RobotOptions& robot, const RobotModel& model,
                           const Scenario& scenario, const std::string& plan_file,
                           const ExecutionOptions& options, const std::string& log) {
  const BusMap map = load_bus_map(find_file(options.hal), model);
  const PreparedRun prepared = prepare_run(robot, model, scenario, plan_file, options);
  RehearsalOptions run;
  run.control = prepared.control;
  run.plan_sha256 = prepared.plan_sha256;
  run.log = log;
  run.frame_log = options.frame_log;
  run.inputs = options.inputs;
  for (const std::string& file : {log, options.frame_log, options.inputs})
    if (!file.empty()) make_folder_of(file);
  return rehearse(model, scenario, map, prepared.image, run);
}

}  // namespace clamber
