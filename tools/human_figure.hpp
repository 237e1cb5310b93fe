// A person's skeleton for made-up recordings: Xsens MVN's 23 segments sized by body height.
// Tools only; allocates; never blocks.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>

namespace clamber::tools {

enum Segment : int {
  kPelvis,
  kL5,
  kL3,
  kT12,
  kT8,
  kNeck,
  kHead,
  kRightShoulder,
  kRightUpperArm,
  kRightForeArm,
  kRightHand,
  kLeftShoulder,
  kLeftUpperArm,
  kLeftForeArm,
  kLeftHand,
  kRightUpperLeg,
  kRightLowerLeg,
  kRightFoot,
  kRightToe,
  kLeftUpperLeg,
  kLeftLowerLeg,
  kLeftFoot,
  kLeftToe,
  kSegmentCount
};

/// Per side: the same limb's segments. Index 0 right, 1 left.
inline constexpr std::array<int, 2> kUpperArm{kRightUpperArm, kLeftUpperArm};
inline constexpr std::array<int, 2> kForeArm{kRightForeArm, kLeftForeArm};
inline constexpr std::array<int, 2> kHand{kRightHand, kLeftHand};
inline constexpr std::array<int, 2> kUpperLeg{kRightUpperLeg, kLeftUpperLeg};
inline constexpr std::array<int, 2> kLowerLeg{kRightLowerLeg, kLeftLowerLeg};
inline constexpr std::array<int, 2> kFoot{kRightFoot, kLeftFoot};
inline constexpr std::array<int, 2> kToe{kRightToe, kLeftToe};

struct SegmentSpec {
  std::string_view label;
  int parent;              ///< -1 for the pelvis
  std::string_view joint;  ///< MVN's label of the joint to the parent
};
[[nodiscard]] const std::array<SegmentSpec, kSegmentCount>& segment_specs();

/// Lengths from the usual anthropometric ratios of body height (Drillis and Contini 1966, as in
/// Winter, Biomechanics and Motor Control of Human Movement): ankle 0.039, knee 0.285, hip 0.530,
/// shoulder 0.818 of the height above the floor; upper arm 0.186, forearm 0.146, hand 0.108,
/// foot length 0.152. Joint spacings across the body and the spine's division are ours.
struct Skeleton {
  explicit Skeleton(double body_height);
  double height;
  double hip_height, ankle_height, thigh, shank, upper_arm, forearm, hand;
  double toe_reach;   ///< ankle to tip of the toes, horizontally, foot flat
  double heel_reach;  ///< ankle to heel
  /// Joint to the parent in the parent's anatomical frame (zero for the pelvis), m.
  std::array<Eigen::Vector3d, kSegmentCount> offset;
  /// Far end of head, hands and toes in their own frame, m (zero elsewhere).
  std::array<Eigen::Vector3d, kSegmentCount> tip;
};

/// Orientation of every segment (anatomical frame to world) and the position of its origin.
struct Figure {
  std::array<Eigen::Matrix3d, kSegmentCount> R;
  std::array<Eigen::Vector3d, kSegmentCount> p;
};

/// Fills p[segment] for every segment from R and p[kPelvis].
void place_segments(const Skeleton& skeleton, Figure& figure);

}  // namespace clamber::tools
