#include "planner_offline/certify/failure_policy.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <future>
#include <limits>
#include <thread>

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

/// Keyframes at most kApart in time, with the first and last of every phase.
std::vector<std::size_t> keyframes_to_foresee(const Plan& plan) {
  std::vector<std::size_t> chosen;
  double looked_at = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < plan.keyframes.size(); ++k) {
    const Keyframe& keyframe = plan.keyframes[k];
    const bool last = k + 1 == plan.keyframes.size();
    const bool due = k == 0 || last || plan.keyframes[k + 1].phase != keyframe.phase ||
                     plan.keyframes[k + 1].time - looked_at > kApart;
    if (!due) continue;
    looked_at = keyframe.time;
    chosen.push_back(k);
  }
  return chosen;
}

/// What becomes of the robot from each of the keyframes, on all processors.
std::vector<Sinking> foresee(const RobotModel& model, const Scenario& scenario, const Plan& plan,
                             const std::vector<std::size_t>& keyframes) {
  std::vector<Sinking> found(keyframes.size());
  const std::size_t workers = std::max(1U, std::thread::hardware_concurrency());
  const auto work = [&](std::size_t first) {
    for (std::size_t i = first; i < keyframes.size(); i += workers) {
      const Keyframe& keyframe = plan.keyframes[keyframes[i]];
      found[i] = foresee_sinking(model, scenario, keyframe.x, keyframe.tau);
    }
  };
  std::vector<std::future<void>> others;
  for (std::size_t w = 1; w < workers; ++w)
    others.push_back(std::async(std::launch::async, work, w));
  work(0);
  for (std::future<void>& other : others) other.get();
  return found;
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
  // A phase begins where the one before ended: that keyframe is of both.
  const auto of_both = [&](std::size_t k) {
    const std::size_t next = std::min(k + 1, plan.keyframes.size() - 1);
    return std::array{&cases[static_cast<std::size_t>(plan.keyframes[k].phase)],
                      &cases[static_cast<std::size_t>(plan.keyframes[next].phase)]};
  };
  for (std::size_t k = 0; k < plan.keyframes.size(); ++k)
    for (FailureCase* phase : of_both(k))
      phase->needed = std::max(phase->needed, torque_needed(model, plan.keyframes[k]));
  const std::vector<std::size_t> keyframes = keyframes_to_foresee(plan);
  const std::vector<Sinking> found = foresee(model, scenario, plan, keyframes);
  for (std::size_t i = 0; i < keyframes.size(); ++i)
    for (FailureCase* phase : of_both(keyframes[i])) take_worse(found[i], phase->sinking);
  return cases;
}

void state_failure_policies(const RobotModel& model, const Scenario& scenario, Plan& plan) {
  const std::vector<FailureCase> cases = failure_cases(model, scenario, plan);
  for (std::size_t p = 0; p < plan.phases.size(); ++p)
    plan.phases[p].failure_policy = failure_policy(cases[p]);
}

}  // namespace clamber
