#include "planner_offline/contacts/standing_leg.hpp"

#include <algorithm>

namespace clamber {
namespace {

/// Height of a knee over its sole, as a share of their distance, from which the shank stands.
constexpr double kStandingShank = 0.8;

}  // namespace

Eigen::Vector3d sole_middle(const ContactLink& foot, const RobotData& data) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& corner : foot.points) {
    sum += data.X_WB[static_cast<std::size_t>(foot.body)] * corner;
  }
  return sum / static_cast<double>(foot.points.size());
}

const ContactLink* foot_of(const RobotModel& model, const ContactLink& link) {
  const auto foot = std::find_if(
      model.contacts.begin(), model.contacts.end(),
      [&](const ContactLink& other) { return other.is_patch && other.limb == link.limb; });
  return foot == model.contacts.end() ? nullptr : &*foot;
}

bool upright_over_foot(const RobotModel& model, const ContactLink& link, const RobotData& data) {
  const ContactLink* foot = foot_of(model, link);
  if (foot == nullptr || link.is_patch) {
    return false;
  }
  const Eigen::Vector3d knee = data.X_WB[static_cast<std::size_t>(link.body)] * link.points.front();
  const Eigen::Vector3d up = knee - sole_middle(*foot, data);
  return up.z() > kStandingShank * up.norm();
}

}  // namespace clamber
