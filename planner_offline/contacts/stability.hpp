// How well contacts support the robot: paper Eq. (8), Fig. 5 and the numerical meaning of "s = 0".
// Any thread; allocates: state_stability(); blocks: never; throws: never.
#pragma once

#include <numbers>
#include <span>
#include <string_view>
#include <vector>

#include "robot_model/types.hpp"

namespace clamber {

struct StabilityConfig {
  /// Largest angle at which a contact supports its mass without sliding (paper IV-B: 35 degrees).
  double max_theta = 35.0 * std::numbers::pi / 180.0;  ///< rad
  /// Where a playback's contacts and masses are known to, m (gaps up to the contact threshold,
  /// joints off their reference): so much may s and the hull's margin miss their bounds.
  double tolerance = 0.015;
  /// The centre of mass must project this far inside the hull of the contacts, m.
  double com_margin = 0.0;
};

/// Angle theta of Fig. 5, rad, 0..pi: from the vertical through the contact to the line
/// contact -> support mass (shoulder for wrist and elbow, upper thigh for knee and foot).
[[nodiscard]] double support_angle(const Eigen::Vector3d& contact,
                                   const Eigen::Vector3d& support) noexcept;

/// s = l sin(theta) (Eq. (8)), m. l is the distance of contact and support mass as the limb is bent
/// now, not stretched, so that s is the "projection difference" the paper introduces it as. A mass
/// below its contact cannot rest on it: past 90 degrees s stays at l instead of falling again.
[[nodiscard]] double contact_stability(const Eigen::Vector3d& contact,
                                       const Eigen::Vector3d& support) noexcept;

/// A contact with the obstacle and the mass it shall carry, in one frame with z up.
struct LimbContact {
  std::string_view limb;  ///< contacts of one limb share this (ContactLink::limb)
  Eigen::Vector3d contact = Eigen::Vector3d::Zero();
  Eigen::Vector3d support = Eigen::Vector3d::Zero();
};

/// s of a state, m; exactly 0 stands for absolute stability.
///
/// The paper calls s = 0 (theta = 0) absolute stability and theta <= 35 degrees supportable, but no
/// recorded or simulated posture ever has theta = 0, so a numerical reading is needed. Here a state
/// is absolutely stable when both hold, to within `tolerance`:
///  - every limb that touches the obstacle has a contact with s <= l sin(max_theta): inside that
///  cone
///    the contact carries its mass without sliding (Fig. 5 b), outside it slides (Fig. 5 c). Wrist
///    and elbow of one arm share one shoulder: where both touch, whichever is better carries it
///    (with a planted forearm they can never both be below the shoulder);
///  - the centre of mass projects into the hull of all contacts, soles on the floor included
///    (IV-B: the measure is to be used in conjunction with the support polygon).
/// Otherwise s is the largest of: the best Eq. (8) value of each limb outside its cone, and the
/// distance by which the centre of mass misses the hull.
///
/// @param loaded contacts with the obstacle
/// @param support_points every point that touches anything, floor included
[[nodiscard]] double state_stability(std::span<const LimbContact> loaded,
                                     std::span<const Eigen::Vector3d> support_points,
                                     const Eigen::Vector3d& com, const StabilityConfig& config);

/// Distance of a point's projection to the boundary of the points' convex hull in the horizontal
/// plane, m: positive inside, negative outside. Minus infinity without points.
[[nodiscard]] double hull_margin(std::span<const Eigen::Vector3d> points,
                                 const Eigen::Vector3d& point);

}  // namespace clamber
