// A small hand-made humanoid, a box and a made-up climb for the report's tests: 9 joints, 8
// contacts.
#pragma once

#include <algorithm>
#include <cmath>

#include "report/run_data.hpp"

namespace clamber::test {

inline int add_body(RobotModel& model, const std::string& joint, int parent,
                    const Eigen::Vector3d& origin) {
  Body body;
  body.name = joint + "Link";
  body.parent = parent;
  body.X_PJ.p = origin;
  body.axis = Eigen::Vector3d::UnitY();
  body.mass = 3.0;
  model.bodies.push_back(body);
  Joint data;
  data.name = joint;
  data.lower = -2.5;
  data.upper = 2.5;
  data.torque_limit = 30.0;
  data.drive_torque_limit = 50.0;
  model.joints.push_back(data);
  return static_cast<int>(model.bodies.size()) - 1;
}

inline int add_capsule(RobotModel& model, int body, double z, double radius, double length) {
  Geom geom;
  geom.body = body;
  geom.shape = length > 0.0 ? Shape::kCapsule : Shape::kSphere;
  geom.X_BG.p.z() = z;
  geom.radius = radius;
  geom.length = length;
  model.geoms.push_back(geom);
  return static_cast<int>(model.geoms.size()) - 1;
}

inline void add_contact(RobotModel& model, const std::string& name, const std::string& limb,
                        int body, int geom, const Eigen::Vector3d& point, double radius) {
  ContactLink contact;
  contact.name = name;
  contact.limb = limb;
  contact.body = body;
  contact.geom = geom;
  contact.points = {point};
  contact.radius = radius;
  model.contacts.push_back(contact);
}

inline void add_side(RobotModel& model, int torso, bool left) {
  const std::string side = left ? "L" : "R";
  const std::string limb = left ? "left_" : "right_";
  const double y = left ? 1.0 : -1.0;
  const int upper = add_body(model, side + "ShSag", torso, {0, 0.17 * y, 0.30});
  add_capsule(model, upper, -0.09, 0.05, 0.14);
  const int fore = add_body(model, side + "Elbj", upper, {0, 0, -0.18});
  add_capsule(model, fore, -0.11, 0.034, 0.16);
  add_contact(model, side + "elb", limb + "arm", fore, add_capsule(model, fore, 0, 0.042, 0),
              {0, 0, 0}, 0.042);
  add_contact(model, side + "wrist", limb + "arm", fore, add_capsule(model, fore, -0.22, 0.036, 0),
              {0, 0, -0.22}, 0.036);
  const int thigh = add_body(model, side + "HipSag", 0, {0, 0.08 * y, 0});
  add_capsule(model, thigh, -0.11, 0.06, 0.14);
  const int shank = add_body(model, side + "KneeSag", thigh, {0, 0, -0.226});
  add_capsule(model, shank, -0.12, 0.048, 0.16);
  add_contact(model, side + "knee", limb + "leg", shank, add_capsule(model, shank, 0, 0.058, 0),
              {0, 0, 0}, 0.058);
  Geom sole;
  sole.body = shank;
  sole.shape = Shape::kBox;
  sole.X_BG.p = {0.03, 0, -0.27};
  sole.half_extents = {0.1, 0.05, 0.02};
  model.geoms.push_back(sole);
  add_contact(model, side + "foot", limb + "leg", shank, static_cast<int>(model.geoms.size()) - 1,
              {0.03, 0, -0.29}, 0.0);
  model.contacts.back().is_patch = true;
}

inline RobotModel made_robot() {
  RobotModel model;
  model.name = "made";
  Body base;
  base.name = "Pelvis";
  base.mass = 5.0;
  model.bodies.push_back(base);
  add_capsule(model, 0, 0.05, 0.08, 0.06);
  const int torso = add_body(model, "WaistSag", 0, {0, 0, 0.12});
  add_capsule(model, torso, 0.17, 0.125, 0.14);
  add_side(model, torso, true);
  add_side(model, torso, false);
  model.home = JointVector::Zero(model.joint_count());
  for (const Body& body : model.bodies) {
    model.total_mass += body.mass;
  }
  return model;
}

inline Scenario made_scenario() {
  Scenario scenario;
  scenario.name = "box_0.275";
  ObstacleBox box;
  box.name = "box";
  box.half_extents = {0.3, 0.4, 0.1375};
  box.center = {0.3, 0.0, 0.1375};
  scenario.obstacles.push_back(box);
  scenario.start_position = {-0.17, 0.0, 0.0};
  return scenario;
}

/// 4 s at 1 kHz: stands, bends, hands on the box from 2 s, knees from 3 s, floor left at 3.2 s.
/// Torque: 8 sin on every joint, a single 1 ms spike of -41.5 N m on LKneeSag at 1.234 s.
inline RunData made_climb() {
  RunData run;
  run.label = "climb";
  run.model = made_robot();
  run.scenario = made_scenario();
  const auto joints = static_cast<std::size_t>(run.model.joint_count());
  const double weight = run.model.total_mass * kGravity;
  for (int i = 0; i < 4000; ++i) {
    TelemetryFrame f;
    f.sequence = static_cast<std::uint64_t>(i);
    f.time = f.plan_time = 0.001 * i;
    f.joint_count = static_cast<std::uint32_t>(joints);
    f.contact_count = static_cast<std::uint32_t>(run.model.contacts.size());
    f.phase = f.time < 2.0 ? 0 : (f.time < 3.0 ? 1 : 2);
    f.flags = kFrameHasTruth;
    for (std::size_t j = 0; j < joints; ++j) {
      f.tau_meas[j] = 8.0 * std::sin(2.0 * f.time + static_cast<double>(j));
    }
    const double bend = std::clamp((f.time - 0.5) / 1.5, 0.0, 1.0);
    f.q[0] = 1.1 * bend;            // WaistSag
    f.q[1] = f.q[5] = -1.5 * bend;  // shoulders
    f.q[2] = f.q[6] = -0.9 * bend;  // elbows
    f.q[3] = f.q[7] = -0.8 * bend;  // hips
    f.q[4] = f.q[8] = 1.0 * bend;   // knees
    f.base_position = {-0.17 + 0.1 * std::max(0.0, f.time - 3.0), 0.0, 0.516 - 0.06 * bend};
    f.base_orientation = {1.0, 0.0, 0.0, 0.0};
    // Contact order: elb, wrist, knee, foot, left then right.
    const bool hands = f.time >= 2.0;
    const bool knees = f.time >= 3.0;
    const bool feet = f.time < 3.2;
    const double share = weight / ((hands ? 4 : 0) + (knees ? 2 : 0) + (feet ? 2 : 0));
    for (const std::size_t side : {std::size_t{0}, std::size_t{4}}) {
      f.force_obstacle[side] = f.force_obstacle[side + 1] = hands ? share : 0.0;
      f.force_obstacle[side + 2] = knees ? share : 0.0;
      f.force_floor[side + 3] = feet ? share : 0.0;
    }
    run.frames.push_back(f);
  }
  run.frames[1234].tau_meas[4] = -41.5;
  return run;
}

}  // namespace clamber::test
