#include "certificate/acceptance.hpp"

#include <algorithm>

#include "robot_model/yaml_reader.hpp"

namespace clamber {

Acceptance::Acceptance() {
  limit[Quantity::kResidualForce] = 1e-6;
  limit[Quantity::kResidualMoment] = 0.15;
  limit[Quantity::kFrictionSlack] = -1e-6;
  limit[Quantity::kTorqueSlack] = 0.0;
  limit[Quantity::kTorqueSlackHeavy] = 0.0;
  limit[Quantity::kCopSlack] = -1e-6;
  limit[Quantity::kJointSlack] = 0.0;
  limit[Quantity::kVelocitySlack] = 0.0;
  limit[Quantity::kObstacleClearance] = 0.010;
  limit[Quantity::kFloorClearance] = 0.010;
  limit[Quantity::kSelfClearance] = 0.005;
  limit[Quantity::kNearClearance] = -0.001;
  limit[Quantity::kSupportMargin] = 0.004;
  limit[Quantity::kSupportMarginMass] = -1.0;
  limit[Quantity::kSupportMarginMoving] = 0.0;
  limit[Quantity::kContactGap] = 0.0015;
  limit[Quantity::kContactDepth] = 0.003;
  limit[Quantity::kSlip] = 0.015;
  limit[Quantity::kEdgeDistance] = 0.020;
  limit[Quantity::kFeedForwardError] = 0.0333;
  for (const Quantity held :
       {Quantity::kHeightHeld, Quantity::kStartHeld, Quantity::kMassHeld, Quantity::kTiltHeld})
    limit[held] = 0.0;
}

bool operator==(const Acceptance& a, const Acceptance& b) {
  return a.uncertainty == b.uncertainty && a.limit.values == b.limit.values &&
         a.at_samples_moment == b.at_samples_moment && a.stored_tolerance == b.stored_tolerance;
}

Acceptance load_acceptance(const std::filesystem::path& file) {
  const YamlNode root = YamlNode::load(file);
  root.allow_only({"uncertainty", "limits", "residual_moment_at_samples", "stored_tolerance"});
  Acceptance acceptance;
  if (const auto node = root.find("uncertainty")) {
    node->allow_only({"friction_share", "mass_share", "height", "start_position", "start_yaw"});
    if (const auto x = node->find("friction_share"))
      acceptance.uncertainty.friction_share = x->positive();
    if (const auto x = node->find("mass_share"))
      acceptance.uncertainty.mass_share = x->non_negative();
    if (const auto x = node->find("height")) acceptance.uncertainty.height = x->non_negative();
    if (const auto x = node->find("start_position"))
      acceptance.uncertainty.start_position = x->positive();
    if (const auto x = node->find("start_yaw"))
      acceptance.uncertainty.start_yaw = x->non_negative();
    if (acceptance.uncertainty.friction_share > 1.0 || acceptance.uncertainty.mass_share >= 0.5)
      node->fail("expected a friction_share up to 1 and a mass_share below 0.5");
  }
  if (const auto node = root.find("limits"))
    for (const auto& [name, value] : node->entries()) {
      const auto* info = std::find_if(
          kQuantities.begin(), kQuantities.end(),
          [&key = name](const auto& q) { return key == q.name && q.sense != Sense::kRecord; });
      if (info == kQuantities.end()) value.fail("not a quantity that is judged");
      acceptance.limit.values[static_cast<std::size_t>(info - kQuantities.begin())] =
          value.number();
    }
  if (const auto x = root.find("residual_moment_at_samples"))
    acceptance.at_samples_moment = x->positive();
  if (const auto x = root.find("stored_tolerance")) acceptance.stored_tolerance = x->positive();
  return acceptance;
}

}  // namespace clamber
