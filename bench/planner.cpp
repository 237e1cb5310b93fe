// Time of a whole plan by stage: from a recording to the plan's keyframes.
//   planner [recording] [scenario.yaml] [repetitions]
// Defaults: the shipped demonstration, the 0.275 m box, 3. The plan's hash is printed: a faster
// planner that makes another plan says so.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "bench/calibration.hpp"
#include "planner_offline/contacts/playback.hpp"
#include "planner_offline/planner.hpp"
#include "planner_offline/recording/import.hpp"
#include "planner_offline/retarget/retarget.hpp"
#include "planner_offline/settings_file.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

using bench::Elapsed;
using bench::Stopwatch;

const std::string kConfigs = std::string(CLAMBER_SOURCE_DIR) + "/configs/";

struct Timed {
  std::vector<std::pair<std::string, Elapsed>> stages;
  std::string plan_hash;
};

Timed plan_once(const RobotModel& model, const std::string& recording, const Scenario& scenario,
                const PlannerSettings& settings) {
  Timed timed;
  Stopwatch stage;
  const auto done = [&](const std::string& name) {
    timed.stages.emplace_back(name, stage.elapsed());
    stage = Stopwatch();
  };
  const Stopwatch all;
  const RobotMotion motion =
      retarget(import_recording(recording), model,
               load_retarget_config(kConfigs + "robots/coman/retarget.yaml"));
  done("import");
  const PlaybackConfig config;
  const Playback playback = play(model, motion, scenario, config);
  done("playback");
  const ContactSequence sequence = contacts_of(model, motion, playback, config);
  done("contact states");
  const PlanningResult result =
      plan_climb(model, scenario, sequence, settings, [](double, const std::string&) {});
  done("planning");
  for (const auto& [name, seconds] : result.stages) {
    timed.stages.emplace_back("  " + name, Elapsed{seconds, 0.0});
  }
  timed.stages.emplace_back("whole plan", all.elapsed());
  const auto file = std::filesystem::temp_directory_path() /
                    ("clamber_bench_plan_" + std::to_string(getpid()) + ".json");
  save_plan(result.plan, file);
  timed.plan_hash = sha256_file(file);
  std::filesystem::remove(file);
  return timed;
}

int run(const std::string& recording, const std::string& scenario_file, int repetitions) {
  bench::print_calibration();
  const RobotModel model = load_robot(kConfigs + "robots/coman/robot.yaml");
  const Scenario scenario = load_scenario(scenario_file);
  const PlannerSettings settings = load_planner_settings(kConfigs + "planner/default.yaml");
  for (int i = 0; i < repetitions; ++i) {
    const Timed timed = plan_once(model, recording, scenario, settings);
    std::printf("run %d, plan %s\n  %-26s %8s %10s\n", i + 1, timed.plan_hash.c_str(), "stage",
                "wall s", "processor s");
    for (const auto& [name, time] : timed.stages) {
      std::printf("  %-26s %8.3f", name.c_str(), time.wall);
      std::printf(time.processor > 0.0 ? " %10.3f\n" : "\n", time.processor);
    }
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  using clamber::kConfigs;
  try {
    return clamber::run(argc > 1 ? argv[1] : kConfigs + "recordings/climb_table_synthetic.mvnx",
                        argc > 2 ? argv[2] : kConfigs + "scenarios/box_0.275.yaml",
                        argc > 3 ? std::atoi(argv[3]) : 3);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "planner: %s\n", error.what());
    return 2;
  }
}
