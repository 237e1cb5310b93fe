#include "apps/doctor/can_checks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "firmware_hal/bus_model/bus_budget.hpp"
#include "firmware_hal/socketcan/interface_check.hpp"
#include "firmware_hal/socketcan/open_ports.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using nlohmann::json;

constexpr long kCalibrationDays = 90;
constexpr double kEarliestSample = 0.6;  // of a bit: earlier, long lines sample the last bit
constexpr double kLatestSample = 0.9;    // later, clocks that differ sample the next one

std::string links_now() {
  // NOLINTNEXTLINE(cert-env33-c): a fixed command.
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(
      popen("ip -json -details link show 2>/dev/null", "r"), pclose);
  std::string text;
  std::array<char, 4096> part{};
  while (pipe && std::fgets(part.data(), static_cast<int>(part.size()), pipe.get()) != nullptr)
    text += part.data();
  return text;
}

/// iproute2 writes sample points as text, later versions as numbers.
double number(const json& node, const char* key) {
  if (!node.is_object() || !node.contains(key)) return 0.0;
  const json& value = node[key];
  if (value.is_number()) return value.get<double>();
  return value.is_string() ? std::atof(value.get<std::string>().c_str()) : 0.0;
}

std::string percent(double share) { return std::to_string(std::lround(100.0 * share)) + " %"; }

/// Collects what is wrong with a link; the worst verdict counts.
class Complaints {
 public:
  void add(Verdict verdict, const std::string& what, const std::string& remedy) {
    finding_.verdict = std::max(finding_.verdict, verdict);
    append(finding_.seen, what);
    append(finding_.remedy, remedy);
  }
  Finding finding_{"", Verdict::kFine, "", ""};

 private:
  static void append(std::string& text, const std::string& more) {
    if (text.find(more) == std::string::npos) text += (text.empty() ? "" : "; ") + more;
  }
};

void judge_timing(const Bus& bus, const json& timing, const std::string& name, double wanted,
                  Complaints& complaints) {
  const std::string up = socketcan_settings({}, bus).bitrate;
  const std::string set = "ip link set " + bus.interface + " down; ip link set " + bus.interface +
                          " up type can " + up + " restart-ms 100";
  const double rate = number(timing, "bitrate");
  if (rate != wanted)
    complaints.add(Verdict::kProblem,
                   name + " " + std::to_string(std::lround(rate)) + ", the map says " +
                       std::to_string(std::lround(wanted)),
                   set);
  const double sample = number(timing, "sample_point");
  if (sample > 0.0 && (sample < kEarliestSample || sample > kLatestSample))
    complaints.add(Verdict::kAdvice, "sample point of " + name + " at " + percent(sample),
                   "set sample-point and dsample-point to what the drives' manual says");
}

void judge_state(const Bus& bus, const json& data, Complaints& complaints) {
  const std::string state = data.value("state", std::string("unknown"));
  if (state == "ERROR-ACTIVE" || state == "STOPPED") return;
  const bool off = state == "BUS-OFF";
  complaints.add(off || state == "ERROR-PASSIVE" ? Verdict::kProblem : Verdict::kAdvice, state,
                 "check wiring, termination (60 ohm) and the drives' bit rate; " +
                     std::string(off ? "ip link set " + bus.interface + " down, then up"
                                     : "clamber bus monitor shows the errors"));
}

void judge_queue(const Bus& bus, const json& link, Complaints& complaints) {
  const auto tick = static_cast<long>(bus.drives.size()) + 2;  // commands, SYNC, heartbeat
  const long length = std::lround(number(link, "txqlen"));
  if (length < 2 * tick)
    complaints.add(
        Verdict::kAdvice,
        "queue of " + std::to_string(length) + " frames, two ticks are " + std::to_string(2 * tick),
        "ip link set " + bus.interface + " txqueuelen 64");
}

}  // namespace

Finding judge_link(const Bus& bus, const std::string& links) {
  Complaints complaints;
  complaints.finding_.check = "can." + bus.name;
  const json all = json::parse(links, nullptr, false);
  const json* link = nullptr;
  if (all.is_array())
    for (const json& entry : all)
      if (entry.is_object() && entry.value("ifname", std::string()) == bus.interface) link = &entry;
  if (link == nullptr) {
    complaints.add(Verdict::kProblem, bus.interface + ": `ip` does not show it",
                   "apt install iproute2, or plug the adapter in");
    return complaints.finding_;
  }
  const json info = link->value("linkinfo", json::object());
  const std::string kind = info.value("info_kind", std::string());
  judge_queue(bus, *link, complaints);
  if (kind == "can") {
    const json data = info.value("info_data", json::object());
    judge_state(bus, data, complaints);
    judge_timing(bus, data.value("bittiming", json::object()), "bitrate", bus.bitrate, complaints);
    if (bus.data_bitrate > 0)
      judge_timing(bus, data.value("data_bittiming", json::object()), "data bitrate",
                   bus.data_bitrate, complaints);
    if (number(data, "restart_ms") == 0.0)
      complaints.add(Verdict::kAdvice, "stays off after bus-off",
                     "ip link set " + bus.interface + " type can restart-ms 100");
  }
  if (complaints.finding_.seen.empty())
    complaints.finding_.seen =
        bus.interface + (kind == "vcan" ? ": a vcan, for rehearsals" : ": as the map says");
  else
    complaints.finding_.seen = bus.interface + ": " + complaints.finding_.seen;
  return complaints.finding_;
}

Findings check_buses(const BusMap& map) {
  Findings findings;
  std::string links;
  for (const Bus& bus : map.buses) {
    try {
      require_interface(socketcan_settings(map, bus));
      if (links.empty()) links = links_now();
      findings.push_back(judge_link(bus, links));
    } catch (const InputError& error) {
      // "... interface 'can0': does not exist: plug the adapter in ..."
      const std::string text = error.what();
      const std::size_t start = std::max(text.find("interface '"), std::size_t{0});
      const std::size_t what = text.find(": ", start);
      const std::size_t remedy = text.find(": ", what + 2);
      findings.push_back({"can." + bus.name, Verdict::kProblem, text.substr(start, remedy - start),
                          remedy == std::string::npos ? "" : text.substr(remedy + 2)});
    }
  }
  try {
    require_budget(map);
    double load = 0.0;
    for (const BusBudget& budget : bus_budgets(map)) load = std::max(load, budget.load);
    findings.push_back({"bus_budget", Verdict::kFine,
                        "worst-case load " + percent(load) + " of " + percent(map.max_load), ""});
  } catch (const InputError& error) {
    findings.push_back({"bus_budget", Verdict::kProblem, error.what(),
                        "clamber bus budget " + map.file + " shows what would fit"});
  }
  return findings;
}

Finding check_calibration(const BusMap& map, long today) {
  if (!map.calibrated)
    return {"calibration", Verdict::kAdvice,
            map.file + " does not say when its zeros were measured",
            "add hal: calibrated: YYYY-MM-DD"};
  const long age = today - *map.calibrated;
  const std::string seen = "zeros measured " + std::to_string(age) + " days ago";
  if (age < 0)
    return {"calibration", Verdict::kProblem, "zeros measured in the future",
            "set this computer's clock, or hal: calibrated in " + map.file};
  if (age <= kCalibrationDays) return {"calibration", Verdict::kFine, seen, ""};
  return {"calibration", Verdict::kAdvice, seen,
          "measure the zeros again and set hal: calibrated in " + map.file};
}

}  // namespace clamber
