#include "tools/human_figure.hpp"

namespace clamber::tools {

const std::array<SegmentSpec, kSegmentCount>& segment_specs() {
  static const std::array<SegmentSpec, kSegmentCount> specs{{
      {"Pelvis", -1, ""},
      {"L5", kPelvis, "jL5S1"},
      {"L3", kL5, "jL4L3"},
      {"T12", kL3, "jL1T12"},
      {"T8", kT12, "jT9T8"},
      {"Neck", kT8, "jT1C7"},
      {"Head", kNeck, "jC1Head"},
      {"RightShoulder", kT8, "jRightT4Shoulder"},
      {"RightUpperArm", kRightShoulder, "jRightShoulder"},
      {"RightForeArm", kRightUpperArm, "jRightElbow"},
      {"RightHand", kRightForeArm, "jRightWrist"},
      {"LeftShoulder", kT8, "jLeftT4Shoulder"},
      {"LeftUpperArm", kLeftShoulder, "jLeftShoulder"},
      {"LeftForeArm", kLeftUpperArm, "jLeftElbow"},
      {"LeftHand", kLeftForeArm, "jLeftWrist"},
      {"RightUpperLeg", kPelvis, "jRightHip"},
      {"RightLowerLeg", kRightUpperLeg, "jRightKnee"},
      {"RightFoot", kRightLowerLeg, "jRightAnkle"},
      {"RightToe", kRightFoot, "jRightBallFoot"},
      {"LeftUpperLeg", kPelvis, "jLeftHip"},
      {"LeftLowerLeg", kLeftUpperLeg, "jLeftKnee"},
      {"LeftFoot", kLeftLowerLeg, "jLeftAnkle"},
      {"LeftToe", kLeftFoot, "jLeftBallFoot"},
  }};
  return specs;
}

Skeleton::Skeleton(double body_height)
    : height(body_height),
      hip_height(0.530 * body_height),
      ankle_height(0.039 * body_height),
      thigh((0.530 - 0.285) * body_height),
      shank((0.285 - 0.039) * body_height),
      upper_arm(0.186 * body_height),
      forearm(0.146 * body_height),
      hand(0.108 * body_height),
      toe_reach(0.114 * body_height),
      heel_reach(0.038 * body_height) {
  const double H = body_height;
  offset.fill(Eigen::Vector3d::Zero());
  tip.fill(Eigen::Vector3d::Zero());
  offset[kL5] = {0.0, 0.0, 0.0555 * H};
  offset[kL3] = {0.0, 0.0, 0.0575 * H};
  offset[kT12] = {0.0, 0.0, 0.0520 * H};
  offset[kT8] = {0.0, 0.0, 0.0520 * H};
  offset[kNeck] = {0.0, 0.0, 0.0755 * H};
  offset[kHead] = {0.0, 0.0, 0.0500 * H};
  tip[kHead] = {0.0, 0.0, 0.1275 * H};
  for (int side = 0; side < 2; ++side) {
    const auto s = static_cast<std::size_t>(side);
    const double left = side == 0 ? -1.0 : 1.0;
    const auto at = [](int segment) { return static_cast<std::size_t>(segment); };
    offset[at(kUpperArm[s] - 1)] = {0.0, left * 0.017 * H, 0.0710 * H};
    offset[at(kUpperArm[s])] = {0.0, left * 0.098 * H, 0.0};
    offset[at(kForeArm[s])] = {0.0, 0.0, -upper_arm};
    offset[at(kHand[s])] = {0.0, 0.0, -forearm};
    tip[at(kHand[s])] = {0.0, 0.0, -hand};
    offset[at(kUpperLeg[s])] = {0.0, left * 0.04775 * H, 0.0};
    offset[at(kLowerLeg[s])] = {0.0, 0.0, -thigh};
    offset[at(kFoot[s])] = {0.0, 0.0, -shank};
    offset[at(kToe[s])] = {0.071 * H, 0.0, -0.029 * H};
    tip[at(kToe[s])] = {0.043 * H, 0.0, -0.010 * H};
  }
}

void place_segments(const Skeleton& skeleton, Figure& figure) {
  const auto& specs = segment_specs();
  for (std::size_t i = 1; i < kSegmentCount; ++i) {
    const auto parent = static_cast<std::size_t>(specs[i].parent);
    figure.p[i] = figure.p[parent] + figure.R[parent] * skeleton.offset[i];
  }
}

}  // namespace clamber::tools
