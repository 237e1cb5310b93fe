// What follows the climb onto all fours: standing up, walking on top, the way down.
// Start-up only: allocates; deterministic; throws PlanningFailed.
#pragma once

#include "planner_offline/search/graph_search.hpp"

namespace clamber {

/// Where a robot stands: middle between its soles and the way it faces.
struct Stance {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< m, world
  double heading = 0.0;                                ///< rad
};

class GoalSearch {
 public:
  /// Share done, 0..1, and what was done.
  using Progress = std::function<void(double share, const std::string& what)>;

  GoalSearch(const RobotModel& model, const Scenario& scenario, const Clearance& clearance,
             const PlannerSettings& settings, Progress progress);

  /// The climb's stretches and what the scenario's goal asks for after them.
  ///
  /// back_down: the climb played backwards; what stands still in each posture does so on the way
  /// back. over: the robot stands up, walks to where the whole of it, turned by 180 degrees about
  /// the middle of the obstacle, would have stood up, kneels down as it stood up and climbs down
  /// as it climbed up.
  /// @throws PlanningFailed naming the change of contacts that could not be made
  [[nodiscard]] std::vector<Stretch> complete(std::vector<Stretch> climb);

 private:
  [[nodiscard]] std::vector<Stretch> stand_up(Node& node);
  [[nodiscard]] std::vector<Stretch> walk(Node& node, const std::vector<Touch>& to);
  [[nodiscard]] Rejection step_to(std::vector<Touch> feet, Node& node,
                                  std::vector<Stretch>& stretches);
  [[nodiscard]] std::vector<Stretch> close_up(Node& node, const Configuration& to);
  [[nodiscard]] std::vector<Touch> footprints(const Stance& stance) const;
  [[nodiscard]] std::vector<Touch> soles_of(const Node& node) const;
  [[nodiscard]] std::vector<Stance> stances_near(const Node& node) const;

  const RobotModel& model_;
  const Scenario& scenario_;
  const PlannerSettings& settings_;
  Transition transition_;
  GraphSearch graph_;
  WaySearch ways_;
  Progress progress_;
};

}  // namespace clamber
