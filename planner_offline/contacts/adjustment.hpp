// Finds the obstacle height and the robot's place at which a mapped motion makes contact.
// Any thread; allocates; never blocks.
//
// The paper's authors "had to adjust the obstacle height and position of the robot several times,
// in order to make sure that both the arms and legs could make contact with the obstacle" (III-B),
// because the robot's proportions are not the person's. Here a search over both does it, on the
// kinematics of the motion alone, so that one playback in the simulator suffices. Only the obstacle
// and the robot's place as a whole are adjusted, never the motion's shape.
#pragma once

#include <vector>

#include "planner_offline/motion.hpp"
#include "robot_model/model.hpp"

namespace clamber {

struct AdjustmentConfig {
  double sample_period = 0.05;  ///< s (paper III-C)
  double threshold = 0.012;     ///< m above the top face that counts as contact
  /// Depth below the top face that the playback can push a limb out of, m (drives and guide give
  /// way). Down to half of it a touch counts fully, then less.
  double give = 0.06;
  double inset = 0.05;  ///< m from the front edge at which a touch counts fully
  double pause = 2.0;   ///< s without touch that ends an attempt
  /// Score of a placement: sum over wrists, elbows, knees and feet of t / (t + half_time), t the
  /// link's seconds of touch (a knee's only while its shank lies), so that a further link is worth
  /// more than longer touch; less the costs, each per m of the deepest overlap with the obstacle.
  double half_time = 1.5;        ///< s
  double forbidden_cost = 50.0;  ///< 1/m, torso and pelvis
  double foot_cost = 5.0;        ///< 1/m, soles (toes at the front face: they are pushed back)
  double limb_cost = 5.0;        ///< 1/m, wrist, elbow, knee beyond `give`
  double lowest = 0.12;          ///< m, obstacle heights tried (of the paper's size of task)
  double highest = 0.50;         ///< m
  double height_step = 0.005;    ///< m
  double distance_step = 0.02;   ///< m
};

/// How a motion is placed before an obstacle.
struct Adjustment {
  double obstacle_height = 0.0;  ///< m above the floor on which the climb starts
  double front = 0.0;            ///< m, x of the obstacle's front face in the motion's world
  double lateral = 0.0;          ///< m, y of the obstacle's middle in the motion's world
  double floor = 0.0;  ///< m, z of the climb's floor in the motion's world: 0 unless the recording
                       ///< holds an earlier step up
  double start = 0.0;  ///< s, part of the recording that is the climb: standing on the floor ...
  double end = 0.0;    ///< s, ... until the last contact with the obstacle is over
  double score = 0.0;
  std::vector<double> touch;  ///< s of (weighted) touch by RobotModel::contacts

  /// A configuration of the motion in the obstacle's world: front face at x = 0, floor at z = 0.
  [[nodiscard]] Configuration apply(const Configuration& x) const;
};

/// @throws InputError     the motion has no frames or no rate
/// @throws PlanningFailed no placement brings any of the contact links into contact
[[nodiscard]] Adjustment find_adjustment(const RobotModel& model, const RobotMotion& motion,
                                         const AdjustmentConfig& config);

}  // namespace clamber
