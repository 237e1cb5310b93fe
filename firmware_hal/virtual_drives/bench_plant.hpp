// Joints on a bench: each an inertia with viscous friction and a constant load, nothing between
// them. One thread at a time; allocates: in the constructor; blocks: never.
#pragma once

#include <vector>

#include "firmware_hal/virtual_drives/joint_plant.hpp"

namespace clamber {

struct BenchJoint {
  double inertia = 0.14;  ///< kg m^2, what COMAN's drives reflect at the joint
  double friction = 1.0;  ///< N m s/rad
  double load = 0.0;      ///< N m, pulls at the joint
  double q = 0.0;         ///< rad
  double dq = 0.0;        ///< rad/s
  double tau = 0.0;       ///< N m, of the last step
};

class BenchPlant final : public JointPlant {
 public:
  explicit BenchPlant(std::vector<BenchJoint> joints) : joints_(std::move(joints)) {}

  [[nodiscard]] std::size_t joint_count() const override { return joints_.size(); }
  [[nodiscard]] JointMotion motion(std::size_t joint) const override {
    return {joints_[joint].q, joints_[joint].dq, joints_[joint].tau};
  }
  /// Friction implicit, so that no step is too long for it.
  void step(std::span<const double> torques, double seconds) override {
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      BenchJoint& joint = joints_[j];
      joint.tau = torques[j];
      joint.dq = (joint.inertia * joint.dq + seconds * (joint.tau + joint.load)) /
                 (joint.inertia + seconds * joint.friction);
      joint.q += seconds * joint.dq;
    }
  }
  [[nodiscard]] BenchJoint& joint(std::size_t j) { return joints_[j]; }

 private:
  std::vector<BenchJoint> joints_;
};

}  // namespace clamber
