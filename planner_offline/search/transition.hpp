// One change of contacts as motions: weight off what lifts, lift it, go, touch, weight on.
// Any thread (one Transition each); allocates; never blocks; deterministic.
#pragma once

#include <vector>

#include "planner_offline/search/steering.hpp"
#include "planner_offline/search/touch_sampler.hpp"
#include "planner_offline/search/way_search.hpp"

namespace clamber {

/// An edge of the contact graph. Neither lifts nor touches: only the posture changes.
struct ContactChange {
  std::vector<int> lifts;
  std::vector<Touch> touches;
};

class Transition {
 public:
  Transition(const RobotModel& model, const Scenario& scenario, const Clearance& clearance,
             const PlannerSettings& settings);

  /// Makes the change from `node`: appends the stretches it takes and moves `node` to their end.
  /// Touching postures come from the sampler; the cheapest that can be reached is taken.
  /// @param attractor  posture the robot is drawn to where contacts leave it free, rad
  /// @param skip  so many ways of making the change are passed over: they led nowhere
  /// @return why it cannot be made: nothing is appended then and `node` stays
  [[nodiscard]] Rejection make(const ContactChange& change, const JointVector& attractor,
                               Node& node, std::vector<Stretch>& stretches, std::size_t skip = 0);

 private:
  [[nodiscard]] Rejection reach(const ContactChange& change, const TouchPosture& posture,
                                double margin, Node& node, std::vector<Stretch>& stretches);
  [[nodiscard]] Rejection shift(const ContactChange& change, const TouchPosture& posture,
                                double margin, Node& node, std::vector<Stretch>& stretches);
  [[nodiscard]] Rejection go(const ContactChange& change, const TouchPosture& posture,
                             double margin, Node& node, std::vector<Stretch>& stretches);
  [[nodiscard]] MotionResult raise(const Configuration& x, const ContactSet& contacts,
                                   const std::vector<int>& links, double margin);
  [[nodiscard]] MotionResult lower(const Configuration& x, const ContactSet& contacts,
                                   const TouchPosture& posture, double margin);
  [[nodiscard]] double wanted_margin(const ContactSet& contacts) const;

  const RobotModel& model_;
  const Scenario& scenario_;
  const PlannerSettings& settings_;
  TouchSampler sampler_;
  WaySearch ways_;
  Steering steering_;
  StretchCheck check_;
};

}  // namespace clamber
