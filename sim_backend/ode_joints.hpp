// Joints of one OdeWorld: hinge, drive torque, reflected inertia, damping and stop, warm start.
// Internal to sim_backend; threads, allocation and blocking as OdeWorld.
#pragma once

#include <ode/ode.h>

#include <vector>

#include "robot_model/kinematics.hpp"
#include "sim_backend/ode_world.hpp"

namespace clamber {

/// Every step: drive(), step the world, read().
class OdeJoints {
 public:
  /// Keeps references to model, options and bodies. The bodies must stand as in `data`, which
  /// belongs to q = 0: the hinges measure from there.
  OdeJoints(const RobotModel& model, const OdeOptions& options, dWorldID world,
            const std::vector<dBodyID>& bodies, const RobotData& data);
  OdeJoints(const OdeJoints&) = delete;
  OdeJoints& operator=(const OdeJoints&) = delete;

  /// Sets each joint's row for the drive torque `command` (N m, saturated here) at the angles q and
  /// rates v = [base; joints] it has now, and applies the wrenches of the step before.
  void drive(const JointVector& command, const JointVector& q, const VelocityVector& v);
  /// Takes up what the joints carried during the step.
  void read();
  /// As if no joint had ever carried anything; rotors stand where the joints do (v = [base;
  /// joints]).
  void forget(const JointVector& q, const VelocityVector& v);

  [[nodiscard]] const JointVector& torque() const { return tau_; }  ///< after saturation, N m
  /// Angle in the turn that is nearest to `near`, rad (ODE folds angles into +-pi).
  [[nodiscard]] double angle(std::size_t joint, double near) const;
  [[nodiscard]] double rate(std::size_t joint) const;  ///< rad/s
  [[nodiscard]] double separation() const;             ///< m, see OdeWorld::joint_separation()
  [[nodiscard]] const JointVector& motor_position() const { return motor_q_; }  ///< rad, springs on
  [[nodiscard]] const JointVector& motor_rate() const { return motor_rate_; }   ///< rad/s

 private:
  /// Wrench on the child at the anchor, in the parent's axes: it turns with the robot.
  struct Wrench {
    Eigen::Vector3d force = Eigen::Vector3d::Zero();   ///< N
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();  ///< N m
  };
  /// Where a joint is during the step.
  struct Place {
    Eigen::Matrix3d R_parent;
    Eigen::Vector3d anchor;  ///< world, m
    Eigen::Vector3d arm;     ///< from the child's centre of mass to the anchor, m
    Eigen::Vector3d axis;    ///< world
  };
  /// One row: resistance * rate' + torque of the row = drive.
  struct Row {
    double drive;       ///< N m
    double resistance;  ///< N m s/rad
  };

  /// A rotor behind its spring during one step: rate' = (push + coupling * link's rate') / mass.
  struct Rotor {
    double push = 0.0;      ///< N m
    double coupling = 0.0;  ///< N m s/rad, of spring and damper over the step
    double mass = 1.0;      ///< N m s/rad
  };

  [[nodiscard]] Place locate(std::size_t joint) const;
  [[nodiscard]] bool is_elastic(std::size_t joint) const;
  [[nodiscard]] Row rigid_row(std::size_t joint, double tau, double rate) const;
  [[nodiscard]] Row elastic_row(std::size_t joint, double tau, double q);
  [[nodiscard]] Row row(std::size_t joint, double tau, double q, double rate);
  void move_rotors();
  void set_row(std::size_t joint, const Row& row);
  void apply_wrench(std::size_t joint);
  [[nodiscard]] dBodyID child(std::size_t joint) const { return bodies_[joint + 1]; }
  [[nodiscard]] dBodyID parent(std::size_t joint) const;

  const RobotModel& model_;
  const OdeOptions& options_;
  const std::vector<dBodyID>& bodies_;
  std::vector<dJointID> hinges_;  ///< owned by the ODE world
  std::vector<dJointFeedback> feedback_;
  std::vector<Wrench> wrenches_;
  std::vector<Place> places_;
  JointVector tau_;
  std::vector<Rotor> rotors_;
  JointVector motor_q_, motor_rate_;
};

}  // namespace clamber
