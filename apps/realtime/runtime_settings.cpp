#include "apps/realtime/runtime_settings.hpp"

#include <array>
#include <cmath>
#include <sstream>

#include "robot_model/loader.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

int whole_number(const YamlNode& node, int lowest, int highest) {
  const double value = node.number();
  if (value != std::floor(value) || value < lowest || value > highest)
    node.fail("expected a whole number from " + std::to_string(lowest) + " to " +
              std::to_string(highest) + ", found " + node.text());
  return static_cast<int>(value);
}

GuardAction read_action(const YamlNode& node, bool may_count, bool may_abort) {
  const std::string word = node.text();
  if (word == "off") return GuardAction::kOff;
  if (word == "count" && may_count) return GuardAction::kCount;
  if (word == "abort" && may_abort) return GuardAction::kAbort;
  node.fail(std::string("expected off") + (may_count ? ", count" : "") +
            (may_abort ? ", abort" : "") + ", found " + word);
}

GuardSettings read_guards(const YamlNode& node) {
  node.allow_only({"malloc", "syscalls", "faults"});
  GuardSettings guards;
  if (const auto found = node.find("malloc")) guards.malloc = read_action(*found, true, true);
  if (const auto found = node.find("syscalls")) guards.syscalls = read_action(*found, false, true);
  if (const auto found = node.find("faults")) guards.faults = read_action(*found, true, false);
  return guards;
}

OperatorSettings read_operator(const YamlNode& node) {
  node.allow_only({"socket", "group", "mode"});
  OperatorSettings settings;
  if (const auto found = node.find("socket")) settings.socket = found->text();
  if (const auto found = node.find("group")) settings.group = found->text();
  if (const auto found = node.find("mode")) {
    const std::string digits = found->text();
    const bool octal = digits.size() == 4 && digits[0] == '0' &&
                       digits.find_first_not_of("01234567") == std::string::npos;
    if (!octal) found->fail("expected four octal digits such as 0660, found " + digits);
    settings.mode = static_cast<unsigned>(std::stoul(digits, nullptr, 8));
    if ((settings.mode & 0600U) != 0600U || (settings.mode & 0111U) != 0)
      found->fail("expected read and write for the owner and nothing executable, found " + digits);
  }
  return settings;
}

void read_telemetry(const YamlNode& node, TelemetryConfig& config) {
  node.allow_only({"domain", "interfaces", "process", "security"});
  if (const auto found = node.find("domain")) config.domain = whole_number(*found, 0, 232);
  if (const auto found = node.find("interfaces")) config.interfaces = found->texts();
  if (const auto found = node.find("process")) {
    const std::string word = found->text();
    if (word != "in_process" && word != "separate")
      found->fail("expected in_process or separate, found " + word);
    config.separate_process = word == "separate";
  }
  if (const auto found = node.find("security")) config.security = found->text();
}

}  // namespace

RuntimeSettings load_runtime_settings(const std::filesystem::path& file) {
  const YamlNode root = YamlNode::load(file);
  root.allow_only({"priority", "processors", "lock_memory", "stack_kb", "required", "warm_up",
                   "guards", "operator", "telemetry"});
  RuntimeSettings settings;
  settings.telemetry.separate_process = true;
  if (const auto node = root.find("priority")) settings.priority = whole_number(*node, 0, 99);
  if (const auto node = root.find("processors"))
    for (const YamlNode& item : node->items())
      settings.processors.push_back(whole_number(item, 0, 1023));
  if (const auto node = root.find("lock_memory")) settings.lock_memory = node->flag();
  if (const auto node = root.find("stack_kb"))
    settings.stack = 1024 * static_cast<std::size_t>(whole_number(*node, 128, 65536));
  if (const auto node = root.find("required")) settings.required = node->flag();
  if (const auto node = root.find("warm_up")) settings.warm_up = node->non_negative();
  if (const auto node = root.find("guards")) settings.guards = read_guards(*node);
  if (const auto node = root.find("operator")) settings.operator_socket = read_operator(*node);
  if (const auto node = root.find("telemetry")) read_telemetry(*node, settings.telemetry);
  return settings;
}

GuardSettings parse_guards(const std::string& list) {
  GuardSettings guards;
  std::istringstream words(list);
  for (std::string word; std::getline(words, word, ',');) {
    if (word == "malloc")
      guards.malloc = GuardAction::kAbort;
    else if (word == "syscalls")
      guards.syscalls = GuardAction::kAbort;
    else if (word == "faults")
      guards.faults = GuardAction::kCount;
    else
      throw InputError("--guard: expected malloc, syscalls, faults, separated by commas, found '" +
                       word + "'");
  }
  return guards;
}

}  // namespace clamber
