// clamber service: what the robot's computer runs from the slot in use, under a service manager.
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/drive_watch.hpp"
#include "apps/job_failed.hpp"
#include "apps/run_support.hpp"
#include "apps/service_monitor.hpp"
#include "apps/service_settings.hpp"
#include "apps/steps.hpp"
#include "deploy/slots.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kKeptLogs = 10;

struct Options {
  std::string slot;
  std::string operator_socket;
  std::string health;
  std::string logs;
  bool check = false;
  bool unpaced = false;
  bool dds = true;
};

/// A folder that the service manager has made, named by a variable of systemd.exec(5).
std::string managed(const char* variable, const std::string& otherwise) {
  const char* folder = std::getenv(variable);
  return folder != nullptr && *folder != '\0' ? folder : otherwise;
}

fs::path slot_of(const Options& options) {
  if (!options.slot.empty()) return fs::canonical(options.slot);
  return fs::canonical("/proc/self/exe").parent_path().parent_path();
}

/// The name of a new log; of the older ones the last are kept.
std::string next_log(const fs::path& folder) {
  std::vector<fs::path> logs;
  std::error_code error;
  fs::create_directories(folder, error);
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (entry.path().extension() == ".log") logs.push_back(entry.path());
  std::sort(logs.begin(), logs.end());
  for (std::size_t i = 0; i + kKeptLogs <= logs.size(); ++i) fs::remove(logs[i], error);
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char name[64];
  std::strftime(name, sizeof name, "run-%Y%m%dT%H%M%SZ.log", &utc);
  return (folder / name).string();
}

/// What is known before the run: which bundle this is.
ServiceHealth first_health(const fs::path& slot, const RobotModel& robot) {
  ServiceHealth health;
  if (const std::optional<SlotContent> content = read_slot(slot)) {
    health.bundle = content->id;
    std::cout << "bundle:      " << content->manifest.name() << '\n';
  }
  health.process = getpid();
  health.joints = static_cast<int>(robot.joints.size());
  health.drives.heard = health.joints;
  return health;
}

/// nullptr: there are none that could be asked. In lock step drives answer a host that keeps it,
/// not a question.
std::unique_ptr<DriveWatch> watch_drives(const Options& options, const ServiceSettings& settings,
                                         const RobotModel& robot) {
  std::optional<BusMap> map = load_drives(settings.hal, robot);
  if (!map || options.unpaced) return nullptr;
  auto drives = std::make_unique<DriveWatch>(std::move(*map));
  const DriveHealth seen = drives->seen();
  std::cout << "drives:      " << seen.heard << " of " << robot.joints.size() << " are well"
            << (seen.trouble.empty() ? "" : "; " + seen.trouble) << '\n'
            << std::flush;
  return drives;
}

void serve(const Options& options, const fs::path& slot) {
  const StopGuard guard;  // what became of a run is told even if it was told to stop at its end
  const ServiceSettings settings = load_service_settings(slot);
  RobotOptions robot_options{.robot = settings.robot};
  const RobotModel robot = load_robot(robot_options);
  const FoundScenario made_for = scenario_of_plan(settings.plan, slot / "configs");
  const ServiceHealth health = first_health(slot, robot);
  const std::unique_ptr<DriveWatch> drives = watch_drives(options, settings, robot);
  const fs::path run_folder = managed("RUNTIME_DIRECTORY", "/run/clamber");

  ExecutionOptions execution;
  execution.control = settings.control;
  execution.hal = settings.hal;
  execution.runtime = settings.runtime;
  execution.realtime = execution.lock_step = false;
  execution.dds = options.dds;
  execution.operator_socket = options.operator_socket.empty()
                                  ? (run_folder / "operator.sock").string()
                                  : options.operator_socket;
  const fs::path health_file =
      options.health.empty() ? run_folder / "health.json" : fs::path(options.health);
  execution.companion = [&](const RunPulse& pulse, const RunTelemetry* telemetry) {
    ServiceMonitor::Sources sources{&pulse, {}, {}};
    if (telemetry != nullptr) sources.publisher = [telemetry] { return telemetry->rounds(); };
    if (drives) sources.drives = [&] { return drives->seen(); };
    return std::make_shared<ServiceMonitor>(std::move(sources), health, health_file);
  };
  if (drives) execution.before_enable = [&] { drives->fall_silent(); };
  const std::string log =
      next_log(options.logs.empty() ? managed("LOGS_DIRECTORY", "/var/log/clamber") : options.logs);

  std::string failure;
  if (read_backend(settings.hal) == Backend::kSocketCan) {
    execution.lock_step = options.unpaced;
    const BusRun result =
        run_plan_on_buses(robot_options, robot, made_for.scenario, settings.plan, execution, log);
    std::cout << describe(result, robot);
    if (!result.execution.stopped) failure = result.failure(robot);
  } else {
    execution.realtime = !options.unpaced;
    const SimulatedRun result =
        run_plan(robot_options, robot, made_for.scenario, settings.plan, execution, log);
    std::cout << describe(result, robot);
    if (!result.execution.stopped) failure = result.failure(robot);
  }
  std::cout << "written:     " << log << '\n';
  if (!failure.empty()) throw JobFailed("the run failed: " + failure);
}

void run(const Options& options) {
  const fs::path slot = slot_of(options);
  // Its settings name each other as seen from here, and nothing of the tree it was built in.
  fs::current_path(slot);
  setenv("CLAMBER_CONFIGS", (slot / "configs").c_str(), 1);
  if (!options.check) return serve(options, slot);
  for (const std::string& line : check_slot(slot)) std::cout << "usable: " << line << '\n';
}

}  // namespace

void add_service_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("service", "Runs a slot's plan for an operator, under a service manager");
  command->add_option("slot", options->slot,
                      "folder with service.yaml (the one this program is in)");
  command->add_flag("--check", options->check, "only whether everything in the slot can be used");
  command->add_option("--operator", options->operator_socket,
                      "socket for `clamber arm` and the like ($RUNTIME_DIRECTORY/operator.sock)");
  command->add_option("--health", options->health,
                      "file that says how it is ($RUNTIME_DIRECTORY/health.json)");
  command->add_option("--logs", options->logs, "folder for the last ten logs ($LOGS_DIRECTORY)");
  command->add_flag("--unpaced", options->unpaced,
                    "not by the clock: virtual drives in lock step, or the simulation at its best");
  command->add_flag("--dds,!--no-dds", options->dds, "telemetry over DDS (on)");
  command->footer(
      "It waits with the drives off until `clamber arm`; when the plan has been executed it ends,\n"
      "and the service manager starts it again. READY=1 and WATCHDOG=1 go to $NOTIFY_SOCKET as\n"
      "long as control loop, joint states and telemetry go on (docs/deploy.md).\n"
      "Exit codes: 0 the plan was executed, or the service was told to stop; 1 the run failed;\n"
      "2 unusable input.\n\n"
      "Example:\n"
      "  clamber service /opt/clamber/current --check");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
