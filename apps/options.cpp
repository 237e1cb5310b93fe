#include "apps/options.hpp"

#include <filesystem>
#include <fstream>
#include <system_error>

#include "apps/config_files.hpp"
#include "apps/controller_config.hpp"
#include "planner_offline/recording/import.hpp"
#include "planner_offline/retarget/retarget.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

bool is_motion_file(const fs::path& file) {
  std::ifstream in = open_file(file, kRecordingBytes);
  std::string start(256, '\0');
  in.read(start.data(), static_cast<std::streamsize>(start.size()));
  return is_motion(start);
}

}  // namespace

void add_robot_options(CLI::App& command, RobotOptions& options) {
  command.add_option("--robot", options.robot, "folder of the robot, or its robot.yaml")
      ->capture_default_str();
  command.add_flag("--ballast", options.ballast, "apply the robot file's ballast");
}

RobotModel load_robot(const RobotOptions& options) {
  return load_robot(find_robot(options.robot), {.ballast_scale = options.ballast ? 1.0 : 0.0});
}

ControllerConfig load_control(const std::string& settings, const RobotOptions& options,
                              const RobotModel& robot, std::optional<FeedForward> feed_forward) {
  const fs::path gains = find_robot(options.robot).parent_path() / "control.yaml";
  std::error_code error;
  return load_controller_config(find_file(settings), robot,
                                fs::exists(gains, error) ? gains : fs::path(), feed_forward);
}

void add_scenario_options(CLI::App& command, ScenarioOptions& options) {
  command.add_option("--scenario", options.scenario, "obstacle, start pose and goal")
      ->capture_default_str();
  command.add_option("--height", options.height, "m, another height for the scenario's obstacle");
  command
      .add_option("--goal", options.goal, "another goal: all_fours, stand_on_top, over, back_down")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, Goal>{{"all_fours", Goal::kAllFours},
                                                              {"stand_on_top", Goal::kStandOnTop},
                                                              {"over", Goal::kOver},
                                                              {"back_down", Goal::kBackDown}}));
}

Scenario load_scenario(const ScenarioOptions& options) {
  Scenario scenario = load_scenario(find_file(options.scenario));
  if (options.height) scenario = with_height(std::move(scenario), *options.height);
  if (options.goal) scenario = with_goal(std::move(scenario), *options.goal);
  return scenario;
}

void add_recording_options(CLI::App& command, RecordingOptions& options) {
  command.add_option("--rate", options.rate, "Hz, for .npy and .amc, which do not carry it (120)");
  command.add_option("--skeleton", options.skeleton, ".asf file of an .amc recording");
  command.add_option("--start", options.start, "s, where the climb starts (else it is found)");
  command.add_option("--end", options.end, "s, where it ends");
}

LoadedMotion load_motion(const std::string& file, const RecordingOptions& recording,
                         const RobotOptions& robot, const RobotModel& model) {
  const fs::path found = find_file(file);
  if (is_motion_file(found)) {
    const std::string text = read_file(found, kRecordingBytes);
    return {text, parse_motion(text, found.string(), model)};
  }
  ImportOptions options{.rate = recording.rate, .skeleton = {}, .window = {}};
  if (recording.skeleton) options.skeleton = *recording.skeleton;
  options.window.start = recording.start;
  options.window.end = recording.end;
  const HumanMotion human = import_recording(found, options);
  const RetargetConfig chains =
      load_retarget_config(find_robot(robot.robot).parent_path() / "retarget.yaml");
  const std::string text = format_motion(retarget(human, model, chains), model);
  return {text, parse_motion(text, "motion", model)};
}

void make_folder_of(const std::string& file) {
  const fs::path folder = fs::path(file).parent_path();
  std::error_code error;
  if (!folder.empty()) fs::create_directories(folder, error);
  if (error) throw InputError(folder.string() + ": cannot be made: " + error.message());
}

void write_text(const std::string& file, const std::string& text) {
  make_folder_of(file);
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw InputError(file + ": cannot write");
}

}  // namespace clamber
