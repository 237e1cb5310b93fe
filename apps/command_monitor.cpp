// clamber monitor: torques against limits, over DDS.
#include <sys/ioctl.h>
#include <unistd.h>

#include <cmath>
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "robot_model/loader.hpp"
#include "telemetry/monitor.hpp"

namespace clamber {
namespace {

struct Options {
  std::string robot = "coman";
  std::optional<int> domain;
  std::vector<std::string> interfaces;
  bool plain = false;
  std::optional<double> duration;
  double timeout = 10.0;
};

void run(const Options& options) {
  MonitorOptions monitor;
  monitor.telemetry.robot = options.robot;
  monitor.telemetry = with_environment(monitor.telemetry);
  if (options.domain) monitor.telemetry.domain = *options.domain;
  if (!options.interfaces.empty()) monitor.telemetry.interfaces = options.interfaces;
  winsize size{};
  const bool terminal = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_row > 0;
  monitor.plain = options.plain || !terminal;
  if (terminal) monitor.rows = size.ws_row;
  monitor.duration = options.duration;
  monitor.timeout = options.timeout;
  if (run_monitor(monitor, std::cout) != 0)
    throw JobFailed("no telemetry of robot '" + options.robot + "' on DDS domain " +
                    std::to_string(monitor.telemetry.domain));
}

}  // namespace

void add_monitor_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "monitor", "Shows the joint torques of a run against their limits, from another process");
  command->add_option("--name", options->robot, "the robot's name")->capture_default_str();
  command->add_option("--domain", options->domain,
                      "DDS domain (else $CLAMBER_DDS_DOMAIN, $ROS_DOMAIN_ID, 0)");
  command->add_option("--interface", options->interfaces,
                      "network interface or its address (else $CLAMBER_DDS_INTERFACES, 127.0.0.1)");
  command->add_flag("--plain", options->plain, "a line a second instead of the dashboard");
  command->add_option("--duration", options->duration, "s after the first frame (else for ever)")
      ->check(CLI::PositiveNumber);
  command->add_option("--timeout", options->timeout, "s to wait for the first frame")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->footer(
      "Start it before the run. Exit code 1: no frame came within the timeout.\n\n"
      "Example:\n"
      "  clamber monitor --plain &\n"
      "  clamber run out/climb/plan.json --realtime");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
