// bench/failure_policy/failure_policy: kills the host all along a climb, and tells how often the
// robot falls under each policy of its drives.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "apps/controller_config.hpp"
#include "bench/failure_policy/kills.hpp"
#include "bench/failure_policy/tables.hpp"
#include "planner_offline/plan_image.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

struct Options {
  std::string plan;
  std::string out = "out/failure_policy";
  std::string control = CLAMBER_SOURCE_DIR "/configs/control/default.yaml";
  KillOptions kill;
  std::string robot = CLAMBER_SOURCE_DIR "/configs/robots/coman";
  std::string scenario = CLAMBER_SOURCE_DIR "/configs/scenarios/box_0.275.yaml";
};

void write(const std::string& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw InputError(file + ": cannot be written");
}

void run(Options options, const std::string& command) {
  KillInputs inputs;
  inputs.model = load_robot(options.robot + "/robot.yaml");
  inputs.scenario = load_scenario(options.scenario);
  inputs.plan = load_plan(options.plan);
  inputs.control =
      load_controller_config(options.control, inputs.model, options.robot + "/control.yaml");
  inputs.control.accept_uncertified = true;
  inputs.image = plan_to_image(inputs.plan, {});
  options.kill.done = [&](const Kill& kill) {
    std::fprintf(stderr, "%7.2f s %-28s", kill.time, inputs.plan.phases[kill.phase].name.c_str());
    for (const Outcome& o : kill.of) std::fputs(o.fell ? "  falls" : "  stays", stderr);
    std::fprintf(stderr, "  planned: %s\n", to_string(kill.planned));
  };
  const std::vector<Kill> kills = kill_everywhere(inputs, options.kill);
  std::filesystem::create_directories(options.out);
  const std::string text = kills_markdown(kills, inputs.plan, options.kill, command);
  write(options.out + "/failure_policy.md", text);
  write(options.out + "/failure_policy.csv", kills_csv(kills, inputs.plan));
  write(options.out + "/failure_policy.svg", kills_svg(kills, inputs.plan));
  std::cout << text;
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  using namespace clamber;
  Options options;
  CLI::App app("Kills the host all along a climb", "failure_policy");
  app.add_option("plan", options.plan, "plan.json")->required();
  app.add_option("--stride", options.kill.stride, "s between kills")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 100.0));
  app.add_option("--first", options.kill.first, "s, the first kill")->capture_default_str();
  app.add_option("--last", options.kill.last, "s, none after it");
  app.add_option("-o,--out", options.out, "folder")->capture_default_str();
  app.add_option("--watch", options.kill.watch, "s after each")->capture_default_str();
  app.add_option("--jobs", options.kill.jobs, "copies at a time")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  app.add_option("--control", options.control, "the controller's settings")->capture_default_str();
  app.add_option("--robot", options.robot, "the robot's folder")->capture_default_str();
  app.add_option("--scenario", options.scenario, "file")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    std::string command = "bench/failure_policy/failure_policy";
    for (int i = 1; i < argc; ++i) command += std::string(" ") + argv[i];
    run(options, command);
  } catch (const InputError& error) {
    std::cerr << "failure_policy: " << error.what() << '\n';
    return 2;
  }
  return 0;
}
