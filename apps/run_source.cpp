#include "apps/run_source.hpp"

#include <memory>
#include <system_error>
#include <utility>

#include "apps/executed_plan.hpp"
#include "apps/out_folder.hpp"
#include "apps/run_events.hpp"
#include "apps/run_log.hpp"
#include "apps/run_support.hpp"
#include "planner_offline/plan.hpp"
#include "recording/run_reader.hpp"
#include "report/scene_json.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

bool is_mcap(const fs::path& file) {
  std::ifstream in = open_file(file, kRunLogBytes);
  char start[5] = {};
  in.read(start, sizeof start);
  return std::string_view(start, sizeof start) == "\x89MCAP";
}

ClimbInputs inputs_of(const fs::path& log, const RunSourceOptions& options) {
  const OutFolder folder(log.parent_path());
  std::error_code error;
  ClimbInputs inputs = fs::exists(folder.summary(), error) ? load_inputs(folder) : ClimbInputs();
  if (options.robot) inputs.robot = {.robot = *options.robot, .ballast = false};
  if (options.scenario) inputs.scenario = {.scenario = *options.scenario, .height = {}, .goal = {}};
  return inputs;
}

/// What was executed, as far as the plan lies beside its log.
ExecutedPlan executed_in(const fs::path& log, const RunLogHeader& header, const RobotModel& model,
                         const RobotOptions& robot) {
  ExecutedPlan executed{.sha256 = header.plan_sha256, .urdf = read_urdf(robot), .phases = {}};
  const std::string plan = OutFolder(log.parent_path()).plan();
  std::error_code error;
  if (fs::exists(plan, error) && sha256_file(plan) == header.plan_sha256)
    executed.phases = describe_phases(load_plan(plan), model);
  return executed;
}

/// Frames of a log and the events that they tell of.
class LogSource {
 public:
  LogSource(RunLog log, const TelemetryDescription& description)
      : log_(std::move(log)), events_(description) {
    notes_.urdf = description.urdf;
  }
  bool next(TelemetryFrame& frame) {
    if (at_ == log_.frames.size()) return false;
    frame = log_.frames[at_++];
    events_.after_tick(frame,
                       [this](const TelemetryEvent& event) { notes_.events.push_back(event); });
    return true;
  }
  RunNotes take_notes() { return std::exchange(notes_, {}); }

 private:
  RunLog log_;
  LoggedEvents events_;
  RunNotes notes_;
  std::size_t at_ = 0;
};

/// @tparam Reader has next() and take_notes()
template <typename Reader>
void read_from(const std::shared_ptr<Reader>& reader, RunSource& source) {
  source.next = [reader](TelemetryFrame& frame) { return reader->next(frame); };
  source.notes = [reader] { return reader->take_notes(); };
}

RunSource open_log(const fs::path& file, const RunSourceOptions& options) {
  const ClimbInputs inputs = inputs_of(file, options);
  RunSource source;
  source.model = load_robot(inputs.robot);
  RunLog log = load_run_log(file);
  if (log.header.robot_hash != source.model->hash)
    throw InputError(file.string() + ": run of robot '" + log.header.robot + "' as it was when " +
                     "the run was made, not as " + inputs.robot.robot + " is now (see --robot)");
  source.run = {
      .robot = source.model->name,
      .telemetry = description_of(
          *source.model, executed_in(file, log.header, *source.model, inputs.robot), log.header.dt),
      .scene = scene_json(*source.model, load_scenario(inputs.scenario))};
  read_from(std::make_shared<LogSource>(std::move(log), source.run.telemetry), source);
  source.cut = [] { return false; };
  return source;
}

}  // namespace

void add_run_source_options(CLI::App& command, RunSourceOptions& options) {
  command.add_option("--robot", options.robot,
                     "of a run log: its robot (else as the summary.json beside it says)");
  command.add_option("--scenario", options.scenario, "of a run log: its scenario (likewise)");
}

RunSource open_run(const fs::path& file, const RunSourceOptions& options) {
  if (!is_mcap(file)) return open_log(file, options);
  RunSource source;
  auto reader = std::make_shared<RunReader>(file);
  source.run = reader->run();
  read_from(reader, source);
  source.cut = [reader] { return reader->cut(); };
  return source;
}

CopiedRun copy_run(const RunSource& source, RunFile& to) {
  const auto copy_notes = [&] {
    const RunNotes notes = source.notes();
    if (!notes.urdf.empty()) to.add_urdf(notes.urdf);
    for (const TelemetryEvent& event : notes.events) to.add(event);
  };
  CopiedRun copied;
  for (TelemetryFrame frame; source.next(frame); ++copied.frames) {
    copy_notes();
    to.add(frame);
    copied.end = frame.time;
  }
  copy_notes();
  to.close();
  return copied;
}

}  // namespace clamber
