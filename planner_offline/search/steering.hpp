// Moves a posture step by step towards a goal while every step keeps contacts, support and
// clearance. Any thread (one Steering each); allocates; never blocks.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "planner_offline/certify/torque_relief.hpp"
#include "planner_offline/settings.hpp"

namespace clamber {

/// A contact link on its way: `path` holds where its touch point goes, the last one on a surface.
struct Swing {
  int link = 0;
  std::vector<Eigen::Vector3d> path;
  bool lands = true;  ///< the last stretch comes down: height first, place second
  std::optional<Eigen::Matrix3d> orientation;  ///< of the link's body on that stretch: a level sole
};

/// What a motion keeps and what it wants, in falling priority: contacts, swings, centre of mass,
/// posture.
struct MotionGoal {
  ContactSet contacts;
  std::vector<Swing> swings;
  double region_margin = 0.0;  ///< m, the CoM stays inside the region of `contacts` by this much
  ContactSet reach_contacts;  ///< these are to carry: done only once the CoM is in their region ...
  double reach_margin = 0.0;  ///< ... by this much, m
  double com_margin = 0.0;    ///< m, the CoM is brought to this far inside of it ...
  Eigen::Vector2d com = Eigen::Vector2d::Zero();  ///< ... at the place nearest to this one, m
  std::optional<JointVector> posture;             ///< rad
};

struct MotionResult {
  bool reached = false;
  std::string reason;               ///< why not
  double shortfall = 0.0;           ///< m by which swing or centre of mass misses its goal
  std::vector<Configuration> path;  ///< first entry: where it started
};

class Steering {
 public:
  Steering(const RobotModel& model, const Clearance& clearance, const PlannerSettings& settings)
      : model_(model),
        settings_(settings),
        ik_(model, clearance, settings.ik),
        relief_(model, settings.forces) {}

  [[nodiscard]] MotionResult move(const Configuration& start, const MotionGoal& goal);

 private:
  struct Progress;
  [[nodiscard]] TaskStack stack_for(const Configuration& x, const MotionGoal& goal,
                                    Progress& progress);
  [[nodiscard]] Task swing_tasks(const MotionGoal& goal, Progress& progress, Task& places) const;

  [[nodiscard]] double reach_kept(const MotionGoal& goal) const;
  [[nodiscard]] Eigen::VectorXd posture_error(const Configuration& x, const MotionGoal& goal);

  const RobotModel& model_;
  const PlannerSettings& settings_;
  PostureIk ik_;
  TorqueRelief relief_;
  RobotData data_;
};

}  // namespace clamber
