// The direction in joint space that takes load off the worst joints of a posture at rest.
// Any thread (one TorqueRelief each); allocates; never blocks.
#pragma once

#include "planner_offline/certify/contact_forces.hpp"

namespace clamber {

/// Measure sum (tau_i / limit_i)^4 over the torques of ContactForces: the fourth power looks at the
/// worst joints. Beyond the paper, which checks torques only after execution (Fig. 7).
class TorqueRelief {
 public:
  TorqueRelief(const RobotModel& model, const ForceSettings& settings)
      : model_(model), forces_(model, settings) {}

  /// Infinite where no contact forces balance the robot.
  [[nodiscard]] double measure(const Configuration& x, const ContactSet& contacts);
  /// Joint displacement down the measure's gradient, its largest entry `step` rad; by finite
  /// differences. Joints whose probe loses balance are left alone; zero where measure_here is
  /// infinite.
  [[nodiscard]] JointVector direction(const Configuration& x, const ContactSet& contacts,
                                      double measure_here, double step);

 private:
  const RobotModel& model_;
  ContactForces forces_;
  RobotData data_;
};

}  // namespace clamber
