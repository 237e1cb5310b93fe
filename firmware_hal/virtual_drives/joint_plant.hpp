// What virtual drives turn: the joints of a robot, simulated somehow. One thread at a time; whether
// it allocates is the plant's affair.
#pragma once

#include <span>

namespace clamber {

struct JointMotion {
  double q = 0.0;    ///< rad
  double dq = 0.0;   ///< rad/s
  double tau = 0.0;  ///< N m that the drive really gave during the last step
};

class JointPlant {
 public:
  JointPlant() = default;
  JointPlant(const JointPlant&) = delete;
  JointPlant& operator=(const JointPlant&) = delete;
  virtual ~JointPlant() = default;

  /// Joints in the robot model's order.
  [[nodiscard]] virtual std::size_t joint_count() const = 0;
  [[nodiscard]] virtual JointMotion motion(std::size_t joint) const = 0;
  /// Applies the drives' torques (N m, one per joint) for `seconds`.
  virtual void step(std::span<const double> torques, double seconds) = 0;
};

}  // namespace clamber
