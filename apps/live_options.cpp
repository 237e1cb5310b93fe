#include "apps/live_options.hpp"

#include "apps/run_support.hpp"

namespace clamber {

void add_live_options(CLI::App& command, LiveOptions& options) {
  command.add_option("--name", options.name, "the robot's name on DDS")->capture_default_str();
  command.add_option("--domain", options.domain,
                     "DDS domain (else $CLAMBER_DDS_DOMAIN, $ROS_DOMAIN_ID, 0)");
  command.add_option("--interface", options.interfaces,
                     "network interface or its address (else $CLAMBER_DDS_INTERFACES, 127.0.0.1)");
  add_robot_options(command, options.robot);
  add_scenario_options(command, options.scenario);
}

TelemetryConfig telemetry_config(const LiveOptions& options) {
  TelemetryConfig config;
  config.robot = options.name;
  config = with_environment(config);
  if (options.domain) config.domain = *options.domain;
  if (!options.interfaces.empty()) config.interfaces = options.interfaces;
  return config;
}

bool is_of(const TelemetryDescription& published, const RobotModel& model) {
  const TelemetryDescription expected = description_of(model);
  return published.joint_names == expected.joint_names &&
         published.contact_names == expected.contact_names;
}

}  // namespace clamber
