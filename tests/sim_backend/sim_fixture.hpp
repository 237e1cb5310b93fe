// What the simulation's tests share: robot, scenario, a joint controller, small robots.
#pragma once

#include <string>

#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"
#include "sim_backend/ode_world.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber::test {

inline std::string source(const std::string& path) {
  return std::string(CLAMBER_SOURCE_DIR) + "/" + path;
}

inline RobotModel coman(double ballast_scale = 0.0) {
  LoadOptions options;
  options.ballast_scale = ballast_scale;
  return load_robot(source("configs/robots/coman/robot.yaml"), options);
}

inline Scenario box_scenario() { return load_scenario(source("configs/scenarios/box_0.275.yaml")); }

/// The paper's PID without its integral.
inline JointVector hold(const OdeWorld& world, const JointVector& q_ref) {
  const Eigen::Index joints = world.model().joint_count();
  return 1000.0 * (q_ref - world.configuration().q) - 3.0 * world.velocity().tail(joints);
}

inline double kinetic_energy(const RobotModel& model, const Configuration& x,
                             const VelocityVector& v) {
  RobotData data;
  forward_kinematics(model, x, data);
  MassMatrix M;
  mass_matrix(model, data, M);
  return 0.5 * v.dot(M * v);
}

inline double potential_energy(const RobotModel& model, const Configuration& x) {
  RobotData data;
  forward_kinematics(model, x, data);
  return model.total_mass * kGravity * data.com.z();
}

/// A single rigid body with one geom and no joints.
inline RobotModel single_body(const Geom& shape, double mass) {
  RobotModel model;
  model.name = "block";
  Body body;
  body.name = "block";
  body.axis = Eigen::Vector3d::UnitX();
  body.mass = mass;
  body.inertia = 0.01 * mass * Eigen::Matrix3d::Identity();
  model.bodies.push_back(body);
  model.geoms.push_back(shape);
  model.home = JointVector::Zero(0);
  model.total_mass = mass;
  return model;
}

/// A heavy base and one link on a hinge about y; the link's inertia about the hinge is
/// link_inertia (its centre of mass lies on the axis).
inline RobotModel one_joint(double link_inertia, double reflected_inertia, double damping) {
  RobotModel model = single_body(Geom{}, 1e3);
  model.geoms.clear();
  model.bodies[0].inertia = 1e3 * Eigen::Matrix3d::Identity();
  Body link;
  link.name = "link";
  link.parent = 0;
  link.axis = Eigen::Vector3d::UnitY();
  link.mass = 1.0;
  link.inertia = link_inertia * Eigen::Matrix3d::Identity();
  model.bodies.push_back(link);
  Joint joint;
  joint.name = "hinge";
  joint.lower = -3.0;
  joint.upper = 3.0;
  joint.drive_torque_limit = 50.0;
  joint.torque_limit = 30.0;
  joint.reflected_inertia = reflected_inertia;
  joint.damping = damping;
  model.joints.push_back(joint);
  model.home = JointVector::Zero(1);
  model.total_mass = 1001.0;
  return model;
}

}  // namespace clamber::test
