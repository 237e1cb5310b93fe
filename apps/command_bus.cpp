// clamber bus: what a CAN bus carries, planned and recorded.
#include <cstdio>
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "apps/options.hpp"
#include "firmware_hal/bus_model/bus_budget.hpp"

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

}  // namespace

void add_bus_command(CLI::App& app) {
  CLI::App* bus = app.add_subcommand("bus", "Looks at CAN buses: planned load, recorded frames");
  bus->require_subcommand(1);
  add_budget(*bus);
}

}  // namespace clamber
