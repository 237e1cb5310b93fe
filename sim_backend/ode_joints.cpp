#include "sim_backend/ode_joints.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim_backend/ode_conversions.hpp"

namespace clamber {
namespace {

// 50 N m lean 1 mrad into a stop; the damping takes the bounce out of it.
constexpr double kStopStiffness = 5e4;  // N m/rad
constexpr double kStopDamping = 200.0;  // N m s/rad

// Share of a step's change that the next step starts from. A step's error in a joint's wrench is
// followed by an equal and opposite one that undoes its effect: taking up the whole change feeds
// this zigzag, taking up less makes the guess lag, which takes damping from a robot that rocks.
constexpr double kTakenUp = 0.9;

// Dry friction below this rate is viscous: a joint at rest under load creeps instead of sticking,
// by 0.6 degrees in a second at the full friction torque.
constexpr double kCreep = 0.01;  // rad/s

/// N m s/rad. Dry friction as the secant through the present rate: exact when the rate keeps, and
/// it can never push.
double resistance(const Joint& drive, double rate) {
  return drive.damping + drive.friction / std::max(std::abs(rate), kCreep);
}

}  // namespace

OdeJoints::OdeJoints(const RobotModel& model, const OdeOptions& options, dWorldID world,
                     const std::vector<dBodyID>& bodies, const RobotData& data)
    : model_(model),
      options_(options),
      bodies_(bodies),
      feedback_(model.joints.size()),
      wrenches_(model.joints.size()),
      places_(model.joints.size()),
      tau_(JointVector::Zero(model.joint_count())),
      rotors_(model.joints.size()),
      motor_q_(tau_),
      motor_rate_(tau_) {
  for (std::size_t i = 0; i < model_.joints.size(); ++i) {
    dJointID hinge = dJointCreateHinge(world, nullptr);
    dJointAttach(hinge, child(i), parent(i));
    const Eigen::Vector3d& p = data.X_WB[i + 1].p;
    const Eigen::Vector3d& a = data.axis_W[i + 1];
    dJointSetHingeAnchor(hinge, p.x(), p.y(), p.z());
    dJointSetHingeAxis(hinge, a.x(), a.y(), a.z());
    dJointSetFeedback(hinge, &feedback_[i]);
    hinges_.push_back(hinge);
  }
}

dBodyID OdeJoints::parent(std::size_t joint) const {
  return bodies_[static_cast<std::size_t>(model_.bodies[joint + 1].parent)];
}

void OdeJoints::forget(const JointVector& q, const VelocityVector& v) {
  std::fill(wrenches_.begin(), wrenches_.end(), Wrench{});
  tau_.setZero();
  motor_q_ = q;
  motor_rate_ = v.tail(q.size());
}

OdeJoints::Place OdeJoints::locate(std::size_t joint) const {
  dVector3 anchor;
  dVector3 axis;
  dJointGetHingeAnchor(hinges_[joint], anchor);
  dJointGetHingeAxis(hinges_[joint], axis);
  Place place;
  place.R_parent = rotation_of(parent(joint));
  place.anchor = to_eigen(anchor);
  place.arm = place.anchor - position_of(child(joint));
  place.axis = to_eigen(axis);
  return place;
}

bool OdeJoints::is_elastic(std::size_t joint) const {
  return options_.springs && model_.joints[joint].spring_stiffness > 0.0;
}

OdeJoints::Row OdeJoints::rigid_row(std::size_t joint, double tau, double rate) const {
  const Joint& drive = model_.joints[joint];
  const double inertia = drive.reflected_inertia / options_.step;
  return {tau + inertia * rate, inertia + resistance(drive, rate)};
}

/// With e the spring's torque now and k what spring and damper add to it per rate over the step:
///   I/h (w' - w) = tau - d w' - s,   s = e + k (w' - v'),   v' the link's rate after the step,
/// which gives the rotor's rate w' and leaves for the link s = (e + k a / m) - k (1 - k / m) v'.
OdeJoints::Row OdeJoints::elastic_row(std::size_t joint, double tau, double q) {
  const Joint& drive = model_.joints[joint];
  const auto j = static_cast<Eigen::Index>(joint);
  const double inertia = drive.reflected_inertia / options_.step;
  const double stretch = drive.spring_stiffness * (motor_q_[j] - q);
  Rotor& rotor = rotors_[joint];
  rotor.coupling = options_.step * drive.spring_stiffness + drive.spring_damping;
  rotor.mass = inertia + resistance(drive, motor_rate_[j]) + rotor.coupling;
  rotor.push = tau + inertia * motor_rate_[j] - stretch;
  return {stretch + rotor.coupling * rotor.push / rotor.mass,
          rotor.coupling * (1.0 - rotor.coupling / rotor.mass)};
}

OdeJoints::Row OdeJoints::row(std::size_t joint, double tau, double q, double rate) {
  const Joint& limits = model_.joints[joint];
  Row row = is_elastic(joint) ? elastic_row(joint, tau, q) : rigid_row(joint, tau, rate);
  const double beyond = std::max(0.0, q - limits.upper) + std::min(0.0, q - limits.lower);
  // A stop pushes and never holds back.
  if (beyond != 0.0 && beyond * (kStopStiffness * beyond + kStopDamping * rate) > 0.0) {
    row.drive -= kStopStiffness * beyond;
    row.resistance += options_.step * kStopStiffness + kStopDamping;
  }
  return row;
}

void OdeJoints::set_row(std::size_t joint, const Row& row) {
  const Place& place = places_[joint];
  Wrench& wrench = wrenches_[joint];
  const Eigen::Vector3d axis_P = place.R_parent.transpose() * place.axis;
  if (row.resistance <= 0.0) {
    // A bare joint has no row; what is left of an earlier one (its stop's) must not be applied.
    dJointSetHingeParam(hinges_[joint], dParamFMax, 0.0);
    dJointAddHingeTorque(hinges_[joint], row.drive);
    wrench.moment -= axis_P * axis_P.dot(wrench.moment);
    return;
  }
  const double applied = axis_P.dot(wrench.moment);
  dJointSetHingeParam(hinges_[joint], dParamFMax, dInfinity);
  dJointSetHingeParam(hinges_[joint], dParamVel, (row.drive - applied) / row.resistance);
  dJointSetHingeParam(hinges_[joint], dParamCFM, 1.0 / row.resistance);
}

void OdeJoints::apply_wrench(std::size_t joint) {
  const Place& place = places_[joint];
  const Eigen::Vector3d& p = place.anchor;
  const Eigen::Vector3d f = place.R_parent * wrenches_[joint].force;
  const Eigen::Vector3d m = place.R_parent * wrenches_[joint].moment;
  dBodyAddForceAtPos(child(joint), f.x(), f.y(), f.z(), p.x(), p.y(), p.z());
  dBodyAddTorque(child(joint), m.x(), m.y(), m.z());
  dBodyAddForceAtPos(parent(joint), -f.x(), -f.y(), -f.z(), p.x(), p.y(), p.z());
  dBodyAddTorque(parent(joint), -m.x(), -m.y(), -m.z());
}

void OdeJoints::drive(const JointVector& command, const JointVector& q, const VelocityVector& v) {
  for (std::size_t i = 0; i < hinges_.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    const double limit = options_.saturate_at.value_or(model_.joints[i].drive_torque_limit);
    tau_[j] = std::clamp(command[j], -limit, limit);
    places_[i] = locate(i);
    set_row(i, row(i, tau_[j], q[j], v[6 + j]));
    if (options_.stepper == OdeStepper::kQuick) {
      apply_wrench(i);
    }
  }
}

void OdeJoints::move_rotors() {
  for (std::size_t i = 0; i < hinges_.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    if (is_elastic(i)) {
      const Rotor& rotor = rotors_[i];
      motor_rate_[j] = (rotor.push + rotor.coupling * rate(i)) / rotor.mass;
      motor_q_[j] += options_.step * motor_rate_[j];
    } else {
      motor_rate_[j] = rate(i);
      motor_q_[j] = angle(i, motor_q_[j]);
    }
  }
}

void OdeJoints::read() {
  if (options_.springs) {
    move_rotors();
  }
  if (options_.stepper != OdeStepper::kQuick) {
    return;  // the exact stepper needs no guess
  }
  for (std::size_t i = 0; i < hinges_.size(); ++i) {
    const Eigen::Vector3d f = to_eigen(feedback_[i].f1);
    const Eigen::Vector3d m = to_eigen(feedback_[i].t1) - places_[i].arm.cross(f);
    wrenches_[i].force += kTakenUp * places_[i].R_parent.transpose() * f;
    wrenches_[i].moment += kTakenUp * places_[i].R_parent.transpose() * m;
  }
}

double OdeJoints::angle(std::size_t joint, double near) const {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double folded = dJointGetHingeAngle(hinges_[joint]);
  return folded + kTurn * std::round((near - folded) / kTurn);
}

double OdeJoints::rate(std::size_t joint) const { return dJointGetHingeAngleRate(hinges_[joint]); }

double OdeJoints::separation() const {
  double worst = 0.0;
  for (dJointID hinge : hinges_) {
    dVector3 a;
    dVector3 b;
    dJointGetHingeAnchor(hinge, a);
    dJointGetHingeAnchor2(hinge, b);
    worst = std::max(worst, (to_eigen(a) - to_eigen(b)).norm());
  }
  return worst;
}

}  // namespace clamber
