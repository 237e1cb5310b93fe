// Loads a robot file (robot.yaml beside its URDF). Start-up only: allocates, reads files, throws.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include "robot_model/model.hpp"

namespace clamber {

/// Unusable input: the message names the file, the line or key, and what was expected.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct LoadOptions {
  double ballast_scale = 0.0;  ///< 1: apply the robot file's ballast entry; 0: leave it out
};

/// Loads `robot_yaml` and the URDF it names. Up to 32 revolute joints, floating base.
/// @throws InputError
[[nodiscard]] RobotModel load_robot(const std::filesystem::path& robot_yaml,
                                    const LoadOptions& options = {});

}  // namespace clamber
