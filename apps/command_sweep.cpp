// clamber sweep: plans, certifies and runs the climb over a grid of obstacles, and tabulates it.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/progress.hpp"
#include "apps/sweep_case.hpp"
#include "apps/sweep_table.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

struct Options {
  SweepInputs inputs;
  std::string out = "out/sweep";
  std::string heights = "0.1:0.5:0.05";
  std::string frictions = "0.8,0.5";
  std::string depths;
  std::string distances;
  std::string ballasts = "0";
  std::string shard = "0/1";
  bool keep_plans = false;
  bool list = false;
  std::vector<std::string> merge;
};

SweepGrid grid_of(const Options& options) {
  const auto optional = [](const std::string& text, const char* option) {
    return text.empty() ? std::vector<double>() : parse_axis(text, option, SweepRange::kPositive);
  };
  return {.heights = parse_axis(options.heights, "--heights", SweepRange::kPositive),
          .frictions = parse_axis(options.frictions, "--friction", SweepRange::kPositive),
          .depths = optional(options.depths, "--depth"),
          .distances = optional(options.distances, "--distance"),
          .ballasts = parse_axis(options.ballasts, "--ballast", SweepRange::kNotNegative)};
}

void tabulate(const std::vector<SweepCase>& cases, const std::string& out) {
  write_sweep_tables(cases, out);
  std::cout << sweep_summary(cases) << "written: " << out << "/table.csv, table.md, sweep.svg\n";
}

void run_cases(const Options& options) {
  const std::vector<SweepPoint> points = grid_of(options).points();
  const Shard shard = parse_shard(options.shard);
  SweepRunner runner(options.inputs, options.out, options.keep_plans);
  Progress progress;
  for (std::size_t k = shard.index; k < points.size(); k += shard.count) {
    const std::string place = std::to_string(k + 1) + " of " + std::to_string(points.size());
    if (runner.done(points[k])) {
      progress.stage(place + ": " + points[k].key() + " is there already");
      continue;
    }
    progress.stage(place + ": " + points[k].key());
    std::cout << describe_case(runner.run(points[k])) << std::endl;
  }
  if (shard.count == 1)
    tabulate(load_cases(options.out, points), options.out);
  else
    std::cout << "when all shards have ended: clamber sweep --merge DIR... --out DIR\n";
}

void run(const Options& options) {
  if (options.list) {
    for (const SweepPoint& point : grid_of(options).points()) std::cout << point.key() << '\n';
    return;
  }
  if (options.merge.empty()) return run_cases(options);
  tabulate(load_cases({options.merge.begin(), options.merge.end()}), options.out);
}

}  // namespace

void add_sweep_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "sweep", "Climbs over a grid of heights, frictions and more: table and picture");
  SweepInputs& inputs = options->inputs;
  command->add_option("recording", inputs.recording, "recording, or a motion.csv")
      ->capture_default_str();
  command->add_option("--out", options->out, "folder for everything")->capture_default_str();
  command->add_option("--heights", options->heights, "m, of the scenario's first obstacle")
      ->capture_default_str();
  command->add_option("--friction", options->frictions, "of every surface")->capture_default_str();
  command->add_option("--depth", options->depths, "m, of the obstacle (the scenario's)");
  command->add_option("--distance", options->distances,
                      "m, from the mid-point between the soles to the obstacle (the scenario's)");
  command->add_option("--ballast", options->ballasts, "shares of the robot file's ballast")
      ->capture_default_str();
  command->add_flag("--plan-only", inputs.plan_only, "plan and certificate, without the run");
  command->add_flag("--keep-plans", options->keep_plans, "keep plans, certificates and rejects");
  command->add_flag("--list", options->list, "only names the cases, one a line");
  CLI::Option* shard =
      command->add_option("--shard", options->shard, "i/n: every n-th case from the i-th, i from 0")
          ->capture_default_str();
  command->add_option("--merge", options->merge, "tables from the cases in these folders")
      ->excludes(shard);
  command->add_option("--scenario", inputs.scenario, "obstacle, start pose and goal")
      ->capture_default_str();
  command->add_option("--robot", inputs.robot, "folder of the robot, or its robot.yaml")
      ->capture_default_str();
  command->add_option("--planner", inputs.settings, "the planner's settings")
      ->capture_default_str();
  command->add_option("--control", inputs.control, "the controller's settings")
      ->capture_default_str();
  add_recording_options(*command, inputs.reading);
  command->footer(
      "An axis is a list of numbers and low:high:step ranges: 0.15,0.2,0.3:0.5:0.05. Every case\n"
      "is planned, certified and, unless --plan-only, run with feed-forward and judged. It leaves\n"
      "one line in cases/<parameters>.json; started again, the command goes on where it was\n"
      "stopped. Without --shard, table.csv, table.md and sweep.svg are written in the end.\n"
      "Exit code 0: every case ran, whether the robot climbed or not.\n\n"
      "Examples:\n"
      "  clamber sweep --heights 0.15:0.45:0.05 --friction 0.3:1:0.1\n"
      "  clamber sweep --heights 0.2,0.275 --depth 0.6,0.9 --distance 0.11:0.17:0.02 --ballast "
      "0,1\n"
      "A job array (Slurm, 16 jobs), then the tables:\n"
      "  sbatch --array=0-15 --cpus-per-task=2 --wrap 'clamber sweep --out DIR \\\n"
      "    --friction 0.3:1:0.1 --shard $SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT'\n"
      "  clamber sweep --merge DIR --out DIR");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
