#include "apps/service_settings.hpp"

#include <algorithm>

#include "apps/certification.hpp"
#include "apps/job_failed.hpp"
#include "apps/options.hpp"
#include "apps/realtime/runtime_settings.hpp"
#include "apps/steps.hpp"
#include "deploy/slots.hpp"
#include "firmware_hal/bus_model/bus_budget.hpp"
#include "planner_offline/plan.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> files_below(const fs::path& folder, const std::string& extension) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::recursive_directory_iterator(folder, error))
    if (entry.is_regular_file() && entry.path().extension() == extension)
      files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

void check_plan(const fs::path& plan, const RobotModel& robot, const fs::path& configs) {
  const FoundScenario made_for = scenario_of_plan(plan, configs);
  const std::string certificate = certificate_beside(plan.string());
  const Certification result =
      verify_plan_file(plan.string(), certificate, robot, made_for.scenario);
  if (!result.report.valid)
    throw JobFailed(plan.string() + ": its certificate is refused: " + result.report.reason);
  const fs::path image = fs::path(plan).replace_extension(".img");
  if (!fs::exists(image)) return;
  if (const std::string why =
          check_image_file(image.string(), plan.string(), certificate, robot, made_for.scenario);
      !why.empty())
    throw JobFailed(image.string() + ": " + why);
}

/// Where the slot is a bundle's: the manifest says the truth about what is in it.
void check_statement(const fs::path& folder, const RobotModel& robot, const Hardware& hardware) {
  const std::optional<SlotContent> content = read_slot(folder);
  if (!content) return;
  const auto refuse = [&](const std::string& why) {
    throw JobFailed((folder / "manifest.json").string() + ": " + why);
  };
  if (content->manifest.robot != robot.name || content->manifest.model != robot.hash)
    refuse("names another robot than the one in configs/");
  if (content->manifest.hardware != hardware) refuse("names other hardware than the bus map");
}

}  // namespace

ServiceSettings load_service_settings(const fs::path& folder) {
  const YamlNode yaml = YamlNode::load(folder / "service.yaml");
  yaml.allow_only({"plan", "robot", "hal", "control", "runtime"});
  return {yaml.at("plan").text(), yaml.at("robot").text(), yaml.at("hal").text(),
          yaml.at("control").text(), yaml.at("runtime").text()};
}

std::string format_service_settings(const ServiceSettings& settings) {
  return "# What `clamber service` runs from this slot.\nplan: " + settings.plan +
         "\nrobot: " + settings.robot + "\nhal: " + settings.hal +
         "\ncontrol: " + settings.control + "\nruntime: " + settings.runtime + '\n';
}

FoundScenario scenario_of_plan(const fs::path& plan, const fs::path& configs) {
  const std::string hash = load_plan(plan.string()).scenario_hash;
  for (const fs::path& file : files_below(configs / "scenarios", ".yaml"))
    if (Scenario scenario = load_scenario(file); scenario.hash == hash)
      return {file, std::move(scenario)};
  throw InputError(plan.string() + ": no scenario in " + (configs / "scenarios").string() +
                   " is the one that it was made for");
}

std::optional<BusMap> load_drives(const std::string& hal, const RobotModel& robot) {
  if (read_backend(hal) == Backend::kSimulation) return std::nullopt;
  return load_bus_map(hal, robot);
}

Hardware hardware_of(const std::string& hal, const RobotModel& robot) {
  Hardware hardware;
  const std::optional<BusMap> map = load_drives(hal, robot);
  if (!map) return hardware;
  for (const Bus& bus : map->buses) {
    std::vector<int>& nodes = hardware[bus.interface];
    for (const JointDrive& drive : bus.drives) nodes.push_back(drive.node);
    std::sort(nodes.begin(), nodes.end());
  }
  return hardware;
}

std::vector<std::string> check_slot(const fs::path& folder) {
  std::vector<std::string> seen;
  const ServiceSettings settings = load_service_settings(folder);
  const auto at = [&](const std::string& name) { return (folder / name).string(); };
  const RobotOptions robot_options{.robot = at(settings.robot)};
  const RobotModel robot = load_robot(robot_options);
  seen.push_back("robot " + robot.name);
  (void)load_control(at(settings.control), robot_options, robot);
  (void)load_runtime_settings(at(settings.runtime));
  seen.emplace_back("settings");
  if (const std::optional<BusMap> map = load_drives(at(settings.hal), robot)) {
    require_budget(*map);
    seen.push_back("bus map with " + std::to_string(map->buses.size()) + " buses within budget");
  }
  check_statement(folder, robot, hardware_of(at(settings.hal), robot));
  const std::vector<fs::path> scenarios = files_below(folder / "configs/scenarios", ".yaml");
  for (const fs::path& file : scenarios) (void)load_scenario(file);
  seen.push_back(std::to_string(scenarios.size()) + " scenarios");
  bool service = false;
  for (const fs::path& plan : files_below(folder / "plans", ".json")) {
    check_plan(plan, robot, folder / "configs");
    seen.push_back("certificate of " + fs::relative(plan, folder).string());
    service |= plan == folder / settings.plan;
  }
  if (!service)
    throw InputError(at("service.yaml") + ": plan: " + settings.plan + " is not in the slot");
  return seen;
}

}  // namespace clamber
