#include "planner_offline/certify/failure_policy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace clamber {
namespace {

constexpr double kGentle = 0.25;  // m/s: what drops by 3 mm is as fast
constexpr double kAtRest = 0.03;  // m/s
constexpr double kApart = 0.5;    // s between keyframes that are looked at

double torque_needed(const RobotModel& model, const Keyframe& keyframe) {
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    most = std::max(
        most, std::abs(keyframe.tau[static_cast<Eigen::Index>(j)]) - model.joints[j].friction);
  return most;
}

void take_worse(const Sinking& found, Sinking& worst) {
  worst.fastest = std::max(worst.fastest, found.fastest);
  worst.last_speed = std::max(worst.last_speed, found.last_speed);
  worst.depth = std::max(worst.depth, found.depth);
  worst.body_above = std::min(worst.body_above, found.body_above);
}

}  // namespace

FailurePolicy failure_policy(const FailureCase& worst) noexcept {
  if (worst.needed <= 0.0) return FailurePolicy::kLimp;
  const Sinking& s = worst.sinking;
  const bool gentle = s.fastest < kGentle && s.last_speed < kAtRest && s.body_above > 0.0;
  return gentle ? FailurePolicy::kLower : FailurePolicy::kHold;
}

std::vector<FailureCase> failure_cases(const RobotModel& model, const Scenario& scenario,
                                       const Plan& plan) {
  FailureCase best{.needed = -std::numeric_limits<double>::infinity(), .sinking = {}};
  best.sinking.body_above = std::numeric_limits<double>::infinity();
  std::vector<FailureCase> cases(plan.phases.size(), best);
  double looked_at = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < plan.keyframes.size(); ++k) {
    const Keyframe& keyframe = plan.keyframes[k];
    const bool last = k + 1 == plan.keyframes.size();
    // A phase begins where the one before ended: that keyframe is of both.
    const int next = last ? keyframe.phase : plan.keyframes[k + 1].phase;
    FailureCase& mine = cases[static_cast<std::size_t>(keyframe.phase)];
    FailureCase& begins = cases[static_cast<std::size_t>(next)];
    const double needed = torque_needed(model, keyframe);
    mine.needed = std::max(mine.needed, needed);
    begins.needed = std::max(begins.needed, needed);
    const bool due =
        k == 0 || last || next != keyframe.phase || plan.keyframes[k + 1].time - looked_at > kApart;
    if (!due) continue;
    looked_at = keyframe.time;
    const Sinking found = foresee_sinking(model, scenario, keyframe.x, keyframe.tau);
    take_worse(found, mine.sinking);
    take_worse(found, begins.sinking);
  }
  return cases;
}

void state_failure_policies(const RobotModel& model, const Scenario& scenario, Plan& plan) {
  const std::vector<FailureCase> cases = failure_cases(model, scenario, plan);
  for (std::size_t p = 0; p < plan.phases.size(); ++p)
    plan.phases[p].failure_policy = failure_policy(cases[p]);
}

}  // namespace clamber
