// Search over the contact graph: which contacts to make and break, in which order, to stand on the
// ones wanted. No recording says how; the robot's own reach and balance do.
// Start-up only: allocates; deterministic; throws PlanningFailed.
#pragma once

#include <functional>
#include <map>
#include <set>

#include "planner_offline/search/transition.hpp"

namespace clamber {

/// Changes that bring `now` nearer to the contacts of `goal`, in the order in which they are worth
/// trying: contacts given up by limbs that keep another one (lightening a limb loses no support),
/// contacts made without lifting anything, contacts of a limb exchanged, limbs taken off. Both
/// sides of a pair change together, except where a limb's contacts are exchanged.
[[nodiscard]] std::vector<ContactChange> changes_towards(const RobotModel& model,
                                                         const ContactSet& now,
                                                         const std::vector<Touch>& goal);

class GraphSearch {
 public:
  using Progress = std::function<void(const std::string& what)>;

  GraphSearch(const RobotModel& model, Transition& transition, Progress progress)
      : model_(model), transition_(transition), progress_(std::move(progress)) {}

  /// Depth first from `node`, which moves to the end; every contact set is tried from a few
  /// postures.
  /// @return the stretches; empty when it is there already
  /// @throws PlanningFailed with the change that got nearest
  [[nodiscard]] std::vector<Stretch> find(const std::vector<Touch>& goal,
                                          const JointVector& attractor, Node& node);

 private:
  void reject(const std::string& why, std::size_t left);
  [[nodiscard]] bool descend(const std::vector<Touch>& goal, const JointVector& attractor,
                             Node& node, std::vector<Stretch>& stretches);

  const RobotModel& model_;
  Transition& transition_;
  Progress progress_;
  std::map<std::set<int>, std::size_t> visits_;
  std::size_t nearest_ = 0;  // contacts still to change at `failure_`
  std::string failure_;
};

}  // namespace clamber
