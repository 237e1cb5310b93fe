// clamber monitor: torques against limits, over DDS.
#include <sys/ioctl.h>
#include <unistd.h>

#include <cmath>
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "apps/run_support.hpp"
#include "robot_model/loader.hpp"
#include "telemetry/monitor.hpp"
#include "telemetry/publisher_process.hpp"

namespace clamber {
namespace {

struct Options {
  std::string robot = "coman";
  std::optional<int> domain;
  std::vector<std::string> interfaces;
  std::optional<std::string> security;
  bool plain = false;
  bool once = false;
  std::optional<double> duration;
  double timeout = 10.0;
  std::vector<std::string> checks;
};

void run(const Options& options) {
  MonitorOptions monitor;
  monitor.telemetry.robot = options.robot;
  monitor.telemetry = with_environment(monitor.telemetry);
  if (options.domain) monitor.telemetry.domain = *options.domain;
  if (!options.interfaces.empty()) monitor.telemetry.interfaces = options.interfaces;
  if (options.security) monitor.telemetry.security = *options.security;
  winsize size{};
  const bool terminal = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_row > 0;
  monitor.plain = options.plain || !terminal;
  if (terminal) monitor.rows = size.ws_row;
  monitor.duration = options.duration;
  monitor.end_of_run = options.once;
  monitor.timeout = options.timeout;
  monitor.checks = options.checks;
  switch (run_monitor(monitor, std::cout)) {
    case MonitorOutcome::kFine:
      return;
    case MonitorOutcome::kNothingCame:
      throw JobFailed("no telemetry of robot '" + options.robot + "' on DDS domain " +
                      std::to_string(monitor.telemetry.domain));
    case MonitorOutcome::kCheckFailed:
      throw JobFailed("a check failed");
  }
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
  command->add_option("--security", options->security,
                      "folder with a subscriber's credentials (else $CLAMBER_DDS_SECURITY, none)");
  command->add_flag("--plain", options->plain, "a line a second instead of the dashboard");
  command->add_flag("--once", options->once, "end with the run");
  command->add_option("--duration", options->duration, "s after the first frame (else for ever)")
      ->check(CLI::PositiveNumber);
  command->add_option("--timeout", options->timeout, "s to wait for the first frame")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--check", options->checks,
                   "assertion that every frame is held to; may be given several times")
      ->allow_extra_args(false);
  command->footer(
      "Start it before the run. A check is STATISTIC(QUANTITY) COMPARISON NUMBER:\n"
      "  statistic   max min mean rms last\n"
      "  quantity    of joints: tau tau_cmd margin temperature age error dq, of one: tau[LElbj];\n"
      "              of the run: lateness tick_time (us) lost drops fault; |tau| is its magnitude\n"
      "With checks it ends with the run, or after --duration, and judges: each check must hold "
      "for\n"
      "every joint. Exit code 1: a check failed (the value and the joint are printed) or no frame\n"
      "came within the timeout; 2: a check is not understood (the column is named).\n\n"
      "Examples:\n"
      "  clamber monitor --plain &\n"
      "  clamber run out/climb/plan.json --realtime\n"
      "  clamber monitor --check 'max(|tau|) < 30' --check 'last(lost) == 0' --check "
      "'min(margin[LElbj]) > 0.1'");
  command->callback([options] { run(*options); });
}

void add_telemetry_publisher_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand(kPublisherCommand, "Publishes what the run that started it hands over");
  command->group("");  // not in the list: people do not start it
  command->callback([] { run_publisher_process(); });
}

}  // namespace clamber
