// A spring-damper that leads one body of an OdeWorld along a path. Internal to sim_backend;
// threads, allocation and blocking as OdeWorld.
#pragma once

#include <ode/ode.h>

#include <optional>

#include "robot_model/types.hpp"
#include "sim_backend/ode_world.hpp"

namespace clamber {

/// A body that only we move, tied to the led body by a soft fixed joint. As all joints it starts
/// from its wrench of the step before: this is applied to the led body, and the guide stands back
/// by what the spring gives under it.
class OdeGuide {
 public:
  /// @param com centre of mass of the led body in its frame, m
  OdeGuide(dWorldID world, dBodyID led, const Eigen::Vector3d& com, const OdeOptions& options);
  OdeGuide(const OdeGuide&) = delete;
  OdeGuide& operator=(const OdeGuide&) = delete;

  void set_target(const std::optional<Pose>& X_WB) { target_ = X_WB; }
  void move();                                                           ///< before every step
  void read();                                                           ///< after every step
  [[nodiscard]] const Eigen::Vector3d& force() const { return force_; }  ///< N, on the led body

 private:
  void take_hold();
  void let_go();

  dBodyID led_;
  Eigen::Vector3d com_;
  const OdeOptions& options_;
  dBodyID guide_;
  dJointID joint_;
  dJointFeedback feedback_{};
  std::optional<Pose> target_;
  std::optional<Pose> previous_;
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();   ///< at the centre of mass, N
  Eigen::Vector3d torque_ = Eigen::Vector3d::Zero();  ///< N m
};

}  // namespace clamber
