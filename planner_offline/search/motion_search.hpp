// Back-tracking search for the intermediate postures that connect contact states (paper IV-D).
// Start-up only: allocates; one search per object.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "planner_offline/references/reference_optimiser.hpp"
#include "planner_offline/search/move.hpp"
#include "planner_offline/search/steering.hpp"
#include "planner_offline/search/stretch_check.hpp"

namespace clamber {

struct SearchResult {
  bool success = false;
  std::vector<Stretch> stretches;
  std::vector<TouchKeyframe> keyframes;  ///< one per move
  std::vector<std::string> rejected;     ///< why each candidate that failed was given up
  std::string failure;                   ///< the furthest move and why it fails
  std::size_t furthest = 0;              ///< that move's index
  double shortfall = 0.0;  ///< m by which the best candidate for that move misses its goal
  std::size_t candidates_tried = 0;
  std::size_t backtracks = 0;
};

/// Where a climb begins: on the soles, on the floor.
[[nodiscard]] Node standing_at(const RobotModel& model, const Scenario& scenario,
                               const Configuration& start);

/// One way of swinging a limb to its place; tried in order, the plain one first.
struct SwingWay {
  double height = 0.0;   ///< m above the surface
  double outward = 0.0;  ///< m the swing passes outside of the straight way
  double back = 0.0;     ///< m the limb is lifted behind the straight way, off the obstacle
};

class MotionSearch {
 public:
  using Progress = std::function<void(int move, int of, const std::string& what)>;

  MotionSearch(const RobotModel& model, const Scenario& scenario, const Clearance& clearance,
               const PlannerSettings& settings, ReferenceOptimiser& references);

  /// Makes the moves one after the other from `start`, going back where one leads nowhere, until
  /// the last is made or `search.most_candidates` are used up.
  [[nodiscard]] SearchResult run(const Configuration& start, const std::vector<Move>& moves,
                                 const Progress& progress);

 private:
  [[nodiscard]] bool descend(std::size_t index, const Node& node);
  /// @param far_off  counts weight shifts that fell far short
  [[nodiscard]] bool try_keyframe(std::size_t index, const TouchKeyframe& keyframe,
                                  const Node& node, int& far_off);
  [[nodiscard]] bool go_on(std::size_t index, const std::vector<Stretch>& stretches,
                           const TouchKeyframe& keyframe, const Node& node);
  [[nodiscard]] bool is_there_already(const Move& move, const Node& node) const;
  [[nodiscard]] bool used_up(std::size_t index);
  void reject(std::size_t index, const Rejection& rejection);
  [[nodiscard]] Rejection shift_weight(const Move& move, double margin,
                                       const TouchKeyframe& keyframe, Node& node,
                                       std::vector<Stretch>& stretches);
  [[nodiscard]] Rejection swing(const Move& move, const SwingWay& way,
                                const TouchKeyframe& keyframe, Node& node,
                                std::vector<Stretch>& stretches);
  [[nodiscard]] SupportRegion region_of(const Configuration& x, const ContactSet& contacts);
  void settle(const Node& node);
  [[nodiscard]] double margin_for(const ContactSet& contacts) const;

  const RobotModel& model_;
  const Scenario& scenario_;
  const Clearance& clearance_;
  PlannerSettings settings_;
  ReferenceOptimiser& references_;
  Steering steering_;
  StretchCheck check_;
  const std::vector<Move>* moves_ = nullptr;
  Progress progress_;
  SearchResult result_;
  int far_off_ = 0;  ///< weight shifts that fell far short
};

}  // namespace clamber
