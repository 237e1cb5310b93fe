// What is executed, for those who watch over telemetry or look at the run afterwards.
// Any thread; allocates; read_urdf() reads files and throws InputError.
#pragma once

#include <string>
#include <vector>

#include "telemetry/telemetry_config.hpp"

namespace clamber {

struct Plan;
struct RobotModel;
struct RobotOptions;

struct ExecutedPlan {
  std::string sha256;  ///< of the plan file
  std::string urdf;    ///< the robot's, whole; may be empty
  std::vector<DescribedPhase> phases;
};

[[nodiscard]] std::string read_urdf(const RobotOptions& robot);
/// With the contacts that carry in every keyframe of a phase: those that its first one brings in or
/// its last one takes away do so on the way.
[[nodiscard]] std::vector<DescribedPhase> describe_phases(const Plan& plan,
                                                          const RobotModel& model);

}  // namespace clamber
