// Contact points of one OdeWorld: detection, joints, friction directions, warm start, forces.
// Internal to sim_backend; threads, allocation and blocking as OdeWorld.
#pragma once

#include <ode/ode.h>

#include <span>
#include <vector>

#include "robot_model/model.hpp"
#include "sim_backend/contact_observation.hpp"
#include "sim_backend/ode_conversions.hpp"
#include "sim_backend/ode_world.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// Every step: detect(), step the world, read_forces().
///
/// Warm start. A contact that carried the normal force N in the step before gets N and most of its
/// friction as plain forces, and two ODE contact joints for the change d of the normal force:
///   - "relief": a row along the normal bounded by -N <= d <= N (ODE bounds friction rows on both
///     sides, so this joint has its friction direction along the normal; its own normal row is made
///     infinitely soft), so that the sum never pulls;
///   - the contact proper, whose normal row takes over beyond 2 N and whose friction rows are
///     bounded around the friction already applied such that the sum stays within mu N.
/// All rows keep the contact's spring-damper: v' + cfm (N + d) = erp/step depth.
class OdeContacts {
 public:
  /// Keeps references to all arguments.
  OdeContacts(const RobotModel& model, const Scenario& scenario, const OdeOptions& options,
              dWorldID world, const std::vector<dBodyID>& bodies);
  ~OdeContacts();
  OdeContacts(const OdeContacts&) = delete;
  OdeContacts& operator=(const OdeContacts&) = delete;

  void detect();
  void read_forces();
  void forget();  ///< as if nothing had ever touched
  [[nodiscard]] std::span<const ContactObservation> observations() const { return contacts_; }

 private:
  /// What is kept of a contact point for the next step.
  struct Memory {
    ContactObservation contact;
    bool used = false;
  };

  void create_geoms();
  void collide(int geom, dGeomID other_geom, Surface surface, int other);
  void add(const dContactGeom& point, ContactObservation contact);
  void add_relief(const dContactGeom& point, const ContactObservation& contact,
                  const Eigen::Vector3d& tangent, double guess);
  void attach(const dContact& contact, dJointFeedback& feedback);
  void push(const ContactObservation& contact);
  [[nodiscard]] const ContactObservation* recall(const ContactObservation& contact);
  [[nodiscard]] Eigen::Vector3d slip_velocity(const ContactObservation& contact) const;
  [[nodiscard]] Eigen::Vector3d sticking_direction(const ContactObservation& contact,
                                                   const ContactObservation* before) const;
  [[nodiscard]] dBodyID body_of(int geom) const;

  const RobotModel& model_;
  const Scenario& scenario_;
  const OdeOptions& options_;
  const std::vector<dBodyID>& bodies_;
  dWorldID world_;
  Softness soft_;
  dJointGroupID joints_;
  dGeomID floor_ = nullptr;
  std::vector<dGeomID> obstacles_;
  std::vector<dGeomID> geoms_;
  std::vector<double> radii_;             ///< bounding radius per geom, m
  std::vector<Eigen::Vector3d> centers_;  ///< per geom, world, m
  std::vector<ContactObservation> contacts_;
  std::vector<dJointFeedback> feedback_;         ///< of the contact proper
  std::vector<dJointFeedback> relief_feedback_;  ///< zero where there is no relief
  std::vector<Memory> memory_;
};

}  // namespace clamber
