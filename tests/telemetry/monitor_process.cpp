// Runs the monitor in a process of its own for the tests: domain, seconds, timeout, then
// credentials or "", then checks.
#include <cstdlib>
#include <iostream>

#include "telemetry/monitor.hpp"

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  clamber::MonitorOptions options;
  options.telemetry.domain = std::atoi(argv[1]);
  options.telemetry.robot = "test_robot";
  options.plain = true;
  options.duration = std::atof(argv[2]);
  options.timeout = std::atof(argv[3]);
  if (argc > 4) options.telemetry.security = argv[4];
  for (int i = 5; i < argc; ++i) options.checks.emplace_back(argv[i]);
  return static_cast<int>(clamber::run_monitor(options, std::cout));
}
