// Back-tracking search for the intermediate postures that connect contact states (paper IV-D).
// Start-up only: allocates; one search per object.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "planner_offline/references/reference_optimiser.hpp"
#include "planner_offline/search/move.hpp"
#include "planner_offline/search/steering.hpp"

namespace clamber {

/// A stretch of the climb during which nothing lands or lifts.
struct Stretch {
  enum class Kind {
    kMotion,  ///< the posture moves, `contacts` carry
    kLoad,    ///< the posture rests, weight goes over from `contacts` to `next_contacts`
  };
  std::string name;
  Kind kind = Kind::kMotion;
  std::vector<Configuration> path;
  ContactSet contacts;
  ContactSet next_contacts;  ///< kLoad only
  std::vector<int> landing;  ///< kMotion: links on their way to a surface, or just off one
};

struct SearchResult {
  bool success = false;
  std::vector<Stretch> stretches;
  std::vector<TouchKeyframe> keyframes;  ///< one per move
  std::vector<std::string> rejected;     ///< why each candidate that failed was given up
  std::string failure;                   ///< the furthest move and why it fails
  std::size_t candidates_tried = 0;
  std::size_t backtracks = 0;
};

/// One way of making a move once its keyframe stands; tried in order, the plain one first.
struct Candidate {
  double shift_margin = 0.0;  ///< m, support margin aimed at before a contact lifts
  double swing_height = 0.0;  ///< m above the surface
  double outward = 0.0;       ///< m the swing passes outside of the straight way
  double back = 0.0;          ///< m the limb is lifted behind the straight way, off the obstacle
};

class MotionSearch {
 public:
  using Progress = std::function<void(int move, int of, const std::string& what)>;

  MotionSearch(const RobotModel& model, const Scenario& scenario, const Clearance& clearance,
               const PlannerSettings& settings, ReferenceOptimiser& references);

  [[nodiscard]] SearchResult run(const Configuration& start, const std::vector<Move>& moves,
                                 const Progress& progress);

 private:
  struct Node {
    Configuration x;
    ContactSet contacts;
  };
  [[nodiscard]] bool descend(std::size_t index, const Node& node);
  [[nodiscard]] bool try_candidate(std::size_t index, const Candidate& candidate,
                                   const TouchKeyframe& keyframe, const Node& node);
  [[nodiscard]] bool is_there_already(const Move& move, const Node& node) const;
  void reject(std::size_t index, const std::string& why);
  [[nodiscard]] std::string shift_weight(const Move& move, const Candidate& candidate,
                                         const TouchKeyframe& keyframe, Node& node,
                                         std::vector<Stretch>& stretches);
  [[nodiscard]] std::string swing(const Move& move, const Candidate& candidate,
                                  const TouchKeyframe& keyframe, Node& node,
                                  std::vector<Stretch>& stretches);
  [[nodiscard]] std::string check(const Stretch& stretch);
  [[nodiscard]] SupportRegion region_of(const Configuration& x, const ContactSet& contacts);
  void settle(const Node& node);
  [[nodiscard]] double steadiness(const std::vector<Stretch>& stretches);
  [[nodiscard]] double margin_for(const ContactSet& contacts) const;
  [[nodiscard]] std::string name_of(const std::vector<int>& links) const;

  const RobotModel& model_;
  const Scenario& scenario_;
  const Clearance& clearance_;
  PlannerSettings settings_;
  ReferenceOptimiser& references_;
  Steering steering_;
  ContactForces forces_;
  const std::vector<Move>* moves_ = nullptr;
  Progress progress_;
  SearchResult result_;
  std::size_t furthest_ = 0;
  std::size_t budget_ = 0;  // candidates_tried at which the present attempt is given up
};

}  // namespace clamber
