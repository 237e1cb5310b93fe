#include "apps/controller_config.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

enum class TorqueLimit : std::uint8_t { kPlan, kDrive };

void read_positive(const YamlNode& node, const char* key, double& value) {
  if (const auto found = node.find(key)) value = found->positive();
}

void read_non_negative(const YamlNode& node, const char* key, double& value) {
  if (const auto found = node.find(key)) value = found->non_negative();
}

/// `off`: never.
void read_limit(const YamlNode& node, const char* key, double& value) {
  if (const auto found = node.find(key))
    value = found->text() == "off" ? ControllerConfig::kNever : found->positive();
}

void read_ticks(const YamlNode& node, const char* key, std::uint32_t& value) {
  const auto found = node.find(key);
  if (!found) return;
  const double ticks = found->non_negative();
  if (ticks != std::floor(ticks) || ticks > 1e6) found->fail("expected a number of ticks");
  value = static_cast<std::uint32_t>(ticks);
}

/// True for the first, false for the second of two words.
bool read_choice(const YamlNode& node, const std::string& yes, const std::string& no) {
  const std::string word = node.text();
  if (word != yes && word != no) node.fail("expected " + yes + " or " + no + ", found " + word);
  return word == yes;
}

void read_start(const YamlNode& node, ControllerConfig& config) {
  node.allow_only({"time", "speed", "distance_limit"});
  read_positive(node, "time", config.start_time);
  read_positive(node, "speed", config.start_speed);
  read_positive(node, "distance_limit", config.start_distance_limit);
}

void read_failure_policy(const YamlNode& root, ControllerConfig& config) {
  const auto node = root.find("failure_policy");
  if (!node) return;
  const auto policy = failure_policy_named(node->text());
  if (!policy) node->fail("expected hold, lower or limp, found " + node->text());
  config.failure_policy = *policy;
}

void read_supervision(const YamlNode& root, ControllerConfig& config) {
  read_limit(root, "tracking_error_limit", config.tracking_error_limit);
  read_ticks(root, "stale_ticks_limit", config.stale_ticks_limit);
  read_ticks(root, "watchdog_ticks", config.watchdog_ticks);
  read_positive(root, "jump_limit", config.jump_limit);
  read_positive(root, "frozen_limit", config.frozen_limit);
  read_limit(root, "saturation_time", config.saturation_time);
  if (const auto node = root.find("overspeed")) {
    node->allow_only({"factor", "time"});
    read_limit(*node, "factor", config.overspeed_factor);
    read_positive(*node, "time", config.overspeed_time);
  }
  read_limit(root, "limit_margin", config.limit_margin);
  read_limit(root, "temperature_limit", config.temperature_limit);
  read_failure_policy(root, config);
  if (const auto node = root.find("lowering")) {
    node->allow_only({"time", "damping"});
    read_positive(*node, "time", config.lowering_time);
    read_non_negative(*node, "damping", config.lowering_damping);
  }
  read_positive(root, "pause_time", config.pause_time);
  read_positive(root, "overshoot_limit", config.overshoot_limit);
  read_positive(root, "velocity_factor", config.velocity_factor);
  read_limit(root, "acceleration_limit", config.acceleration_limit);
  read_limit(root, "jerk_limit", config.jerk_limit);
}

void read_gain_group(const YamlNode& group, const RobotModel& robot, ControllerConfig& config) {
  group.allow_only({"joints", "kp", "ki", "kd"});
  for (const std::string& pattern : group.at("joints").texts()) {
    bool found = false;
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      if (!matches(pattern, robot.joints[j].name)) continue;
      found = true;
      PidGains& gains = config.joints[j].gains;
      read_non_negative(group, "kp", gains.kp);
      read_non_negative(group, "ki", gains.ki);
      read_non_negative(group, "kd", gains.kd);
    }
    if (!found)
      group.at("joints").fail("'" + pattern + "' matches no joint of robot " + robot.name);
  }
}

void read_gains(const YamlNode& root, const RobotModel& robot, ControllerConfig& config) {
  for (const char* key : {"gains", "feed_forward_gains"}) {
    const auto gains = root.find(key);
    if (!gains) continue;
    // Checked even where it does not count: a mistake must not wait for the other mode.
    ControllerConfig read = config;
    for (const YamlNode& group : gains->items()) read_gain_group(group, robot, read);
    if (std::string_view(key) == "gains" || config.feed_forward == FeedForward::kPlan)
      config = read;
  }
}

void take_from_robot(const RobotModel& robot, TorqueLimit limit, ControllerConfig& config) {
  config.joint_count = static_cast<std::uint32_t>(robot.joints.size());
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const Joint& joint = robot.joints[j];
    config.joints[j] = {.gains = {.kp = joint.kp, .ki = joint.ki, .kd = joint.kd},
                        .torque_limit = limit == TorqueLimit::kDrive ? joint.drive_torque_limit
                                                                     : joint.torque_limit,
                        .lower = joint.lower,
                        .upper = joint.upper,
                        .velocity_limit = joint.velocity_limit};
  }
}

}  // namespace

void expect_springs(const RobotModel& robot, ControllerConfig& config) {
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    config.joints[j].spring_stiffness = robot.joints[j].spring_stiffness;
}

bool matches(std::string_view pattern, std::string_view name) {
  const std::size_t star = pattern.find('*');
  if (star == std::string_view::npos) return pattern == name;
  if (!name.starts_with(pattern.substr(0, star))) return false;
  const std::string_view rest = pattern.substr(star + 1);
  for (std::size_t from = star; from <= name.size(); ++from)
    if (matches(rest, name.substr(from))) return true;
  return false;
}

ControllerConfig load_controller_config(const std::filesystem::path& file, const RobotModel& robot,
                                        const std::filesystem::path& robot_gains,
                                        std::optional<FeedForward> feed_forward) {
  const YamlNode root = YamlNode::load(file);
  root.allow_only({"rate_hz",
                   "feed_forward",
                   "torque_limit",
                   "torque_rate_limit",
                   "derivative_filter",
                   "transfer_time",
                   "time_scale",
                   "pause_time",
                   "start",
                   "hold_time",
                   "springs",
                   "tracking_error_limit",
                   "stale_ticks_limit",
                   "jump_limit",
                   "frozen_limit",
                   "saturation_time",
                   "overspeed",
                   "limit_margin",
                   "temperature_limit",
                   "watchdog_ticks",
                   "failure_policy",
                   "lowering",
                   "overshoot_limit",
                   "velocity_factor",
                   "acceleration_limit",
                   "jerk_limit",
                   "gains",
                   "feed_forward_gains"});
  ControllerConfig config;
  TorqueLimit limit = TorqueLimit::kPlan;
  if (const auto node = root.find("torque_limit"))
    limit = read_choice(*node, "plan", "drive") ? TorqueLimit::kPlan : TorqueLimit::kDrive;
  take_from_robot(robot, limit, config);

  if (const auto rate = root.find("rate_hz")) config.dt = 1.0 / rate->positive();
  if (const auto node = root.find("feed_forward"))
    config.feed_forward =
        read_choice(*node, "plan", "none") ? FeedForward::kPlan : FeedForward::kNone;
  if (feed_forward) config.feed_forward = *feed_forward;
  read_positive(root, "torque_rate_limit", config.torque_rate_limit);
  read_non_negative(root, "derivative_filter", config.derivative_filter);
  read_non_negative(root, "transfer_time", config.transfer_time);
  read_positive(root, "time_scale", config.time_scale);
  if (const auto start = root.find("start")) read_start(*start, config);
  read_non_negative(root, "hold_time", config.hold_time);
  if (const auto springs = root.find("springs"))
    if (read_choice(*springs, "stretched", "rigid")) expect_springs(robot, config);
  read_supervision(root, config);
  if (!robot_gains.empty()) {
    const YamlNode own = YamlNode::load(robot_gains);
    own.allow_only({"gains", "feed_forward_gains"});
    read_gains(own, robot, config);
  }
  read_gains(root, robot, config);
  return config;
}

std::string describe(const LoadReport& report, const RobotModel& robot) {
  std::ostringstream out;
  out << to_string(report.status);
  const std::string joint =
      report.where.joint < robot.joints.size() ? robot.joints[report.where.joint].name : "?";
  switch (report.status) {
    case LoadStatus::kBadImage:
      out << ": " << to_string(report.image);
      if (report.image >= PlanImageStatus::kNotFinite)
        out << " (keyframe " << report.where.keyframe << ", joint " << joint << ")";
      break;
    case LoadStatus::kOvershoot:
      out << ": " << joint << " by " << report.worst << " rad";
      break;
    case LoadStatus::kTooFast:
      out << ": " << joint << " at " << report.worst << " rad/s";
      break;
    case LoadStatus::kTooHard:
      out << ": " << joint << " at " << report.worst << " rad/s^2";
      break;
    case LoadStatus::kTooJerky:
      out << ": " << joint << " at " << report.worst << " rad/s^3";
      break;
    default:
      break;
  }
  return out.str();
}

}  // namespace clamber
