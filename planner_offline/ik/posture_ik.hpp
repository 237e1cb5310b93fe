// One step of the inverse kinematics: a task stack under joint, collision and support constraints.
// Any thread (one PostureIk each); allocates; never blocks.
#pragma once

#include <string>

#include "planner_offline/certify/support_region.hpp"
#include "planner_offline/clearance/clearance.hpp"
#include "planner_offline/ik/hqp.hpp"
#include "planner_offline/ik/task.hpp"

namespace clamber {

struct IkSettings {
  double limit_margin = 0.03;  ///< rad kept from the joint limits
  double joint_step = 0.05;    ///< rad, velocity bound of one iteration
  double base_step = 0.02;     ///< m
  double base_turn = 0.05;     ///< rad
};

/// What one step has to respect besides its tasks.
struct IkConstraints {
  const ContactSet* contacts = nullptr;   ///< links that may touch
  std::vector<int> landing;               ///< contact links on their way to a surface
  const SupportRegion* region = nullptr;  ///< keep the centre of mass in here ...
  double region_margin = 0.0;             ///< ... by this much, m
  bool collisions = true;
};

class PostureIk {
 public:
  PostureIk(const RobotModel& model, const Clearance& clearance, const IkSettings& settings)
      : model_(model), clearance_(clearance), settings_(settings) {}

  /// Displacement dv that advances `stack` from configuration x (data: its kinematics).
  /// Where recovering from violated margins is impossible it holds them instead.
  [[nodiscard]] HqpStatus step(const Configuration& x, const RobotData& data,
                               const TaskStack& stack, const IkConstraints& constraints,
                               VelocityVector& dv);

  /// What holds a posture back that does not get where it should: joints at their limits, the links
  /// nearest to the obstacle and to each other where they are at their clearance; as text that
  /// follows a reason, empty: none of these.
  [[nodiscard]] std::string binding(const Configuration& x, const RobotData& data,
                                    const IkConstraints& constraints) const;

 private:
  void bound(const Configuration& x, bool may_recover, HqpProblem& problem) const;
  void keep_in_region(const RobotData& data, const IkConstraints& constraints, bool may_recover,
                      Inequalities& rows) const;

  const RobotModel& model_;
  const Clearance& clearance_;
  IkSettings settings_;
  Hqp hqp_;
};

/// The task's error shortened to `most` in its largest entry, so that paths stay straight.
[[nodiscard]] Eigen::VectorXd shortened(const Eigen::VectorXd& e, double most);

}  // namespace clamber
