// A small plan image, configuration and plant for the controller's tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "control/controller.hpp"

namespace clamber::test {

inline constexpr std::string_view kRobotHash = "0123abcd";

/// A smooth motion of `joints` joints from zero, one keyframe every 0.1 s, with feed-forward
/// torques.
inline std::vector<ImageKeyframe> smooth_keyframes(std::uint32_t joints, std::size_t count) {
  std::vector<ImageKeyframe> keyframes(count);
  for (std::size_t i = 0; i < count; ++i) {
    ImageKeyframe& k = keyframes[i];
    k.time = 0.1 * static_cast<double>(i);
    k.phase = static_cast<std::uint32_t>(3 * i / count);
    for (std::uint32_t j = 0; j < joints; ++j) {
      k.q[j] = 0.3 * (1.0 - std::cos(0.5 * k.time * (1.0 + 0.05 * j)));
      k.tau[j] = 2.0 * std::sin(0.2 * k.time + j);
    }
  }
  return keyframes;
}

inline std::vector<std::byte> make_image(std::uint32_t joints,
                                         const std::vector<ImageKeyframe>& keyframes) {
  PlanImageHeader header;
  header.joint_count = joints;
  std::copy(kRobotHash.begin(), kRobotHash.end(), header.robot_hash.begin());
  header.certificate.fill('0');
  header.friction = 0.8;
  std::vector<std::byte> image(plan_image_size(keyframes.size()));
  if (!write_plan_image(header, keyframes, image)) image.clear();
  return image;
}

inline ControllerConfig make_config(std::uint32_t joints) {
  ControllerConfig config;
  config.joint_count = joints;
  config.start_time = 0.2;
  config.hold_time = 0.3;
  for (std::uint32_t j = 0; j < joints; ++j)
    config.joints[j] = {.gains = {.kp = 600.0, .ki = 50.0, .kd = 3.0},
                        .torque_limit = 30.0,
                        .lower = -2.0,
                        .upper = 2.0,
                        .velocity_limit = 4.0};
  return config;
}

/// One joint: reflected inertia and damping of the robot's drives, a constant load.
struct Plant {
  double inertia = 0.139;  ///< kg m^2
  double damping = 3.0;    ///< N m s/rad
  double load = 0.0;       ///< N m
  double q = 0.0;
  double dq = 0.0;

  void step(double tau, double dt) {
    dq = (dq + dt * (tau + load) / inertia) / (1.0 + dt * damping / inertia);
    q += dt * dq;
  }
};

/// Independent joints behind the command and state types.
struct PlantRobot {
  explicit PlantRobot(std::size_t joints) : plants(joints), states(joints), commands(joints) {}
  std::vector<Plant> plants;
  std::vector<JointState> states;
  std::vector<JointCommand> commands;

  void step(double dt) {
    for (std::size_t j = 0; j < plants.size(); ++j) {
      plants[j].step(commands[j].tau, dt);
      states[j].q = plants[j].q;
      states[j].dq = plants[j].dq;
      states[j].tau = commands[j].tau;
      ++states[j].sequence;
    }
  }
};

}  // namespace clamber::test
