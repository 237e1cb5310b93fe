// A way between two postures that stand on the same contacts: two trees that grow towards each
// other (RRT-Connect; Kuffner, LaValle, ICRA 2000) within what contacts, support, torques and
// clearance leave free. Any thread (one WaySearch each); allocates; never blocks; deterministic.
#pragma once

#include <random>
#include <vector>

#include "planner_offline/search/stretch_check.hpp"

namespace clamber {

/// What holds all along the way.
struct WayRules {
  ContactSet contacts;         ///< carry
  std::vector<int> landing;    ///< links just off a surface or on their way to one
  double region_margin = 0.0;  ///< m, of the centre of mass in the contacts' region
};

class WaySearch {
 public:
  WaySearch(const RobotModel& model, const Clearance& clearance, const PlannerSettings& settings);

  /// Postures from `from` on, each an inverse-kinematics step after the one before, the last one
  /// with the joint angles of `to`; empty: none found in search.most_way_nodes. Contacts roll
  /// along, so that where rolling is concerned the end may lie a little beside `to`.
  [[nodiscard]] std::vector<Configuration> find(const Configuration& from, const Configuration& to,
                                                const WayRules& rules);

 private:
  struct Vertex {
    Configuration x;
    ContactSet contacts;  // with their slip on the way here
    int parent = -1;
    std::vector<Configuration> path;  // from the parent, ends in x
  };
  using Tree = std::vector<Vertex>;
  enum class Reached { kNo, kPartly, kFully };

  [[nodiscard]] Reached extend(Tree& tree, int from, const JointVector& to, const WayRules& rules,
                               int steps);
  [[nodiscard]] bool step(Vertex& vertex, const JointVector& to, const WayRules& rules);
  [[nodiscard]] Reached connect(Tree& tree, const JointVector& to, const WayRules& rules);
  [[nodiscard]] std::vector<Configuration> follow(const Configuration& from,
                                                  const std::vector<Configuration>& way,
                                                  const WayRules& rules);
  [[nodiscard]] JointVector target(const Configuration& from, const Configuration& to);

  const RobotModel& model_;
  const PlannerSettings& settings_;
  PostureIk ik_;
  ContactForces forces_;
  std::mt19937 random_;
};

}  // namespace clamber
