// Postures in which new contacts touch while the present ones carry, found from many starts.
// Any thread (one TouchSampler each); allocates; never blocks; deterministic.
#pragma once

#include <optional>
#include <random>
#include <vector>

#include "planner_offline/search/stretch_check.hpp"

namespace clamber {

/// A contact to be made.
struct Touch {
  int link = 0;
  int surface = kFloor;
  std::optional<Eigen::Vector3d> position;  ///< of the touch point, world, m; none: where it comes
  double heading = 0.0;                     ///< rad, of a sole about the vertical
};

/// The pose of a sole's body when the sole lies level on `touch.position` (which must be set).
[[nodiscard]] Pose sole_pose(const RobotModel& model, const Touch& touch);

struct TouchPosture {
  Configuration x;
  std::vector<Touch> touches;  ///< all with positions
  double peak_torque = 0.0;    ///< N m, the supports alone
  double distance = 0.0;       ///< rad, of the joint that is farthest from TouchRequest::near
  /// rad: 50 N m weigh as much as a joint moved by 1 rad
  [[nodiscard]] double cost() const { return distance + 0.02 * peak_torque; }
};

struct TouchRequest {
  Configuration start;
  /// Carry alone; they roll from `start` on as they do on the robot. None: the touches carry.
  ContactSet supports;
  std::vector<Touch> touches;   ///< may be empty: a posture on the supports alone
  JointVector attractor;        ///< posture towards which some of the starts are drawn, rad
  JointVector near;             ///< of the postures found those near this one are cheap, rad
  double support_margin = 0.0;  ///< m, of the centre of mass in the supports' region
};

class TouchSampler {
 public:
  TouchSampler(const RobotModel& model, const Scenario& scenario, const Clearance& clearance,
               const PlannerSettings& settings);

  /// Up to search.most_touch_postures postures out of search.touch_samples starts, the cheapest
  /// first. The first start is where the robot is, the second the attractor, all others random.
  [[nodiscard]] std::vector<TouchPosture> sample(const TouchRequest& request);

  /// What the best start of a sample() that found nothing fell short of.
  [[nodiscard]] const Rejection& failure() const { return failure_; }

 private:
  struct Attempt;
  [[nodiscard]] JointVector hint_for(const TouchRequest& request, std::size_t start);
  void relax(Attempt& attempt);
  void settle_soles(Attempt& attempt);
  [[nodiscard]] Eigen::Vector3d place(const Touch& touch, const Eigen::Vector3d& at) const;
  void reach(Attempt& attempt, double margin);
  [[nodiscard]] Task reach_task(const Attempt& attempt) const;
  [[nodiscard]] bool advance(Attempt& attempt, const TaskStack& stack, bool collisions);
  [[nodiscard]] double reach_error(const Attempt& attempt) const;
  [[nodiscard]] std::string binding(const Attempt& attempt) const;
  [[nodiscard]] Rejection judge(const Attempt& attempt, double margin, double& peak_torque);

  const RobotModel& model_;
  const Scenario& scenario_;
  const Clearance& clearance_;
  const PlannerSettings& settings_;
  PostureIk ik_;
  ContactForces forces_;
  std::mt19937 random_;
  Rejection failure_;
};

/// Rows that hold all contacts.
[[nodiscard]] Task holding(const RobotModel& model, const RobotData& data,
                           const ContactSet& contacts);

/// A normally distributed number that is the same with every standard library.
[[nodiscard]] double normal(std::mt19937& random);

}  // namespace clamber
