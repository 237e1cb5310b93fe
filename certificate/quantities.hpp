// What a certificate states about every sample: names, units and which way is worse.
// Plain data.
#pragma once

#include <array>
#include <cstddef>

namespace clamber {

enum class Quantity : unsigned char {
  kResidualForce,      ///< |weight + contact forces|
  kResidualMoment,     ///< |moment of all forces about the centre of mass|
  kFrictionSlack,      ///< least mu f_z - |f_t| over the touching points, at the certified mu
  kTorqueSlack,        ///< least limit - |tau|
  kTorqueSlackHeavy,   ///< the same if all masses were larger by the certified share
  kCopSlack,           ///< least distance of a loaded sole's centre of pressure to the sole's edge
  kJointSlack,         ///< least distance to a joint limit
  kVelocitySlack,      ///< least distance to a velocity limit
  kObstacleClearance,  ///< links that shall not touch, to the obstacles
  kFloorClearance,     ///< the same to the floor
  kSelfClearance,      ///< the robot file's pairs of its own links
  kNearClearance,      ///< links that lie beside a contact or are on their way, to that surface
  kSupportMargin,      ///< centre of mass inside the support region
  kSupportMarginMass,  ///< the same after the worst shift by single links' mass errors
  kSupportMarginMoving,  ///< the same of the zero-moment point: inertia counted, not only weight
  kContactGap,           ///< farthest that a touching point is above its surface
  kContactDepth,         ///< farthest that one is below it
  kSlip,                 ///< farthest that a touching point's material has moved since it touched
  kEdgeDistance,         ///< least distance of a touching point from the edge of its surface
  kFeedForwardError,  ///< largest |plan's interpolated torque - that of the witness forces|, share
                      ///< of the strongest joint's limit
  kHeightHeld,        ///< largest error of the obstacle's height at which nothing is hit
  kStartHeld,  ///< largest share of the start's uncertainty at which nothing is hit and contacts
               ///< stay on their surfaces, the height wrong as well
  kMassHeld,   ///< largest share that every single mass may be wrong by, as to torques and cones
  kTiltHeld,   ///< largest angle of the ground at which the centre of mass stays supported
  kComX,       ///< records, not judged: the centre of mass
  kComY,
  kComZ,
};
inline constexpr std::size_t kQuantityCount = 27;

enum class Sense : unsigned char { kSlack, kError, kRecord };

struct QuantityInfo {
  const char* name;
  const char* unit;
  Sense sense;
};

inline constexpr std::array<QuantityInfo, kQuantityCount> kQuantities = {{
    {"residual_force", "N", Sense::kError},
    {"residual_moment", "N m", Sense::kError},
    {"friction_slack", "N", Sense::kSlack},
    {"torque_slack", "N m", Sense::kSlack},
    {"torque_slack_heavy", "N m", Sense::kSlack},
    {"cop_slack", "m", Sense::kSlack},
    {"joint_slack", "rad", Sense::kSlack},
    {"velocity_slack", "rad/s", Sense::kSlack},
    {"obstacle_clearance", "m", Sense::kSlack},
    {"floor_clearance", "m", Sense::kSlack},
    {"self_clearance", "m", Sense::kSlack},
    {"near_clearance", "m", Sense::kSlack},
    {"support_margin", "m", Sense::kSlack},
    {"support_margin_mass", "m", Sense::kSlack},
    {"support_margin_moving", "m", Sense::kSlack},
    {"contact_gap", "m", Sense::kError},
    {"contact_depth", "m", Sense::kError},
    {"slip", "m", Sense::kError},
    {"edge_distance", "m", Sense::kSlack},
    {"feed_forward_error", "1", Sense::kError},
    {"height_held", "m", Sense::kSlack},
    {"start_held", "1", Sense::kSlack},
    {"mass_held", "1", Sense::kSlack},
    {"tilt_held", "rad", Sense::kSlack},
    {"com_x", "m", Sense::kRecord},
    {"com_y", "m", Sense::kRecord},
    {"com_z", "m", Sense::kRecord},
}};

/// One number per quantity.
struct QuantityValues {
  std::array<double, kQuantityCount> values{};
  [[nodiscard]] double& operator[](Quantity q) { return values[static_cast<std::size_t>(q)]; }
  [[nodiscard]] double operator[](Quantity q) const { return values[static_cast<std::size_t>(q)]; }
};

}  // namespace clamber
