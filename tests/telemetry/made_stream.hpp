// A made-up robot and its frames, for the tests of telemetry.
#pragma once

#include <cmath>
#include <string>

#include "telemetry/frame.hpp"
#include "telemetry/telemetry_config.hpp"

namespace clamber::test {

inline constexpr int kJoints = 23;
inline constexpr double kLimit = 30.0;

inline double torque(std::uint64_t tick, int joint) {
  return 20.0 * std::sin(0.001 * static_cast<double>(tick) + joint);
}
inline double angle(std::uint64_t tick, int joint) {
  return std::cos(0.002 * static_cast<double>(tick) - joint);
}

inline TelemetryFrame frame(std::uint64_t tick) {
  TelemetryFrame f;
  f.sequence = tick;
  f.time = static_cast<double>(tick) * 1e-3;
  f.plan_time = f.time;
  f.joint_count = kJoints;
  f.phase = static_cast<std::uint32_t>(tick / 1000);
  for (int j = 0; j < kJoints; ++j) {
    const auto i = static_cast<std::size_t>(j);
    f.tau_meas[i] = torque(tick, j);
    f.q[i] = angle(tick, j);
    f.dq[i] = 0.5 * angle(tick, j);
  }
  f.flags = kFrameHasTruth;
  f.contact_count = 2;
  f.base_orientation = {1.0, 0.0, 0.0, 0.0};
  return f;
}

inline std::string joint_name(int joint) { return "Joint" + std::to_string(joint); }

inline TelemetryDescription description() {
  TelemetryDescription d;
  for (int j = 0; j < kJoints; ++j) d.joint_names.push_back(joint_name(j));
  d.torque_limits.assign(kJoints, kLimit);
  d.contact_names = {"l_wrist", "r_wrist"};
  d.phases = {{"first", 3}, {"second", 1}};
  d.base = "pelvis";
  for (int j = 0; j < kJoints; ++j)
    d.links.push_back({.name = "Link" + std::to_string(j),
                       .parent = j == 0 ? "pelvis" : "Link" + std::to_string(j - 1),
                       .joint = j,
                       .position = {0.0, 0.0, 0.25}});
  d.links.push_back({.name = "imu", .parent = "pelvis", .position = {0.0, 0.0, 0.5}});
  d.urdf = std::string(100'000, 'u');  // more than one datagram
  return d;
}

inline TelemetryConfig config(int domain) {
  TelemetryConfig c;
  c.domain = domain;
  c.robot = "test_robot";
  return c;
}

}  // namespace clamber::test
