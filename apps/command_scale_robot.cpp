// clamber scale-robot: a robot description of another size.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/config_files.hpp"
#include "apps/options.hpp"
#include "apps/scaled_robot.hpp"

namespace clamber {
namespace {

struct Options {
  std::string robot = "configs/robots/coman";
  double scale = 1.0;
  std::string torque = "scaled";
  std::string out;
};

void run(const Options& options) {
  write_scaled_robot(find_robot(options.robot), options.scale,
                     options.torque == "kept" ? ScaledTorque::kKept : ScaledTorque::kWithMass,
                     options.out);
  const RobotModel made = load_robot({.robot = options.out});
  std::cout << made.name << ": " << made.joint_count() << " joints, " << made.total_mass
            << " kg\nwritten: " << options.out << '\n';
}

}  // namespace

void add_scale_robot_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("scale-robot", "Writes a robot of another size");
  command->add_option("--robot", options->robot, "folder of the robot, or its robot.yaml")
      ->capture_default_str();
  command->add_option("--scale", options->scale, "s, of all lengths")
      ->required()
      ->check(CLI::Range(0.1, 10.0));
  command->add_option("--torque", options->torque, "torque limits: scaled with s^3, or kept")
      ->check(CLI::IsMember({"scaled", "kept"}))
      ->capture_default_str();
  command->add_option("-o,--out", options->out, "folder of the new robot")->required();
  command->footer(
      "Lengths scale with s, masses with s^3, inertias with s^5, torque limits with s^3 (the\n"
      "drives' mass) or not at all; kp with s^4, as weight times lever does, kd and damping with\n"
      "s^4.5, ki with s^3.5, velocity limits with s^-0.5: the same motion in a longer time.\n\n"
      "Example:\n"
      "  clamber scale-robot --scale 1.2 -o out/coman_1.2\n"
      "  clamber climb --robot out/coman_1.2 --height 0.33");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
