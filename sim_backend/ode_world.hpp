// The robot and its scenario as rigid bodies in Open Dynamics Engine (ODE), stepped at 1 kHz.
// One thread at a time, and never two worlds in two threads at once (ODE's random numbers are
// global to the process); allocates: yes, also in step(); blocks: never.
//
// Modelling choices
// - Bodies are the model's merged links; ODE puts a body's origin at its centre of mass.
// - Every joint is an ODE hinge (5 rows) plus one motor row that carries everything along the axis,
//   solved implicitly with the rest of the step. With the rate v now and v' after the step of h,
//     torque = tau_drive - I_r (v' - v)/h - d v' - stop(q + h v', v'),
//   which is ODE's soft constraint v' + CFM torque = c with CFM = 1/(I_r/h + d + ...). So the
//   reflected inertia I_r resists the joint's acceleration only (not the body's own, as an inertia
//   added to the link would), and damping is stable for any d h / I.
// - With springs (OdeOptions::springs) the rotor is a state of its own: I_r, d and dry friction act
//   on the motor's side, a spring-damper ties it to the link. The rotor is eliminated from the
//   implicit step, so that the link's row stays one row.
// - A joint's stop is a one-sided spring-damper inside that row: ODE's own stops do not work
// together
//   with a soft motor, nor beyond +-pi (shoulder: -3.4 rad).
// - Collision shapes are the model's own primitives. Contacts are made between the robot and floor
//   or obstacles, and between the robot's geoms of `collision_pairs`; nothing else.
// - Friction: ODE bounds each of two tangential directions by mu times the normal force, a square
//   pyramid. The first direction is laid along the slip, or while sticking along the tangential
//   force of the step before, so the bound on the force that matters is the cone's own. Slip
//   thresholds are within 10 % of the cone in every direction (tests/sim_backend).
// - Contacts are spring-dampers (contact_stiffness, contact_damping), solved implicitly.
// - dWorldQuickStep starts its iteration from zero. To make few iterations accurate, what each
// joint
//   and contact carried in the step before is applied beforehand, and the iteration only solves for
//   the change (a warm start, see ode_joints.hpp, ode_contacts.hpp). dWorldStep is available as the
//   slow exact reference; docs/benchmarks.md compares the two.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "robot_model/model.hpp"
#include "sim_backend/contact_observation.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

enum class OdeStepper {
  kQuick,  ///< dWorldQuickStep: iterative
  kExact   ///< dWorldStep: direct, some ten times slower
};

struct OdeOptions {
  double step = 1e-3;  ///< s
  OdeStepper stepper = OdeStepper::kQuick;
  int iterations = 50;  ///< of the quick stepper
  /// N m: where every drive saturates; empty: each joint's drive_torque_limit.
  std::optional<double> saturate_at;
  Eigen::Vector3d gravity{0.0, 0.0, -kGravity};  ///< m/s^2
  double contact_stiffness = 2e5;                ///< N/m per contact point
  double contact_damping = 2e3;                  ///< N s/m per contact point
  double guide_stiffness = 2e4;                  ///< N/m, set_base_guide()
  double guide_damping = 2e3;                    ///< N s/m
  unsigned long seed = 1;                        ///< of ODE's random numbers (order of rows)
  bool springs = false;  ///< between motors and links where the model has them
};

class OdeWorld {
 public:
  /// Copies what it needs; the robot starts at x, at rest.
  OdeWorld(const RobotModel& model, const Scenario& scenario, const Configuration& x,
           const OdeOptions& options = {});
  /// The same at the scenario's start configuration. @throws InputError, see start_configuration()
  OdeWorld(const RobotModel& model, const Scenario& scenario, const OdeOptions& options = {});
  ~OdeWorld();
  OdeWorld(const OdeWorld&) = delete;
  OdeWorld& operator=(const OdeWorld&) = delete;

  /// Places the robot at x, at rest, and forgets everything that happened: time 0, seed as at the
  /// start, no guide.
  void reset(const Configuration& x);
  /// As above with a velocity (6 + joints, see VelocityVector).
  void reset(const Configuration& x, const VelocityVector& v);

  /// Applies the drive torques (N m, model's joint order; saturated here) during one step.
  void step(const JointVector& tau);

  /// From the next step on a spring-damper holds the base's position and a stiff constraint its
  /// orientation at this pose (the velocity is taken from the difference to the pose set before);
  /// nothing: let go. Off by default.
  void set_base_guide(const std::optional<Pose>& X_WB);

  [[nodiscard]] const RobotModel& model() const;
  [[nodiscard]] const Scenario& scenario() const;
  [[nodiscard]] const OdeOptions& options() const;
  [[nodiscard]] double time() const;  ///< s since reset

  [[nodiscard]] const Configuration& configuration() const;  ///< after the last step
  [[nodiscard]] const VelocityVector& velocity() const;      ///< after the last step
  [[nodiscard]] const JointVector& drive_torque() const;     ///< N m, applied in the last step
  /// What an encoder on the motor's side of the spring reads, as joint angles and rates; without
  /// springs those of the joint itself.
  [[nodiscard]] JointVector motor_position() const;  ///< rad
  [[nodiscard]] JointVector motor_rate() const;      ///< rad/s
  /// Contact points of the last step: positions before it, forces during it.
  [[nodiscard]] std::span<const ContactObservation> contacts() const;
  /// "floor", the obstacle's name or the other geom's name.
  [[nodiscard]] const std::string& surface_name(const ContactObservation& contact) const;
  /// Force the guide exerted on the base during the last step, N (zero without a guide).
  [[nodiscard]] Eigen::Vector3d guide_force() const;
  /// Largest distance between the two sides of a joint's anchor, m: the solver's drift.
  [[nodiscard]] double joint_separation() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clamber
