// clamber bus: what a CAN bus carries, planned and recorded.
#include <algorithm>
#include <array>
#include <cstdio>
#include <iostream>
#include <memory>

#include "apps/bus_live.hpp"
#include "apps/commands.hpp"
#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "apps/options.hpp"
#include "firmware_hal/bus_model/bus_budget.hpp"
#include "firmware_hal/candump.hpp"
#include "firmware_hal/frame_text.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

struct BudgetOptions {
  std::string map = "configs/hal/coman_mit.yaml";
  RobotOptions robot;
  bool frames = false;
};

void print_frames(const BusBudget& budget) {
  std::printf("\n%s\n  id     bytes  bits  us at worst  received after  frame\n",
              budget.bus.c_str());
  for (const FrameBudget& f : budget.frames)
    std::printf("  0x%03x  %5zu  %4u  %11.1f  %11.1f us  %s\n", f.frame.id, f.frame.length,
                f.worst.total(), 1e6 * f.duration, 1e6 * f.response, f.frame.name.c_str());
}

void budget(const BudgetOptions& options) {
  const RobotModel robot = load_robot(options.robot);
  const BusMap map = load_bus_map(find_file(options.map), robot);
  const std::vector<BusBudget> budgets = bus_budgets(map);
  std::printf("%-16s %-10s %-18s %6s %6s %8s %15s\n", "bus", "interface", "format", "joints",
              "frames", "load", "last frame");
  const BusBudget* worst = nullptr;
  for (const BusBudget& b : budgets) {
    std::printf("%-16s %-10s %-18s %6zu %6zu %6.1f %% %6.0f of %4.0f us%s\n", b.bus.c_str(),
                b.interface.c_str(), b.format.c_str(), b.joints, b.frames.size(), 100.0 * b.load,
                1e6 * b.response, 1e6 / map.rate, b.fits ? "" : "  does not fit");
    if (!b.fits && (worst == nullptr || b.load > worst->load)) worst = &b;
  }
  if (options.frames)
    for (const BusBudget& b : budgets) print_frames(b);
  if (worst != nullptr) throw JobFailed(explain_refusal(map, *worst));
}

void add_budget(CLI::App& bus) {
  auto options = std::make_shared<BudgetOptions>();
  CLI::App* command =
      bus.add_subcommand("budget", "Does a bus map fit? Worst-case load and response times");
  command->add_option("config", options->map, "bus map")->capture_default_str();
  command->add_flag("--frames", options->frames, "every frame with its id, bits and times");
  add_robot_options(*command, options->robot);
  command->footer(
      "Worst case: every id and payload stuffed as badly as can be, no errors on the bus.\n"
      "`last frame` is when the last reply of a tick has been received, counted from its start.\n"
      "Exit code 1: a bus is over the map's max_load (80 % unless it says otherwise) or a frame\n"
      "is late; 2: the map itself is unusable. A run with a map that does not fit is refused.\n\n"
      "Example:\n"
      "  clamber bus budget configs/hal/coman_mit.yaml --frames");
  command->callback([options] { budget(*options); });
}

struct DecodeOptions {
  std::string log;
  std::string map = "configs/hal/coman_mit.yaml";
  std::string bus;
  bool canopen = false;
  RobotOptions robot;
};

/// What of a log could not be used: named up to a limit, counted always.
class Complaints {
 public:
  explicit Complaints(std::string file) : file_(std::move(file)) {}
  void add(std::size_t line, const std::string& what) {
    constexpr std::size_t kNamed = 20;
    if (++count_ > kNamed) return;
    std::fflush(stdout);
    std::cerr << file_ << ':' << line << ": " << what << '\n';
    if (count_ == kNamed) std::cerr << file_ << ": further lines of this kind are only counted\n";
  }
  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  std::string file_;
  std::size_t count_ = 0;
};

const char* color_of(FrameKind kind) {
  switch (kind) {
    case FrameKind::kData:
      return "";
    case FrameKind::kSwitching:
      return "\033[33m";
    case FrameKind::kTrouble:
      return "\033[1;31m";
    case FrameKind::kForeign:
      return "\033[2m";
    case FrameKind::kMalformed:
      return "\033[31m";
  }
  return "";
}

class LogDecoder {
 public:
  LogDecoder(const DecodeOptions& options, const BusMap& map)
      : options_(options), map_(map), color_(use_color()) {}

  void decode() {
    const std::string text = read_file(options_.log);
    Complaints complaints(options_.log);
    std::size_t number = 0;
    for (std::size_t at = 0; at < text.size(); ++number) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      const std::string_view line = std::string_view(text).substr(at, end - at);
      at = end + 1;
      if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
      CandumpLine parsed;
      if (const char* error = parse_candump(line, parsed))
        complaints.add(number + 1, error);
      else
        print(parsed);
    }
    summarise(complaints.count());
  }

 private:
  [[nodiscard]] FrameText describe(const CandumpLine& line) const {
    if (options_.canopen) return describe_canopen(line.frame);
    for (const Bus& bus : map_.buses)
      if (options_.bus.empty() ? bus.interface == line.interface : bus.name == options_.bus)
        return describe_frame(bus, line.frame);
    return {FrameKind::kForeign, "interface is not in the bus map"};
  }

  void print(const CandumpLine& line) {
    const FrameText text = describe(line);
    ++frames_[static_cast<std::size_t>(text.kind)];
    const char* mark = text.kind == FrameKind::kMalformed ? "MALFORMED " : "";
    const char* color = color_ ? color_of(text.kind) : "";
    std::printf(
        "%lld.%06lld %-6.*s %-16s %s%s%s%s\n", static_cast<long long>(line.time_us / 1'000'000),
        static_cast<long long>(line.time_us % 1'000'000), static_cast<int>(line.interface.size()),
        line.interface.data(), frame_label(line.frame).c_str(), color, mark, text.text.c_str(),
        *color != '\0' ? "\033[0m" : "");
  }

  void summarise(std::size_t unreadable) const {
    std::size_t all = 0;
    for (const std::size_t n : frames_) all += n;
    if (all == 0)
      throw InputError(options_.log +
                       ": no line of candump's log format (make one with `candump -l can0`)");
    std::fflush(stdout);
    std::cerr << all << " frames: " << frames_[0] << " data, " << frames_[1] << " switching, "
              << frames_[2] << " trouble, " << frames_[3] << " foreign, " << frames_[4]
              << " malformed; " << unreadable << " unreadable lines\n";
    if (unreadable > 0)
      throw JobFailed(options_.log + ": " + std::to_string(unreadable) +
                      " of its lines are not candump's log format");
  }

  const DecodeOptions& options_;
  const BusMap& map_;
  bool color_;
  std::array<std::size_t, 5> frames_{};
};

void decode(const DecodeOptions& options) {
  BusMap map;
  if (!options.canopen) {
    map = load_bus_map(find_file(options.map), load_robot(options.robot));
    const auto named = [&](const Bus& bus) { return bus.name == options.bus; };
    if (!options.bus.empty() && std::none_of(map.buses.begin(), map.buses.end(), named))
      throw InputError(map.file + ": no bus '" + options.bus + "' (--bus)");
  }
  LogDecoder(options, map).decode();
}

void add_decode(CLI::App& bus) {
  auto options = std::make_shared<DecodeOptions>();
  CLI::App* command = bus.add_subcommand("decode", "A candump log as lines for people");
  command->add_option("log", options->log, "written by `candump -l`")->required();
  command->add_option("--config", options->map, "bus map: which interface speaks what")
      ->capture_default_str();
  command->add_option("--bus", options->bus,
                      "take every line for this bus of the map, whatever its interface");
  command->add_flag("--canopen", options->canopen, "no map: CANopen with node ids and raw objects");
  add_robot_options(*command, options->robot);
  command->footer(
      "Colour only on a terminal (and not with NO_COLOR). Lines that are no frames are named on\n"
      "the error output and counted; exit code 1 if there were any, 2 if there was nothing "
      "else.\n\n"
      "Example:\n"
      "  clamber bus decode candump.log --config configs/hal/coman_mit.yaml --bus right_leg");
  command->callback([options] { decode(*options); });
}

}  // namespace

void add_bus_command(CLI::App& app) {
  CLI::App* bus = app.add_subcommand(
      "bus", "Looks at CAN buses: planned load, who answers, live traffic, recorded frames");
  bus->require_subcommand(1);
  add_budget(*bus);
  add_bus_scan(*bus);
  add_bus_monitor(*bus);
  add_decode(*bus);
}

}  // namespace clamber
