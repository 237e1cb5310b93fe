#include "apps/bus_live.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <numeric>
#include <optional>

#include "apps/bus_listener.hpp"
#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "apps/options.hpp"
#include "apps/run_support.hpp"

namespace clamber {
namespace {

constexpr std::int64_t kMilliseconds = 1'000'000;

// ---- scan

struct ScanOptions {
  std::string map;
  RobotOptions robot;
};

/// @return drives of the map that did not answer
std::vector<std::string> print_bus(const BusListener& listener, std::size_t b) {
  const BusWatch& watch = listener.watch(b);
  const Bus& bus = watch.bus();
  std::vector<std::string> silent;
  std::printf("%s (%s, %s, %s)\n", bus.name.c_str(), bus.interface.c_str(), to_string(bus.protocol),
              to_string(listener.port(b).state()));
  for (std::size_t i = 0; i < bus.drives.size(); ++i) {
    const JointDrive& drive = bus.drives[i];
    const WatchedDrive& seen = watch.drive(i);
    const auto node = listener.nodes(b).find(static_cast<std::uint8_t>(drive.node));
    const bool answers = seen.replies > 0 || node != listener.nodes(b).end();
    std::printf("  node %3d  %-12s ", drive.node, drive.name.c_str());
    if (seen.replies > 0)
      std::printf("%-18s %8.4f rad\n", seen.state.c_str(), seen.q);
    else if (answers)
      std::printf("answers, device type 0x%08X\n", node->second.device_type);
    else
      std::printf("no answer\n");
    if (!answers)
      silent.push_back(drive.name + " (" + bus.interface + " node " + std::to_string(drive.node) +
                       ")");
  }
  for (const auto& [node, answer] : listener.nodes(b)) {
    const auto mapped = [n = node](const JointDrive& drive) { return drive.node == n; };
    if (std::none_of(bus.drives.begin(), bus.drives.end(), mapped))
      std::printf("  node %3d  not in the map: device type 0x%08X\n", node, answer.device_type);
  }
  if (bus.protocol == BusProtocol::kMit)
    for (const auto& [id, count] : watch.strangers())
      std::printf("  id 0x%03X  not in the map: %llu frames\n", id,
                  static_cast<unsigned long long>(count));
  return silent;
}

/// Listens, and asks if nobody commands the drives. @return whether it asked
bool look_around(BusListener& listener, const BusMap& map) {
  listener.listen(listener.now() + 200 * kMilliseconds);
  if (listener.commands() > 0) return false;
  for (std::size_t b = 0; b < listener.size(); ++b) {
    std::array<std::uint8_t, 127> all{};
    std::iota(all.begin(), all.end(), std::uint8_t{1});
    for (const CanFrame& frame : questions_to(map.buses[b], 0x1000, all)) listener.send(b, frame);
  }
  listener.listen(listener.now() + 200 * kMilliseconds);
  return true;
}

void scan(const ScanOptions& options) {
  const BusMap map = load_bus_map(find_file(options.map), load_robot(options.robot));
  BusListener listener(map);
  if (!look_around(listener, map)) std::printf("somebody commands these drives: only listening\n");
  std::vector<std::string> silent;
  for (std::size_t b = 0; b < listener.size(); ++b)
    for (std::string& name : print_bus(listener, b)) silent.push_back(std::move(name));
  if (silent.empty()) return;
  std::string names;
  for (const std::string& name : silent) names += (names.empty() ? "" : ", ") + name;
  throw JobFailed(map.file + ": no answer from " + std::to_string(silent.size()) + " of " +
                  std::to_string(map.joint_count) + " drives: " + names +
                  ": check power, node ids, wiring and both bit rates");
}

// ---- monitor

struct MonitorOptions {
  std::string map;
  double interval = 1.0;
  std::optional<double> duration;
  bool plain = false;
  RobotOptions robot;
};

/// Counters of one drive and bus at the last look, for what happened since.
struct Before {
  std::uint64_t frames = 0;
  std::int64_t busy_ns = 0;
  std::vector<std::uint64_t> commands;
  std::vector<std::uint64_t> replies;
};

class Screen {
 public:
  Screen(BusListener& listener, bool plain)
      : listener_(listener), plain_(plain), color_(use_color()) {
    before_.resize(listener.size());
    for (std::size_t b = 0; b < listener.size(); ++b) {
      before_[b].commands.resize(listener.watch(b).bus().drives.size());
      before_[b].replies = before_[b].commands;
    }
  }

  void show(double seconds) {
    if (!plain_) std::printf("\033[H\033[2J");
    for (std::size_t b = 0; b < listener_.size(); ++b) show_bus(b, seconds);
    std::printf("\n");
    std::fflush(stdout);
  }

 private:
  void show_bus(std::size_t b, double seconds) {
    const BusWatch& watch = listener_.watch(b);
    const Bus& bus = watch.bus();
    const SocketCanPort& port = listener_.port(b);
    Before& before = before_[b];
    std::uint64_t strangers = 0;
    for (const auto& [id, count] : watch.strangers()) strangers += count;
    const bool healthy = port.state() == PortState::kActive;
    std::printf(
        "%-16s %-8s %s%-8s%s load %5.1f %%  %7.0f frames/s  errors %llu  malformed %llu  "
        "strangers %llu  lost %llu\n",
        bus.name.c_str(), bus.interface.c_str(), mark(!healthy), to_string(port.state()),
        unmark(!healthy), 1e-7 * static_cast<double>(watch.busy_ns() - before.busy_ns) / seconds,
        static_cast<double>(watch.frames() - before.frames) / seconds,
        number(port.counters().error_frames), number(watch.malformed()), number(strangers),
        number(port.counters().overruns));
    before.frames = watch.frames();
    before.busy_ns = watch.busy_ns();
    for (std::size_t i = 0; i < bus.drives.size(); ++i) show_drive(b, i, seconds);
  }

  void show_drive(std::size_t b, std::size_t i, double seconds) {
    const WatchedDrive& drive = listener_.watch(b).drive(i);
    Before& before = before_[b];
    const std::uint64_t commands = drive.commands - before.commands[i];
    const std::uint64_t replies = drive.replies - before.replies[i];
    const std::uint64_t missing = commands > replies ? commands - replies : 0;
    before.commands[i] = drive.commands;
    before.replies[i] = drive.replies;
    std::printf("  %-12s", listener_.watch(b).bus().drives[i].name.c_str());
    if (drive.last_reply_ns == 0) {
      std::printf(" %snever heard%s\n", mark(commands > 0), unmark(commands > 0));
      return;
    }
    const double age = 1e-6 * static_cast<double>(listener_.now() - drive.last_reply_ns);
    const bool old = age > 100.0;
    std::printf(
        " %6.0f replies/s  missing %s%llu%s  age %s%.1f ms%s  q %8.4f rad  tau %7.2f N m  %s\n",
        static_cast<double>(replies) / seconds, mark(missing > 0), number(missing),
        unmark(missing > 0), mark(old), age, unmark(old), drive.q, drive.tau, drive.state.c_str());
  }

  [[nodiscard]] const char* mark(bool bad) const { return bad && color_ ? "\033[1;31m" : ""; }
  [[nodiscard]] const char* unmark(bool bad) const { return bad && color_ ? "\033[0m" : ""; }
  static unsigned long long number(std::uint64_t value) { return value; }

  BusListener& listener_;
  bool plain_;
  bool color_;
  std::vector<Before> before_;
};

void monitor(const MonitorOptions& options) {
  const BusMap map = load_bus_map(find_file(options.map), load_robot(options.robot));
  BusListener listener(map);
  const StopGuard guard;
  Screen screen(listener, options.plain || isatty(STDOUT_FILENO) != 1);
  const std::int64_t start = listener.now();
  std::int64_t last = start;
  while (!guard.flag()->load()) {
    const auto seconds = [&](double s) { return static_cast<std::int64_t>(1e9 * s); };
    std::int64_t until = last + seconds(options.interval);
    if (options.duration) until = std::min(until, start + seconds(*options.duration));
    listener.listen(until, guard.flag());
    const std::int64_t now = listener.now();
    screen.show(1e-9 * static_cast<double>(std::max<std::int64_t>(1, now - last)));
    last = now;
    if (options.duration && now - start >= seconds(*options.duration)) return;
  }
}

}  // namespace

bool use_color() {
  const char* off = std::getenv("NO_COLOR");
  return isatty(STDOUT_FILENO) == 1 && (off == nullptr || *off == '\0');
}

void add_bus_scan(CLI::App& bus) {
  auto options = std::make_shared<ScanOptions>();
  CLI::App* command = bus.add_subcommand("scan", "Which drives of a bus map answer; moves nothing");
  command->add_option("config", options->map, "bus map")->required();
  add_robot_options(*command, options->robot);
  command->footer(
      "Listens first. Where nobody commands the drives it asks: drives of mit with \"disable\", "
      "which\n"
      "after their watchdog they are anyway; CANopen nodes 1 to 127 for their device type "
      "(1000h).\n"
      "Torque is never switched on. Exit code 1: a drive of the map does not answer.\n\n"
      "Example:\n"
      "  clamber bus scan configs/hal/coman_mit.yaml");
  command->callback([options] { scan(*options); });
}

void add_bus_monitor(CLI::App& bus) {
  auto options = std::make_shared<MonitorOptions>();
  CLI::App* command =
      bus.add_subcommand("monitor", "Live load, errors, ages and missing replies; only listens");
  command->add_option("config", options->map, "bus map")->required();
  command->add_option("--interval", options->interval, "s between two looks")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--duration", options->duration, "s, then it ends")
      ->check(CLI::PositiveNumber);
  command->add_flag("--plain", options->plain, "one look below the other, also on a terminal");
  add_robot_options(*command, options->robot);
  command->footer(
      "Sends nothing. Load: bits of the frames that passed, stuff bits included, at the map's bit\n"
      "rates. Missing: commands that were not answered since the last look. Colour only on a\n"
      "terminal (and not with NO_COLOR).\n\n"
      "Example:\n"
      "  clamber bus monitor configs/hal/coman_mit.yaml --duration 10");
  command->callback([options] { monitor(*options); });
}

}  // namespace clamber
