#include "sim_backend/ode_guide.hpp"

#include "robot_model/kinematics.hpp"
#include "sim_backend/ode_conversions.hpp"

namespace clamber {

OdeGuide::OdeGuide(dWorldID world, dBodyID led, const Eigen::Vector3d& com,
                   const OdeOptions& options)
    : led_(led),
      com_(com),
      options_(options),
      guide_(dBodyCreate(world)),
      joint_(dJointCreateFixed(world, nullptr)) {
  const Softness softness = soften(options.guide_stiffness, options.guide_damping, options.step);
  dBodySetKinematic(guide_);
  dJointSetFixedParam(joint_, dParamERP, softness.erp);
  dJointSetFixedParam(joint_, dParamCFM, softness.cfm);
  dJointSetFeedback(joint_, &feedback_);
}

void OdeGuide::take_hold() {
  // The joint's reference is taken with both bodies in the same place.
  const dReal* p = dBodyGetPosition(led_);
  dBodySetPosition(guide_, p[0], p[1], p[2]);
  dBodySetRotation(guide_, dBodyGetRotation(led_));
  dJointAttach(joint_, led_, guide_);
  dJointSetFixed(joint_);
}

void OdeGuide::let_go() {
  dJointAttach(joint_, nullptr, nullptr);
  feedback_ = {};
  previous_.reset();
  force_.setZero();
  torque_.setZero();
}

void OdeGuide::move() {
  if (!target_) {
    let_go();
    return;
  }
  if (!previous_) {
    take_hold();
  }
  const Pose before = previous_.value_or(*target_);
  const Eigen::Vector3d omega = rotation_log(target_->R * before.R.transpose()) / options_.step;
  const Eigen::Vector3d com = *target_ * com_;
  const Eigen::Vector3d velocity =
      (target_->p - before.p) / options_.step + omega.cross(com - target_->p);
  const Eigen::Vector3d p = com - force_ / options_.guide_stiffness;
  dMatrix3 R;
  fill_rotation(target_->R, R);
  dBodySetPosition(guide_, p.x(), p.y(), p.z());
  dBodySetRotation(guide_, R);
  dBodySetLinearVel(guide_, velocity.x(), velocity.y(), velocity.z());
  dBodySetAngularVel(guide_, omega.x(), omega.y(), omega.z());
  dBodyAddForce(led_, force_.x(), force_.y(), force_.z());
  dBodyAddTorque(led_, torque_.x(), torque_.y(), torque_.z());
  previous_ = target_;
}

void OdeGuide::read() {
  force_ += to_eigen(feedback_.f1);
  torque_ += to_eigen(feedback_.t1);
}

}  // namespace clamber
