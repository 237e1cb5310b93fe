// A spring-damper that leads one body of an OdeWorld along a path. Internal to sim_backend;
// threads, allocation and blocking as OdeWorld.
#pragma once

#include <ode/ode.h>

#include <optional>

#include "robot_model/types.hpp"
#include "sim_backend/ode_conversions.hpp"

namespace clamber {

/// A body that only we move, tied to the led body by a soft fixed joint.
class OdeGuide {
 public:
  /// @param com centre of mass of the led body in its frame, m
  /// @param step s
  OdeGuide(dWorldID world, dBodyID led, const Eigen::Vector3d& com, const Softness& softness,
           double step);
  OdeGuide(const OdeGuide&) = delete;
  OdeGuide& operator=(const OdeGuide&) = delete;

  void set_target(const std::optional<Pose>& X_WB) { target_ = X_WB; }
  void move();  ///< before every step
  [[nodiscard]] Eigen::Vector3d force() const { return to_eigen(feedback_.f1); }  ///< N, on the led

 private:
  void take_hold();

  dBodyID led_;
  Eigen::Vector3d com_;
  double step_;
  dBodyID guide_;
  dJointID joint_;
  dJointFeedback feedback_{};
  std::optional<Pose> target_;
  std::optional<Pose> previous_;
};

}  // namespace clamber
