// clamber import: recording -> motion of the robot.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/steps.hpp"

namespace clamber {
namespace {

struct Options {
  std::string recording;
  std::string out = "out/motion.csv";
  RecordingOptions reading;
  RobotOptions robot;
};

void run_import(const Options& options) {
  const RobotModel model = load_robot(options.robot);
  const auto [text, motion] = load_motion(options.recording, options.reading, options.robot, model);
  write_text(options.out, text);
  std::cout << "recording:  " << motion.recording << (motion.synthetic ? " (SYNTHETIC)" : "")
            << "\nframes:     " << motion.frames.size() << " at " << motion.rate << " Hz, "
            << static_cast<double>(motion.frames.size() - 1) / motion.rate
            << " s\nhuman leg:  " << motion.human_leg_length << " m\n"
            << clamp_table(motion) << "written:    " << options.out << '\n';
}

}  // namespace

void add_import_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "import", "Reads a recording of a person and maps it to the robot's joints");
  command
      ->add_option("recording", options->recording,
                   ".mvnx (3, 4), .npy or .csv joint positions, .amc")
      ->required();
  command->add_option("-o,--out", options->out, "the robot's motion")->capture_default_str();
  add_recording_options(*command, options->reading);
  add_robot_options(*command, options->robot);
  command->footer(
      "The format is recognised by content. The climb is cut out of the recording, joint angles\n"
      "are extracted in the robot's own axis order and clamped to its limits; the table says by\n"
      "how much and how often.\n\n"
      "Example:\n"
      "  clamber import configs/recordings/climb_table_synthetic.mvnx -o motion.csv");
  command->callback([options] { run_import(*options); });
}

}  // namespace clamber
