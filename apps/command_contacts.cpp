// clamber contacts: which links the demonstration rests on, and when.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/steps.hpp"
#include "planner_offline/contacts/playback.hpp"

namespace clamber {
namespace {

struct Options {
  std::string motion;
  std::string out = "out/contacts.yaml";
  RecordingOptions reading;
  RobotOptions robot;
  ScenarioOptions scenario;
};

void run(const Options& options) {
  const RobotModel model = load_robot(options.robot);
  const Scenario scenario = load_scenario(options.scenario);
  const RobotMotion motion =
      load_motion(options.motion, options.reading, options.robot, model).motion;
  const ContactSequence sequence = extract_contacts(model, motion, scenario, {});
  make_folder_of(options.out);
  save_contacts(sequence, options.out);
  std::cout << contact_tables(sequence) << "written: " << options.out << '\n';
}

}  // namespace

void add_contacts_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "contacts", "Plays the motion with a guided base and reads its contact states off it");
  command->add_option("motion", options->motion, "motion.csv, or a recording")->required();
  command->add_option("-o,--out", options->out, "the contact sequence")->capture_default_str();
  add_recording_options(*command, options->reading);
  add_robot_options(*command, options->robot);
  add_scenario_options(*command, options->scenario);
  command->footer(
      "The height of the obstacle is adjusted to the motion; of the scenario, its width and\n"
      "depth count. The first table lists every state, the second those with absolute\n"
      "stability (s = 0), which the planner follows.\n\n"
      "Example:\n"
      "  clamber contacts out/climb/motion.csv -o contacts.yaml");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
