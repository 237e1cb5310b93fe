// What the tests of the planner's core share: the robot, the box, postures and a made-up climb.
#pragma once

#include <cmath>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "planner_offline/contacts/contact.hpp"
#include "planner_offline/contacts/contact_sequence.hpp"
#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

inline std::filesystem::path config_file(const std::string& name) {
  return std::filesystem::path(CLAMBER_SOURCE_DIR) / "configs" / name;
}

inline const RobotModel& coman() {
  static const RobotModel model = load_robot(config_file("robots/coman/robot.yaml"));
  return model;
}

/// The paper's box, at another height where one is given.
inline Scenario box(double height = 0.275) {
  return with_height(load_scenario(config_file("scenarios/box_0.275.yaml")), height);
}

inline int link_of(const std::string& name) { return coman().find_contact(name).value(); }

inline int joint_of(const std::string& name) { return coman().find_joint(name).value(); }

inline RobotData data_at(const Configuration& x) {
  RobotData data;
  forward_kinematics(coman(), x, data);
  return data;
}

inline Configuration moved(const Configuration& x, const VelocityVector& dv) {
  Configuration out;
  integrate(coman(), x, dv, out);
  return out;
}

/// dv with `step` in coordinate `i` and nothing elsewhere.
inline VelocityVector unit_step(int i, double step) {
  VelocityVector dv = VelocityVector::Zero(coman().velocity_count());
  dv[i] = step;
  return dv;
}

/// Standing before the box, both soles flat on the floor.
inline Configuration standing(const Scenario& scenario = box()) {
  return start_configuration(coman(), scenario);
}

inline ContactSet feet(const Scenario& scenario, const Configuration& x) {
  const RobotData data = data_at(x);
  return {make_contact(coman(), scenario, data, link_of("Lfoot"), kFloor),
          make_contact(coman(), scenario, data, link_of("Rfoot"), kFloor)};
}

/// Joints anywhere in the inner part of their ranges, the base leaning over the box's edge.
inline Configuration random_posture(std::mt19937& generator) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  Configuration x;
  x.X_WB.p = {0.15 * u(generator), 0.1 * u(generator), 0.5 + 0.15 * u(generator)};
  const Eigen::Vector3d turn(0.3 * u(generator), 0.6 + 0.5 * u(generator), 0.3 * u(generator));
  x.X_WB.R = rotation_exp(turn);
  x.q.resize(coman().joint_count());
  for (int i = 0; i < coman().joint_count(); ++i) {
    const Joint& joint = coman().joints[static_cast<std::size_t>(i)];
    const double middle = 0.5 * (joint.lower + joint.upper);
    x.q[i] = middle + 0.4 * (joint.upper - joint.lower) * u(generator);
  }
  return x;
}

/// What is the same on both sides; the lateral and yaw joints of the right side mirror the left's.
struct Limbs {
  double waist, hip, knee, ankle, shoulder, shoulder_lateral, shoulder_yaw, elbow;
};

inline JointVector posture_of(const Limbs& limbs) {
  JointVector q = JointVector::Zero(coman().joint_count());
  q[joint_of("WaistSag")] = limbs.waist;
  for (const std::string side : {"L", "R"}) {
    const double mirror = side == "L" ? 1.0 : -1.0;
    q[joint_of(side + "HipSag")] = limbs.hip;
    q[joint_of(side + "KneeSag")] = limbs.knee;
    q[joint_of(side + "AnkSag")] = limbs.ankle;
    q[joint_of(side + "ShSag")] = limbs.shoulder;
    q[joint_of(side + "ShLat")] = mirror * limbs.shoulder_lateral;
    q[joint_of(side + "ShYaw")] = mirror * limbs.shoulder_yaw;
    q[joint_of(side + "Elbj")] = limbs.elbow;
  }
  return q;
}

/// Posture hints of the made-up climb: bent forward with the hands out, then on the forearms.
inline JointVector reaching() { return posture_of({0.55, -1.8, 0.9, -0.5, -2.4, 0.2, -0.5, -1.2}); }
inline JointVector on_forearms() {
  return posture_of({0.25, -1.65, 0.6, -0.5, -1.75, 0.0, -0.1, -1.85});
}

inline void kneel(const std::string& side, JointVector& q) {
  q[joint_of(side + "HipSag")] = -1.65;
  q[joint_of(side + "KneeSag")] = 1.5;
  q[joint_of(side + "AnkSag")] = 0.78;
}

inline ContactReference on_box(const std::string& link, double x, double y) {
  return {link, "box", {x, y, 0.0}, 0.0};
}

/// The paper's reduced sequence with places for COMAN: wrists and elbows, left knee, right knee.
inline ContactSequence made_climb() {
  const std::vector<ContactReference> wrists{on_box("Lwrist", 0.52, 0.13),
                                             on_box("Rwrist", 0.52, -0.13)};
  const std::vector<ContactReference> elbows{on_box("Lelb", 0.30, 0.155),
                                             on_box("Relb", 0.30, -0.155)};
  ContactSequence sequence;
  sequence.recording = "made up";
  sequence.robot = "coman";
  sequence.playback_obstacle_height = 0.275;
  JointVector q = reaching();
  ContactState state;
  const auto add = [&](const std::vector<ContactReference>& landing, bool stable) {
    state.start = state.end;
    state.end += 2.0;
    state.obstacle.insert(state.obstacle.end(), landing.begin(), landing.end());
    state.stability = stable ? 0.0 : 0.1;
    state.posture.q = q;
    sequence.states.push_back(state);
    if (stable) {
      sequence.reduced.push_back(state);
    }
  };
  add(wrists, false);
  q = on_forearms();
  add(elbows, true);
  kneel("L", q);
  add({on_box("Lknee", 0.06, 0.08)}, true);
  kneel("R", q);
  add({on_box("Rknee", 0.06, -0.08)}, true);
  return sequence;
}

}  // namespace clamber
