// clamber playback: the direct playback of a motion, unplanned.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/steps.hpp"

namespace clamber {
namespace {

struct Options {
  std::string motion;
  std::string control = "configs/control/playback.yaml";
  std::string out = "out/playback.log";
  RecordingOptions reading;
  RobotOptions robot;
  ScenarioOptions scenario;
};

void run(const Options& options) {
  const RobotModel model = load_robot(options.robot);
  const Scenario scenario = load_scenario(options.scenario);
  const LoadedMotion motion = load_motion(options.motion, options.reading, options.robot, model);
  const SimulatedRun result = run_playback(
      model, motion, scenario, load_control(options.control, options.robot, model), options.out);
  std::cout << describe(result, model) << overload_table(model, options.out)
            << "written:     " << options.out << '\n';
}

}  // namespace

void add_playback_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "playback", "Plays the mapped motion in the simulation as it is, without a plan");
  command->add_option("motion", options->motion, "motion.csv, or a recording")->required();
  command->add_option("--control", options->control, "the controller's settings")
      ->capture_default_str();
  command->add_option("-o,--out", options->out, "run log")->capture_default_str();
  add_recording_options(*command, options->reading);
  add_robot_options(*command, options->robot);
  add_scenario_options(*command, options->scenario);
  command->footer(
      "This is what the planner is compared with: the same robot, obstacle and gains, nothing\n"
      "holds the base, and the drives may give all they have. The robot starts at the\n"
      "scenario's start pose in the motion's first posture. Whether the robot arrives or falls\n"
      "is reported as it comes out; the exit code is 0 either way.\n\n"
      "Example:\n"
      "  clamber playback out/climb/motion.csv -o out/playback.log");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
