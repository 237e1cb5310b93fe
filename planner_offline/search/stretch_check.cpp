#include "planner_offline/search/stretch_check.hpp"

#include <algorithm>
#include <cstdio>

#include "planner_offline/certify/support_region.hpp"

namespace clamber {

Rejection StretchCheck::check(const Stretch& stretch, const Configuration& x) {
  char text[256];
  forward_kinematics(model_, x, data_);
  // The inverse kinematics keeps the margin to first order only.
  const double margin =
      SupportRegion(contact_points(model_, data_, carrying(stretch))).margin(data_.com.head<2>());
  const double least = 0.75 * settings_.search.support_margin;
  if (margin < least) {
    std::snprintf(text, sizeof text, "%s: centre of mass keeps %.1f cm of %.1f cm support margin",
                  stretch.name.c_str(), 100.0 * margin, 100.0 * least);
    return {text, least - margin};
  }
  const ForceSolution solution = forces_.solve(data_, stretch.contacts);
  if (solution.status == Equilibrium::kBalance) {
    return {stretch.name + ": no contact forces within the friction cones balance the robot",
            kNominalShortfall};
  }
  if (solution.status == Equilibrium::kTorque) {
    const Joint& joint = model_.joints[static_cast<std::size_t>(solution.peak_joint)];
    std::snprintf(text, sizeof text, "%s: %s needs %.1f N m of %.1f", stretch.name.c_str(),
                  joint.name.c_str(), solution.peak_torque,
                  joint.torque_limit * settings_.forces.torque_share);
    return {text, kNominalShortfall};
  }
  return {};
}

Rejection StretchCheck::check(const std::vector<Stretch>& stretches) {
  constexpr std::size_t kEvery = 3;
  for (const Stretch& stretch : stretches) {
    const std::size_t last = stretch.path.size() - 1;
    for (std::size_t i = 0; i <= last; i = i == last ? last + 1 : std::min(i + kEvery, last)) {
      Rejection rejection = check(stretch, stretch.path[i]);
      if (!rejection.why.empty()) {
        return rejection;
      }
    }
  }
  return {};
}

std::string names_of(const RobotModel& model, const std::vector<int>& links) {
  std::string name;
  for (const int link : links) {
    name += (name.empty() ? "" : "+") + model.contacts[static_cast<std::size_t>(link)].name;
  }
  return name;
}

}  // namespace clamber
