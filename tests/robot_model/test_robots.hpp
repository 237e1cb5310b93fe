// The robots and random states that the tests of this room share.
#pragma once

#include <filesystem>
#include <random>
#include <string>

#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"

namespace clamber {

inline std::filesystem::path robot_folder(const std::string& robot) {
  return std::filesystem::path(CLAMBER_SOURCE_DIR) / "configs" / "robots" / robot;
}

inline RobotModel load_test_robot(const std::string& robot, double ballast_scale = 0.0) {
  return load_robot(robot_folder(robot) / "robot.yaml", {.ballast_scale = ballast_scale});
}

struct State {
  Configuration x;
  VelocityVector v;
  VelocityVector a;
};

/// Joints within their limits, any base pose, velocities and accelerations of a vigorous motion.
class StateSampler {
 public:
  StateSampler(const RobotModel& model, unsigned seed) : model_(model), generator_(seed) {}

  State next() {
    State state;
    state.x.X_WB.R = rotation_exp(3.0 * vector(3));
    state.x.X_WB.p = vector(3);
    state.x.q.resize(model_.joint_count());
    for (int i = 0; i < model_.joint_count(); ++i) {
      const Joint& joint = model_.joints[static_cast<std::size_t>(i)];
      state.x.q[i] = joint.lower + 0.5 * (uniform() + 1.0) * (joint.upper - joint.lower);
    }
    state.v = 2.0 * vector(model_.velocity_count());
    state.a = 10.0 * vector(model_.velocity_count());
    return state;
  }

  /// Entries uniform in [-1, 1].
  Eigen::VectorXd vector(int size) {
    Eigen::VectorXd result(size);
    for (int i = 0; i < size; ++i) {
      result[i] = uniform();
    }
    return result;
  }

  int body() { return static_cast<int>(generator_() % model_.bodies.size()); }

 private:
  // Not std::uniform_real_distribution: its sequence differs between standard libraries.
  double uniform() { return 2.0 * static_cast<double>(generator_()) / 4294967295.0 - 1.0; }

  const RobotModel& model_;
  std::mt19937 generator_;
};

}  // namespace clamber
