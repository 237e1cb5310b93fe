// Acclaim motion capture: a skeleton (.asf) and joint angles for it (.amc).
// Start-up only: allocates, never blocks, throws InputError.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "planner_offline/recording/human_motion.hpp"

namespace clamber {

/// AMC files carry no rate; the CMU database, where most of them come from, records at 120 Hz.
inline constexpr double kDefaultAmcRate = 120.0;  ///< Hz

struct AcclaimBone {
  std::string name;
  int parent = -1;                                     ///< index into bones, -1: the root
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();    ///< start to end at zero angles, m
  Eigen::Matrix3d axis = Eigen::Matrix3d::Identity();  ///< frame in which the angles turn
  std::vector<char> dof;  ///< 'x', 'y', 'z' in the order in which the angles are given
};

/// A skeleton in the file's own axes (y up).
struct AcclaimSkeleton {
  double length_unit = 1.0;             ///< m per unit of length
  double angle_unit = 1.0;              ///< rad per unit of angle
  std::vector<std::string> root_order;  ///< TX ... RZ
  Eigen::Matrix3d root_axis = Eigen::Matrix3d::Identity();
  Eigen::Vector3d root_position = Eigen::Vector3d::Zero();  ///< m
  std::vector<AcclaimBone> bones;                           ///< parents first
};

/// @throws InputError (file, line, what was expected)
[[nodiscard]] AcclaimSkeleton parse_asf(std::string_view bytes, const std::string& source);

/// Joint positions of every frame, world z up, with the labels that add_segments() reads.
/// @throws InputError (file, line, what was expected)
[[nodiscard]] HumanMotion parse_amc(std::string_view bytes, const std::string& source,
                                    const AcclaimSkeleton& skeleton, double rate = kDefaultAmcRate);

}  // namespace clamber
