// clamber drives: simulated drives on the CAN interfaces of a bus map, with the simulated robot
// behind them.
#include <sys/prctl.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "apps/options.hpp"
#include "apps/rehearsal.hpp"
#include "apps/run_support.hpp"
#include "firmware_hal/socketcan/open_ports.hpp"
#include "firmware_hal/virtual_drives/drive_server.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kLookAround = 100'000'000;  // ns between two looks at the stop flag

volatile std::sig_atomic_t fault_asked = 0;

struct Options {
  std::string map;
  std::string report;
  bool lock_step = false;
  bool real_time = false;
  double patience = 0.5;
  double give_up = 5.0;
  std::string fault;
  RobotOptions robot;
  ScenarioOptions scenario;
};

class Drives {
 public:
  explicit Drives(const Options& options)
      : options_(options),
        model_(load_robot(options.robot)),
        scenario_(load_scenario(options.scenario)),
        map_(load_bus_map(find_file(options.map), model_)),
        world_(model_, scenario_, 1.0 / map_.rate),
        drives_(map_, world_.plant()),
        ports_(open_ports(map_)) {
    std::vector<FramePort*> ports;
    for (const auto& port : ports_.ports) ports.push_back(port.get());
    DriveServerSettings settings;
    settings.lock_step = !options.real_time;
    settings.period_ns = static_cast<std::int64_t>(1e9 / map_.rate);
    settings.host_patience = static_cast<std::int64_t>(1e9 * options.patience);
    server_ = std::make_unique<DriveServer>(drives_, *ports_.clock, ports, settings);
    if (!options_.fault.empty()) (void)faulty_drive();
  }

  void run() {
    const StopGuard stop;
    if (!options_.fault.empty()) std::signal(SIGUSR1, [](int) { fault_asked = 1; });
    if (options_.real_time)
      (void)prctl(PR_SET_TIMERSLACK, 1UL);  // else every wait may end 50 us late
    else
      (void)stay_on_this_processor();
    introduce();
    server_->boot();
    std::int64_t next_line = ports_.clock->now_ns() + kSecond;
    std::int64_t heard = ports_.clock->now_ns();
    while (!stop.flag()->load() && drives_.finished_runs() == 0) {
      const std::int64_t now = ports_.clock->now_ns();
      if (fault_asked != 0) break_down();
      if (server_->serve(now + kLookAround)) world_.look();
      if (!server_->host_silent() || !drives_.released()) heard = now;
      if (now - heard > static_cast<std::int64_t>(1e9 * options_.give_up)) {
        host_gone_ = true;
        break;
      }
      if (now < next_line) continue;
      next_line = now + kSecond;
      if (isatty(STDOUT_FILENO) == 1) print_line();
    }
    finish();
  }

 private:
  [[nodiscard]] PlacedDrive& faulty_drive() {
    for (std::size_t b = 0; b < drives_.bus_count(); ++b)
      for (PlacedDrive& placed : drives_.bus(b))
        if (placed.name == options_.fault) return placed;
    throw InputError("--fault " + options_.fault + ": " + map_.file + " has no such joint");
  }

  void break_down() {
    fault_asked = 0;
    faulty_drive().drive->break_down(0);
    std::cout << "fault:       " << options_.fault << " has broken down\n" << std::flush;
  }

  void introduce() const {
    for (const Bus& bus : map_.buses) {
      std::cout << bus.interface << "  " << bus.name << " (" << to_string(bus.protocol) << "):";
      for (const JointDrive& drive : bus.drives)
        std::cout << ' ' << drive.name << '=' << drive.node;
      std::cout << '\n';
    }
    std::cout << "behind them: " << model_.name << " in front of '" << scenario_.name << "', "
              << (options_.real_time ? "in real time" : "in lock step with the host")
              << "; held by a stand until all drives are on\n"
              << std::flush;
  }

  void print_line() const {
    const HottestDrive hot = hottest(drives_);
    const char* state = server_->host_silent() ? "host silent"
                        : drives_.released()   ? "running"
                                               : "on the stand";
    std::printf("\r%8.2f s  %-12s  hottest %5.1f C (%s)   ", world_.time(), state, hot.temperature,
                hot.joint.c_str());
    std::fflush(stdout);
  }

  [[nodiscard]] Json report(const ClimbVerdict& verdict) const {
    Json report;
    report["success"] = verdict.success;
    report["reason"] = verdict.success ? "" : describe(verdict);
    report["bus_map"] = options_.map;
    report["scenario"] = scenario_.name;
    report["mode"] = options_.real_time ? "real-time" : "lock-step";
    report["simulated_time"] = world_.time();
    report["ticks"] = drives_.steps();
    report["skipped_ticks"] = server_->skipped();
    report["ended_by"] = drives_.finished_runs() > 0 ? "host switched off"
                         : host_gone_                ? "host gone"
                                                     : "signal";
    report["verdict"] = to_json(verdict);
    Json buses = Json::array();
    for (std::size_t i = 0; i < map_.buses.size(); ++i)
      buses.push_back({{"name", map_.buses[i].name},
                       {"interface", map_.buses[i].interface},
                       {"received", server_->bus(i).received},
                       {"sent", server_->bus(i).sent},
                       {"lost", server_->bus(i).lost}});
    report["buses"] = buses;
    report["drives"] = to_json(map_, drives_);
    return report;
  }

  void finish() const {
    if (isatty(STDOUT_FILENO) == 1) std::cout << '\n';
    const ClimbVerdict verdict = world_.verdict();
    const HottestDrive hot = hottest(drives_);
    if (!options_.report.empty()) write_text(options_.report, report(verdict).dump(2) + "\n");
    std::printf("simulated:   %.2f s, hottest drive %.1f C (%s)\n", world_.time(), hot.temperature,
                hot.joint.c_str());
    std::printf("judge:       %s\n",
                verdict.success ? "success" : ("failure: " + describe(verdict)).c_str());
    std::fflush(stdout);
    if (!verdict.success)
      throw JobFailed("the robot did not climb: " + std::string(host_gone_ ? "host gone; " : "") +
                      describe(verdict));
  }

  const Options& options_;
  RobotModel model_;
  Scenario scenario_;
  BusMap map_;
  RehearsalWorld world_;
  VirtualDrives drives_;
  SocketCanPorts ports_;
  std::unique_ptr<DriveServer> server_;
  bool host_gone_ = false;
};

}  // namespace

void add_drives_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "drives", "Simulates the drives of a bus map, and the robot behind them, on CAN interfaces");
  command->add_option("config", options->map, "bus map")->required();
  auto* lock_step =
      command->add_flag("--lock-step", options->lock_step,
                        "a tick passes when the host has sent all of it (the default)");
  command->add_flag("--real-time", options->real_time, "ticks pass by the clock")
      ->excludes(lock_step);
  command->add_option("--report", options->report, "JSON file");
  command
      ->add_option("--patience", options->patience,
                   "s without a frame: the host is gone and time passes without it")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      ->add_option("--give-up", options->give_up,
                   "s that a robot off its stand is simulated without its host")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--fault", options->fault,
                      "joint whose drive finds an over-current and lets go, on SIGUSR1");
  add_robot_options(*command, options->robot);
  add_scenario_options(*command, options->scenario);
  command->footer(
      "The robot is held until all drives are on. When the host has switched all of them off, on\n"
      "SIGINT and SIGTERM, the judge looks at the simulated contacts. Exit code 0: the robot is "
      "on\n"
      "top; 1: it is not; 2: the map or an interface is unusable. See docs/virtual-drives.md.\n\n"
      "Example (vcan interfaces can0 to can4, two terminals):\n"
      "  clamber drives configs/hal/coman_mit.yaml --report drives.json\n"
      "  clamber run plan.json --hal-config configs/hal/coman_mit.yaml --lock-step");
  command->callback([options] { Drives(*options).run(); });
}

}  // namespace clamber
