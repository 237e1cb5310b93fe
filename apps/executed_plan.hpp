// What is executed, for those who watch over telemetry.
// Any thread; allocates; blocks: never.
#pragma once

#include <string>
#include <vector>

#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct ExecutedPlan {
  std::string sha256;  ///< of the plan file
  std::string urdf;    ///< the robot's, whole; may be empty
  std::vector<DescribedPhase> phases;
};

}  // namespace clamber
