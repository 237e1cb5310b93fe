#include "sim_backend/ode_guide.hpp"

#include "robot_model/kinematics.hpp"

namespace clamber {

OdeGuide::OdeGuide(dWorldID world, dBodyID led, const Eigen::Vector3d& com,
                   const Softness& softness, double step)
    : led_(led),
      com_(com),
      step_(step),
      guide_(dBodyCreate(world)),
      joint_(dJointCreateFixed(world, nullptr)) {
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

void OdeGuide::move() {
  if (!target_) {
    dJointAttach(joint_, nullptr, nullptr);
    feedback_ = {};
    previous_.reset();
    return;
  }
  if (!previous_) {
    take_hold();
  }
  const Pose before = previous_.value_or(*target_);
  const Eigen::Vector3d omega = rotation_log(target_->R * before.R.transpose()) / step_;
  const Eigen::Vector3d com = *target_ * com_;
  const Eigen::Vector3d velocity = (target_->p - before.p) / step_ + omega.cross(com - target_->p);
  dMatrix3 R;
  fill_rotation(target_->R, R);
  dBodySetPosition(guide_, com.x(), com.y(), com.z());
  dBodySetRotation(guide_, R);
  dBodySetLinearVel(guide_, velocity.x(), velocity.y(), velocity.z());
  dBodySetAngularVel(guide_, omega.x(), omega.y(), omega.z());
  previous_ = target_;
}

}  // namespace clamber
