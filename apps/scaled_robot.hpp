// A robot description of another size: every file of the robot's folder, scaled.
// Start-up only: allocates, reads and writes files, throws InputError.
#pragma once

#include <filesystem>

namespace clamber {

enum class ScaledTorque {
  kWithMass,  ///< torque limits grow with the drives' mass, s^3
  kKept,      ///< the same drives in a robot of another size
};

/// Writes robot.yaml, the URDF and, where they are there, retarget.yaml and
/// control.yaml of the robot in `robot` (its robot.yaml) to `folder`, scaled by s:
///   lengths s, masses s^3, inertias s^5, torque limits by choice,
///   kp and springs s^4, damping and kd s^4.5, ki s^3.5, velocity limits s^-0.5.
/// Weight times lever grows with s^4 and a pendulum's time with s^0.5: with these gains the robot
/// sags by the same angles and swings in the same number of its own periods.
/// @throws InputError when the robot is unusable, s is outside 0.1 to 10 or a file cannot be
/// written
void write_scaled_robot(const std::filesystem::path& robot, double s, ScaledTorque torque,
                        const std::filesystem::path& folder);

}  // namespace clamber
