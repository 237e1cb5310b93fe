#include "apps/run_source.hpp"

#include <memory>
#include <system_error>

#include "apps/config_files.hpp"
#include "apps/out_folder.hpp"
#include "apps/run_log.hpp"
#include "apps/run_support.hpp"
#include "planner_offline/plan.hpp"
#include "recording/run_reader.hpp"
#include "report/scene_json.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

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

/// Names of the phases where the plan that was executed lies beside its log.
std::vector<std::string> phases_beside(const fs::path& log) {
  const OutFolder folder(log.parent_path());
  std::error_code error;
  std::vector<std::string> names;
  if (!fs::exists(folder.plan(), error)) return names;
  for (const Phase& phase : load_plan(folder.plan()).phases) names.push_back(phase.name);
  return names;
}

RunSource open_log(const fs::path& file, const RunSourceOptions& options) {
  const ClimbInputs inputs = inputs_of(file, options);
  RunSource source;
  source.model = load_robot(inputs.robot);
  auto log = std::make_shared<RunLog>(load_run_log(file));
  if (log->header.robot_hash != source.model->hash)
    throw InputError(file.string() + ": run of robot '" + log->header.robot + "' as it was when " +
                     "the run was made, not as " + inputs.robot.robot + " is now (see --robot)");
  source.run = {
      .robot = source.model->name,
      .telemetry = description_of(*source.model),
      .scene = scene_json(*source.model, load_scenario(inputs.scenario), phases_beside(file))};
  source.next = [log, i = std::size_t{0}](TelemetryFrame& frame) mutable {
    if (i == log->frames.size()) return false;
    frame = log->frames[i++];
    return true;
  };
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
  source.next = [reader](TelemetryFrame& frame) { return reader->next(frame); };
  source.cut = [reader] { return reader->cut(); };
  return source;
}

}  // namespace clamber
