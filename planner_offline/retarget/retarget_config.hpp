// Which human segments drive which robot joints. Start-up only: allocates, reads a file, throws.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "planner_offline/retarget/chain_solver.hpp"

namespace clamber {

/// Joints that follow one another in the robot's tree and together take over the rotation from
/// one human segment to another.
struct RetargetChain {
  std::string name;                 ///< for messages
  std::string from;                 ///< human segment nearer the pelvis
  std::string to;                   ///< human segment that the chain moves
  std::vector<std::string> joints;  ///< 1 to 3 robot joints, from the parent to the child
  /// Elbows and knees: the direction of the forearm or shank, whatever the pronation.
  ChainMatch match = ChainMatch::kRotation;
};

/// A leg of the robot: its length scales the human's pelvis path.
struct RetargetLeg {
  std::string hip;   ///< first joint of the leg
  std::string sole;  ///< ContactLink of the foot
};

struct RetargetConfig {
  std::string source;                   ///< file name, for messages
  std::string base_segment = "Pelvis";  ///< human segment that the robot's base follows
  std::vector<RetargetChain> chains;
  std::vector<RetargetLeg> legs;
  /// Robot joint angles at the human's N-pose (upright, arms hanging); joints not named: 0 rad.
  std::map<std::string, double> neutral;
  double rate = 100.0;  ///< Hz of the mapped motion (paper III-A)
};

/// @throws InputError naming file, key and what was expected
[[nodiscard]] RetargetConfig load_retarget_config(const std::filesystem::path& file);

}  // namespace clamber
