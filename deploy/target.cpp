#include "deploy/target.hpp"

#include <sys/utsname.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "robot_model/loader.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

int whole(const YamlNode& node, int lowest, int highest) {
  const double value = node.number();
  if (value != std::floor(value) || value < lowest || value > highest)
    node.fail("expected a whole number from " + std::to_string(lowest) + " to " +
              std::to_string(highest) + ", found " + node.text());
  return static_cast<int>(value);
}

Hardware read_hardware(const YamlNode& node) {
  Hardware hardware;
  for (const auto& [interface, nodes] : node.entries()) {
    std::vector<int>& ids = hardware[interface];
    for (const YamlNode& id : nodes.items()) ids.push_back(whole(id, 0, 0x7ff));
    std::sort(ids.begin(), ids.end());
  }
  return hardware;
}

HealthSettings read_health(const YamlNode& node) {
  node.allow_only({"time", "timeout", "overruns"});
  HealthSettings health;
  if (const auto found = node.find("time")) health.time = found->non_negative();
  if (const auto found = node.find("timeout")) health.timeout = found->positive();
  if (const auto found = node.find("overruns")) health.overruns = whole(*found, 0, 1'000'000'000);
  return health;
}

std::string absolute(const YamlNode& node) {
  if (node.text()[0] != '/') node.fail("expected an absolute path, found " + node.text());
  return node.text();
}

/// Numbers of a version: "6.1.0-18-rt-amd64" gives 6, 1, 0.
std::vector<int> version_of(const std::string& text) {
  std::vector<int> numbers;
  std::istringstream in(text);
  for (int number = 0; numbers.size() < 3 && in >> number;) {
    numbers.push_back(number);
    if (in.peek() != '.') break;
    in.get();
  }
  numbers.resize(3);
  return numbers;
}

}  // namespace

fs::path target_file(const fs::path& root) { return root / "etc/clamber/target.yaml"; }

Target load_target(const fs::path& root) {
  const fs::path file = target_file(root);
  std::error_code error;
  if (!fs::exists(file, error))
    throw InputError(file.string() +
                     ": no such file: it says which robot this is; `clamber flash setup` makes it");
  const YamlNode yaml = YamlNode::load(file);
  yaml.allow_only(
      {"robot", "model", "hardware", "restart", "operator", "health_file", "health", "doctor"});
  Target target;
  target.robot = yaml.at("robot").text();
  if (const auto node = yaml.find("model")) target.model = node->text();
  if (const auto node = yaml.find("hardware")) target.hardware = read_hardware(*node);
  if (const auto node = yaml.find("restart")) target.restart = node->texts();
  if (const auto node = yaml.find("operator")) target.operator_socket = absolute(*node);
  if (const auto node = yaml.find("health_file")) target.health_file = absolute(*node);
  if (const auto node = yaml.find("health")) target.health = read_health(*node);
  if (const auto node = yaml.find("doctor")) target.doctor = node->flag();
  return target;
}

std::string format_target(const Target& target) {
  std::ostringstream out;
  out << "# Which robot this is; `clamber flash` takes bundles for it only (docs/deploy.md).\n"
      << "robot: " << target.robot << '\n';
  if (target.model) out << "model: " << *target.model << '\n';
  if (target.hardware) {
    out << (target.hardware->empty() ? "hardware: {}" : "hardware:  # CAN interface: node ids")
        << '\n';
    for (const auto& [interface, nodes] : *target.hardware) {
      out << "  " << interface << ": [";
      for (std::size_t i = 0; i < nodes.size(); ++i) out << (i > 0 ? ", " : "") << nodes[i];
      out << "]\n";
    }
  }
  if (!target.restart.empty()) {
    out << "restart: [";
    for (std::size_t i = 0; i < target.restart.size(); ++i)
      out << (i > 0 ? ", " : "") << '"' << target.restart[i] << '"';
    out << "]\n";
  }
  out << "health: {time: " << target.health.time << ", timeout: " << target.health.timeout
      << ", overruns: " << target.health.overruns << "}\n"
      << "doctor: " << (target.doctor ? "true" : "false") << '\n';
  return out.str();
}

Machine this_machine() {
  utsname found{};
  uname(&found);
  return {&found.machine[0], &found.release[0]};
}

void require_match(const Manifest& manifest, const Target& target, const Machine& machine,
                   const std::string& what) {
  const auto refuse = [&](const std::string& why) { throw InputError(what + ": " + why); };
  if (manifest.abi != kBundleAbi)
    refuse("is of bundle ABI " + std::to_string(manifest.abi) + ", this flasher of " +
           std::to_string(kBundleAbi) +
           (manifest.abi < kBundleAbi ? ": bundle it again"
                                      : ": update the clamber package here first"));
  if (manifest.robot != target.robot)
    refuse("is for robot '" + manifest.robot + "', this is '" + target.robot + "'");
  if (target.model && manifest.model != *target.model)
    refuse("is for another model of the robot: " + manifest.model.substr(0, 12) + ", this is " +
           target.model->substr(0, 12));
  if (target.hardware && manifest.hardware != *target.hardware)
    refuse("is for other hardware: " + describe(manifest.hardware) +
           "; here: " + describe(*target.hardware));
  if (manifest.machine != machine.name)
    refuse("is for " + manifest.machine + ", this machine is " + machine.name);
  if (version_of(machine.kernel) < version_of(manifest.minimum_kernel))
    refuse("needs Linux " + manifest.minimum_kernel + " or later, this is " + machine.kernel);
}

}  // namespace clamber
