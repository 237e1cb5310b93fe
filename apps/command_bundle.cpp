// clamber bundle: everything that a robot shall run, in one signed archive.
#include <cstdlib>
#include <iostream>
#include <memory>

#include "apps/certification.hpp"
#include "apps/commands.hpp"
#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "apps/options.hpp"
#include "apps/service_settings.hpp"
#include "deploy/bundle.hpp"
#include "deploy/target.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string out;
  std::string key;
  std::string version = CLAMBER_VERSION;
  std::vector<std::string> plans;
  std::string configs;
  std::string program = "/proc/self/exe";
  std::string minimum_kernel = "5.10";
  ServiceSettings service;
};

/// SOURCE_DATE_EPOCH (reproducible-builds.org), else 0: the time of making is no input.
std::uint64_t time_of_sources() {
  const char* text = std::getenv("SOURCE_DATE_EPOCH");
  if (text == nullptr || *text == '\0') return 0;
  char* end = nullptr;
  const unsigned long long time = std::strtoull(text, &end, 10);
  if (*end != '\0' || time >= (1ULL << 33U))
    throw InputError(std::string("SOURCE_DATE_EPOCH: expected seconds, found ") + text);
  return time;
}

void add_configs(const fs::path& folder, std::vector<BundleSource>& sources) {
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = fs::relative(entry.path(), folder).string();
    // Recordings are large, and input of the planner only.
    const bool wanted =
        !name.starts_with("recordings/") && entry.path().filename().string()[0] != '.';
    if (entry.is_regular_file() && wanted)
      sources.push_back({"configs/" + name, entry.path(), {}, false});
  }
}

/// plan.json, plan.cert and, if there is one, plan.img under plans/FOLDER/. @return its place
std::string add_plan(const std::string& plan, std::vector<BundleSource>& sources) {
  const fs::path file = fs::absolute(plan);
  const std::string place = "plans/" + file.parent_path().filename().string() + '/';
  const auto add = [&](const std::string& name, const fs::path& from) {
    for (const BundleSource& other : sources)
      if (other.path == place + name)
        throw InputError(plan + ": another plan comes from a folder of the same name");
    sources.push_back({place + name, from, {}, false});
  };
  add("plan.json", file);
  add("plan.cert", certificate_beside(file.string()));
  if (const fs::path image = fs::path(file).replace_extension(".img"); fs::exists(image))
    add("plan.img", image);
  return place + "plan.json";
}

/// What would not pass the robot's preflight is not bundled.
void check_plans(const Options& options, const RobotModel& robot, const fs::path& configs) {
  for (const std::string& plan : options.plans) {
    const FoundScenario made_for = scenario_of_plan(plan, configs);
    const Certification found =
        verify_plan_file(plan, certificate_beside(plan), robot, made_for.scenario);
    if (!found.report.valid)
      throw JobFailed(plan + ": its certificate is refused: " + found.report.reason);
  }
}

void run(Options options) {
  const SecretKey key = load_secret_key(options.key);
  const fs::path configs = options.configs.empty() ? configs_folder() : fs::path(options.configs);
  const auto in_configs = [&](const std::string& name) {
    if (!name.starts_with("configs/")) throw InputError(name + ": expected a path in configs/");
    return (configs / name.substr(8)).string();
  };
  const RobotModel robot = load_robot(RobotOptions{.robot = in_configs(options.service.robot)});
  check_plans(options, robot, configs);

  std::vector<BundleSource> sources;
  add_configs(configs, sources);
  for (const std::string& plan : options.plans) {
    const std::string place = add_plan(plan, sources);
    if (options.service.plan.empty()) options.service.plan = place;
  }
  for (const std::string& name :
       {options.service.hal, options.service.control, options.service.runtime})
    if (!fs::exists(in_configs(name))) throw InputError(in_configs(name) + ": no such file");
  sources.push_back({"bin/clamber", options.program, {}, true});
  sources.push_back({"service.yaml", {}, format_service_settings(options.service), false});

  Manifest manifest;
  manifest.version = options.version;
  manifest.robot = robot.name;
  manifest.model = robot.hash;
  manifest.hardware = hardware_of(in_configs(options.service.hal), robot);
  manifest.machine = this_machine().name;
  manifest.minimum_kernel = options.minimum_kernel;
  manifest.time = time_of_sources();
  const std::string out =
      options.out.empty() ? robot.name + '-' + options.version + ".cfw" : options.out;
  const std::size_t files = sources.size();
  const std::string id = write_bundle(out, manifest, std::move(sources), key);
  std::cout << "bundle:   " << manifest.name() << ", " << files << " files, "
            << (fs::file_size(out) >> 10) << " KiB\n"
            << "hardware: " << describe(manifest.hardware) << '\n'
            << "id:       " << id << '\n'
            << "signed:   " << key.public_key().id() << " (" << key.name << ")\n"
            << "written:  " << out << '\n';
}

}  // namespace

void add_bundle_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "bundle", "Packs program, settings and certified plans into one signed file for `flash`");
  command->add_option("-o,--out", options->out, "bundle (ROBOT-VERSION.cfw)");
  command->add_option("--key", options->key, "secret key of `clamber key new`")->required();
  command
      ->add_option("--plan", options->plans,
                   "plan.json, its certificate beside it; the first is the service's")
      ->required();
  command->add_option("--version", options->version, "what this release is called")
      ->capture_default_str();
  command->add_option("--config-set", options->configs, "folder that takes the place of configs/");
  command->add_option("--robot", options->service.robot, "the service's robot")
      ->capture_default_str();
  command->add_option("--hal", options->service.hal, "the service's bus map")
      ->capture_default_str();
  command->add_option("--control", options->service.control, "the service's controller settings")
      ->capture_default_str();
  command->add_option("--runtime", options->service.runtime, "the service's control thread")
      ->capture_default_str();
  command->add_option("--minimum-kernel", options->minimum_kernel, "the oldest Linux it runs on")
      ->capture_default_str();
  command->add_option("--program", options->program, "the clamber to be bundled (this one)");
  command->footer(
      "The same inputs give the same bytes; times are $SOURCE_DATE_EPOCH, else 0. Any tar lists\n"
      "what is in a bundle. Plans whose certificate does not hold are not bundled. The scenario "
      "of\n"
      "a plan must be among the settings. Exit codes: 0 written, 1 a plan is refused, 2 unusable\n"
      "input.\n\n"
      "Example:\n"
      "  clamber bundle --key release --plan out/climb/plan.json --version 1.2.0");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
