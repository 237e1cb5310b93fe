#include "telemetry/telemetry_config.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <netinet/in.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <memory>
#include <sstream>

#include "robot_model/loader.hpp"
#include "telemetry/frame.hpp"

namespace clamber {
namespace {

constexpr int kMaxDomain = 232;  // beyond, the ports of the RTPS standard, 9.6.2.3, leave 16 bits
constexpr std::size_t kMaxName = 64;  // string<64> of the IDL

int parse_domain(const char* variable, const std::string& text) {
  int value = -1;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end || value < 0 || value > kMaxDomain) {
    throw InputError(std::string(variable) + ": expected a DDS domain from 0 to 232, got '" + text +
                     "'");
  }
  return value;
}

std::vector<std::string> split_at_commas(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) {
    if (!part.empty()) parts.push_back(part);
  }
  return parts;
}

bool is_ipv4(const std::string& text) {
  in_addr address{};
  return inet_pton(AF_INET, text.c_str(), &address) == 1;
}

/// Addresses of this machine's interface of that name or with that address.
std::vector<std::string> local_addresses(const std::string& name_or_address) {
  ifaddrs* raw = nullptr;
  if (getifaddrs(&raw) != 0) return {};
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> list(raw, &freeifaddrs);
  std::vector<std::string> found;
  for (const ifaddrs* entry = raw; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET) continue;
    char text[INET_ADDRSTRLEN] = {};
    const auto* address = reinterpret_cast<const sockaddr_in*>(entry->ifa_addr);
    inet_ntop(AF_INET, &address->sin_addr, text, sizeof text);
    if (name_or_address == entry->ifa_name || name_or_address == text) found.emplace_back(text);
  }
  return found;
}

void check_name(const std::string& what, const std::string& name) {
  if (name.empty() || name.size() > kMaxName) {
    throw InputError("telemetry: " + what + " '" + name + "': expected 1 to 64 characters");
  }
}

}  // namespace

TelemetryConfig with_environment(TelemetryConfig config) {
  for (const char* variable : {"CLAMBER_DDS_DOMAIN", "ROS_DOMAIN_ID"}) {
    if (const char* text = std::getenv(variable)) {
      config.domain = parse_domain(variable, text);
      break;
    }
  }
  if (const char* text = std::getenv("CLAMBER_DDS_INTERFACES")) {
    config.interfaces = split_at_commas(text);
    if (config.interfaces.empty()) {
      throw InputError("CLAMBER_DDS_INTERFACES: expected addresses or names, got none");
    }
  }
  if (const char* text = std::getenv("CLAMBER_DDS_SECURITY")) config.security = text;
  return config;
}

std::vector<std::string> interface_addresses(const TelemetryConfig& config) {
  std::vector<std::string> addresses;
  for (const std::string& interface : config.interfaces) {
    const std::vector<std::string> found = local_addresses(interface);
    if (found.empty()) {
      throw InputError("telemetry: interface '" + interface + "': this machine has " +
                       (is_ipv4(interface) ? "no such address" : "no IPv4 interface of that name"));
    }
    addresses.insert(addresses.end(), found.begin(), found.end());
  }
  // An empty list would mean "all interfaces" to Fast DDS.
  if (addresses.empty()) throw InputError("telemetry: interfaces: expected at least one, got none");
  return addresses;
}

void check(const TelemetryConfig& config, const TelemetryDescription& description) {
  const auto usable = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  if (config.robot.empty() || !std::all_of(config.robot.begin(), config.robot.end(), usable)) {
    throw InputError("telemetry: robot '" + config.robot +
                     "': expected letters, digits and _, as it becomes part of topic names");
  }
  check_name("robot", config.robot);
  if (config.domain < 0 || config.domain > kMaxDomain) {
    throw InputError("telemetry: domain " + std::to_string(config.domain) + ": expected 0 to 232");
  }
  const std::size_t joints = description.joint_names.size();
  if (joints > kMaxJoints || description.torque_limits.size() != joints) {
    throw InputError("telemetry: " + std::to_string(joints) + " joint names and " +
                     std::to_string(description.torque_limits.size()) +
                     " torque limits: expected as many of each, at most 32");
  }
  if (description.contact_names.size() > kMaxContacts) {
    throw InputError("telemetry: " + std::to_string(description.contact_names.size()) +
                     " contacts: expected at most 16");
  }
  if (description.phases.size() > TelemetryDescription::kMaxPhases)
    throw InputError("telemetry: " + std::to_string(description.phases.size()) +
                     " phases: expected at most 512");
  if (description.plan.size() > kMaxName)
    throw InputError("telemetry: plan '" + description.plan + "': expected a SHA-256");
  for (const DescribedLink& link : description.links)
    if (link.joint < -1 || link.joint >= static_cast<int>(joints))
      throw InputError("telemetry: link '" + link.name + "': no such joint");
  for (const std::string& name : description.joint_names) check_name("joint", name);
  for (const std::string& name : description.contact_names) check_name("contact", name);
}

}  // namespace clamber
