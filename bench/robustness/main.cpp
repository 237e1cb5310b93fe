// bench/robustness/robustness: climbs one plan many times in worlds that differ from the one it is
// made for.
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "apps/certification.hpp"
#include "apps/config_files.hpp"
#include "apps/options.hpp"
#include "apps/sweep_grid.hpp"
#include "bench/robustness/tables.hpp"
#include "bench/robustness/trial.hpp"
#include "planner_offline/plan_image.hpp"
#include "report/markup.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Options {
  std::string plan;
  std::string out = "out/robustness";
  std::string control = "configs/control/default.yaml";
  std::string shard = "0/1";
  std::string only, without;
  std::uint64_t runs = 100, first = 1;
  int jobs = 2;
  bool uncertified = false;
  RobotOptions robot;
  ScenarioOptions scenario;
};

/// Which parts of the perturbation stay away. @throws InputError
std::vector<std::string> left_out(const Options& options) {
  const auto words = [](const std::string& list) {
    std::vector<std::string> out = CLI::detail::split(list, ',');
    std::erase(out, "");
    for (const std::string& word : out)
      if (std::find(std::begin(kPerturbationParts), std::end(kPerturbationParts), word) ==
          std::end(kPerturbationParts))
        throw InputError("'" + word + "' is no part of a perturbation");
    return out;
  };
  std::vector<std::string> out = words(options.without);
  const std::vector<std::string> only = words(options.only);
  for (const std::string_view part : kPerturbationParts)
    if (!only.empty() && std::find(only.begin(), only.end(), part) == only.end())
      out.emplace_back(part);
  return out;
}

TrialInputs read_inputs(const Options& options) {
  TrialInputs inputs;
  inputs.model = load_robot(options.robot);
  inputs.scenario = load_scenario(options.scenario);
  inputs.plan = load_plan(options.plan);
  inputs.control = load_control(options.control, options.robot, inputs.model);
  inputs.control.accept_uncertified = options.uncertified;
  inputs.left_out = left_out(options);
  std::string certificate;
  if (!options.uncertified) {
    const Certification found = verify_plan_file(options.plan, certificate_beside(options.plan),
                                                 inputs.model, inputs.scenario);
    if (!found.report.valid) throw InputError(options.plan + ": " + found.report.reason);
    certificate = found.sha256;
  }
  inputs.image = plan_to_image(inputs.plan, certificate);
  return inputs;
}

/// Trials of the same inputs and program have the same digest.
std::string digest(const Options& options, const TrialInputs& inputs) {
  std::string all = sha256_file(options.plan) + sha256_file("/proc/self/exe") +
                    sha256_file(find_file(options.control)) + inputs.model.hash +
                    inputs.scenario.hash;
  const fs::path gains = find_robot(options.robot.robot).parent_path() / "control.yaml";
  std::error_code error;
  if (fs::exists(gains, error)) all += sha256_file(gains);
  for (const std::string& part : inputs.left_out) all += '\n' + part;
  return sha256_hex(all);
}

class Campaign {
 public:
  Campaign(const Options& options, TrialInputs inputs)
      : options_(options), inputs_(std::move(inputs)), digest_(digest(options, inputs_)) {
    fs::create_directories(folder());
  }

  /// Every seed of this shard that has no record yet, in `jobs` processes: one ODE world each.
  void run() {
    const Shard shard = parse_shard(options_.shard);
    std::vector<std::uint64_t> seeds;
    for (std::uint64_t k = shard.index; k < options_.runs; k += shard.count)
      if (!record(options_.first + k)) seeds.push_back(options_.first + k);
    std::vector<pid_t> children;
    for (int job = 0; job < options_.jobs; ++job) {
      const pid_t child = fork();
      if (child < 0) throw InputError("cannot start a process");
      if (child == 0) _exit(work(seeds, static_cast<std::size_t>(job)));
      children.push_back(child);
    }
    bool good = true;
    for (const pid_t child : children) {
      int status = 0;
      waitpid(child, &status, 0);
      good &= WIFEXITED(status) && WEXITSTATUS(status) == 0;
    }
    if (!good) throw InputError("stopped; the same command goes on from here");
  }

  [[nodiscard]] std::vector<Json> records() const {
    std::vector<Json> out;
    for (std::uint64_t k = 0; k < options_.runs; ++k)
      if (auto found = record(options_.first + k)) out.push_back(std::move(*found));
    return out;
  }

 private:
  [[nodiscard]] fs::path folder() const { return fs::path(options_.out) / "trials"; }
  [[nodiscard]] fs::path file(std::uint64_t seed) const {
    return folder() / (std::to_string(seed) + ".json");
  }
  [[nodiscard]] std::optional<Json> record(std::uint64_t seed) const {
    std::error_code error;
    if (!fs::exists(file(seed), error)) return std::nullopt;
    Json json = Json::parse(read_file(file(seed)), nullptr, false);
    if (!json.is_object() || json.value("inputs", "") != digest_) return std::nullopt;
    return json;
  }
  int work(const std::vector<std::uint64_t>& seeds, std::size_t job) const {
    try {
      for (std::size_t k = job; k < seeds.size(); k += static_cast<std::size_t>(options_.jobs)) {
        Json trial = run_trial(inputs_, seeds[k]);
        if (trial.is_null()) return 1;
        trial["inputs"] = digest_;
        const std::string part = file(seeds[k]).string() + ".part";
        write_text(part, trial.dump() + '\n');
        fs::rename(part, file(seeds[k]));
        std::cerr << "seed " + std::to_string(seeds[k]) + ": " +
                         (trial.at("success").get<bool>()
                              ? "climbs"
                              : "FAILS, " + trial.at("failure").get<std::string>()) +
                         '\n';
      }
      return 0;
    } catch (const std::exception& error) {
      std::cerr << error.what() << '\n';
      return 2;
    }
  }

  const Options& options_;
  TrialInputs inputs_;
  std::string digest_;
};

void run(const Options& options, const std::string& command) {
  Campaign campaign(options, read_inputs(options));
  campaign.run();
  const std::vector<Json> trials = campaign.records();
  write_text(options.out + "/robustness.md", robustness_markdown(trials, command));
  write_text(options.out + "/robustness.json", robustness_json(trials).dump(1) + '\n');
  write_text(options.out + "/robustness.svg", robustness_svg(trials));
  std::cout << robustness_markdown(trials, command);
}

std::string command_line(int argc, char** argv) {
  std::string out = "bench/robustness/robustness";
  for (int i = 1; i < argc; ++i) out += std::string(" ") + argv[i];
  return out;
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  using namespace clamber;
  Options options;
  CLI::App app("Climbs a plan in worlds that differ from the one it was made for", "robustness");
  app.add_option("plan", options.plan, "plan.json, its certificate beside it")->required();
  app.add_option("--runs", options.runs, "seeds")->capture_default_str();
  app.add_option("--first", options.first, "the first seed")->capture_default_str();
  app.add_option("--jobs", options.jobs, "processes")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  app.add_option("--shard", options.shard, "i/n: every n-th seed from the i-th on");
  app.add_option("--only", options.only, "parts of the perturbation, separated by commas");
  app.add_option("--without", options.without, "parts that are left out");
  app.add_option("--control", options.control, "the controller's settings")->capture_default_str();
  app.add_option("-o,--out", options.out, "folder")->capture_default_str();
  app.add_flag("--uncertified", options.uncertified, "the plan needs no certificate");
  add_robot_options(app, options.robot);
  add_scenario_options(app, options.scenario);
  std::string parts;
  for (const std::string_view part : kPerturbationParts) parts += ' ' + std::string(part);
  app.footer("Parts:" + parts + "\nSeeds that are in the folder already are not run again.");
  CLI11_PARSE(app, argc, argv);
  try {
    run(options, command_line(argc, argv));
  } catch (const InputError& error) {
    std::cerr << "robustness: " << error.what() << '\n';
    return 2;
  }
  return 0;
}
