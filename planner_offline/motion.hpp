// A human motion after import, and the robot motion it is mapped to. Start-up only.
#pragma once

#include <string>
#include <vector>

#include "robot_model/types.hpp"

namespace clamber {

/// The robot's motion mapped from a recording (paper Eq. (1)), one entry per recorded frame.
struct RobotMotion {
  std::string recording;              ///< file name it came from
  bool synthetic = false;             ///< made by a tool, not recorded from a person
  double rate = 0.0;                  ///< Hz
  double human_leg_length = 0.0;      ///< hip height when standing, m: scales the pelvis path
  std::vector<Configuration> frames;  ///< base scaled to the robot's size, joints clamped to limits
  struct ClampReport {
    std::string joint;
    double worst = 0.0;  ///< rad beyond the limit
    double share = 0.0;  ///< share of frames clamped, 0..1
  };
  std::vector<ClampReport> clamped;
};

}  // namespace clamber
