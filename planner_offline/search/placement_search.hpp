// Search over where a climb's contacts are put: the demonstrator is not the robot.
// Start-up only: allocates; uses several threads; deterministic whatever their number.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "planner_offline/search/motion_search.hpp"

namespace clamber {

/// How all contact references of a climb differ from the recording's. m
struct Placing {
  double arms_forward = 0.0;  ///< over the obstacle
  double arms_apart = 0.0;    ///< each side outwards
  /// The arm on the side of the leg that leaves the floor last comes nearer to the edge: the line
  /// from it to the other knee bounds the support when that leg lifts.
  double last_side_back = 0.0;
  double legs_inward = 0.0;   ///< knees towards the robot's middle
  double legs_forward = 0.0;  ///< over the obstacle
};

struct ClimbSearch {
  SearchResult best;                  ///< the steadiest climb, else the furthest attempt
  std::vector<CostSample> costs;      ///< every iteration of all reference optimisations
  std::vector<std::string> rejected;  ///< why each candidate of all attempts was given up
  std::size_t attempts = 0;
  std::size_t candidates = 0;
  std::size_t backtracks = 0;
  std::string given_up;          ///< where there is no climb: why the search ended
  double reference_share = 0.0;  ///< of the processor time that reference optimisation took
};

/// Why a climb that was found does not do after all; empty: it does.
using ClimbCheck = std::function<std::string(const SearchResult&)>;

/// Plans the whole climb with the recorded places, then around the best ones found so far, until
/// one that `check` has nothing against is steady enough, attempts or candidates are used up, or
/// the furthest attempt misses its goal by more than finer places could mend.
/// @param check  called from the calling thread only
[[nodiscard]] ClimbSearch search_climb(const RobotModel& model, const Scenario& scenario,
                                       const Clearance& clearance, const PlannerSettings& settings,
                                       const Configuration& start, const std::vector<Move>& moves,
                                       const ClimbCheck& check,
                                       const MotionSearch::Progress& progress);

}  // namespace clamber
