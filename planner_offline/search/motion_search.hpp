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

/// The contacts that have to hold all through a stretch: while weight goes over, the smaller set.
[[nodiscard]] const ContactSet& carrying(const Stretch& stretch);

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

/// One way of swinging a limb to its place; tried in order, the plain one first.
struct SwingWay {
  double height = 0.0;   ///< m above the surface
  double outward = 0.0;  ///< m the swing passes outside of the straight way
  double back = 0.0;     ///< m the limb is lifted behind the straight way, off the obstacle
};

/// Why a candidate does not do, and by how far (m; a nominal length where it is not a distance).
struct Rejection {
  std::string why;  ///< empty: it does
  double shortfall = 0.0;
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
  struct Node {
    Configuration x;
    ContactSet contacts;
  };
  [[nodiscard]] bool descend(std::size_t index, const Node& node);
  [[nodiscard]] bool try_keyframe(std::size_t index, const TouchKeyframe& keyframe,
                                  const Node& node);
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
  [[nodiscard]] Rejection check(const std::vector<Stretch>& stretches);
  [[nodiscard]] SupportRegion region_of(const Configuration& x, const ContactSet& contacts);
  void settle(const Node& node);
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
};

}  // namespace clamber
