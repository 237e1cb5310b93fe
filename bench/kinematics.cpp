// Time of the kinematics and dynamics, COMAN with a floating base (29 velocities).
//   kinematics [robot.yaml]
// "whole" starts from joint angles and base pose; "alone" from kinematics already there.
#include <array>
#include <cstdio>
#include <random>
#include <string>

#include "bench/calibration.hpp"
#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr std::size_t kPostures = 64;

std::array<Configuration, kPostures> random_postures(const RobotModel& model) {
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  std::array<Configuration, kPostures> postures;
  for (Configuration& x : postures) {
    x.X_WB.p = {u(generator), u(generator), 0.5};
    x.X_WB.R = rotation_exp({u(generator), u(generator), u(generator)});
    x.q.resize(model.joint_count());
    for (int j = 0; j < model.joint_count(); ++j) {
      x.q[j] = u(generator);
    }
  }
  return postures;
}

/// Times `f(i)` over all postures, 400 times; prints us per call.
template <typename F>
void report(const char* what, const F& f) {
  std::vector<double> times;
  for (int round = 0; round < 400; ++round) {
    times.push_back(bench::microseconds([&] {
                      for (std::size_t i = 0; i < kPostures; ++i) {
                        f(i);
                      }
                    }) /
                    static_cast<double>(kPostures));
  }
  std::printf("%-44s %6.2f %6.2f %6.2f\n", what, bench::quantile(times, 0.5),
              bench::quantile(times, 0.0), bench::quantile(times, 0.99));
}

void run(const RobotModel& model) {
  const auto postures = random_postures(model);
  std::array<RobotData, kPostures> datas;
  RobotData data;
  std::vector<Pose> frames(model.frames.size());
  Jacobian3 J;
  Jacobian6 J6;
  VelocityVector g, v = VelocityVector::Constant(model.velocity_count(), 0.1);
  MassMatrix M;
  for (std::size_t i = 0; i < kPostures; ++i) {
    forward_kinematics(model, postures[i], datas[i]);
  }
  std::printf("%s: %d joints, %zu frames\n%-44s %6s %6s %6s\n", model.name.c_str(),
              model.joint_count(), model.frames.size(), "us", "median", "least", "99 %");
  report("body frames, axes, centres of mass (whole)",
         [&](std::size_t i) { forward_kinematics(model, postures[i], data); });
  report("and all link frames (whole)", [&](std::size_t i) {
    forward_kinematics(model, postures[i], data);
    for (std::size_t f = 0; f < frames.size(); ++f) {
      frames[f] = data.X_WB[static_cast<std::size_t>(model.frames[f].body)] * model.frames[f].X_BF;
    }
  });
  report("centre of mass and its Jacobian (whole)", [&](std::size_t i) {
    forward_kinematics(model, postures[i], data);
    com_jacobian(model, data, J);
  });
  report("centre of mass and its Jacobian (alone)",
         [&](std::size_t i) { com_jacobian(model, datas[i], J); });
  report("gravity torque (whole)", [&](std::size_t i) {
    forward_kinematics(model, postures[i], data);
    gravity_torque(model, data, g);
  });
  report("gravity torque (alone)", [&](std::size_t i) { gravity_torque(model, datas[i], g); });
  report("Jacobian of one frame (alone)", [&](std::size_t i) {
    const int body = model.frames[i % model.frames.size()].body;
    frame_jacobian(model, datas[i], body, datas[i].com, J6);
  });
  report("inverse dynamics (alone)",
         [&](std::size_t i) { inverse_dynamics(model, datas[i], v, v, g); });
  report("mass matrix (alone)", [&](std::size_t i) { mass_matrix(model, datas[i], M); });
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  const std::string robot =
      argc > 1 ? argv[1] : std::string(CLAMBER_SOURCE_DIR) + "/configs/robots/coman/robot.yaml";
  clamber::bench::print_calibration();
  try {
    clamber::run(clamber::load_robot(robot));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "kinematics: %s\n", error.what());
    return 2;
  }
}
