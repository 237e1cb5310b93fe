// The simulated robot as the plant behind virtual drives.
// One thread at a time (as OdeWorld); allocates: ODE does in every step; blocks: never.
#pragma once

#include "firmware_hal/virtual_drives/joint_plant.hpp"
#include "sim_backend/ode_world.hpp"

namespace clamber {

class OdePlant final : public JointPlant {
 public:
  /// The world must outlive the plant.
  explicit OdePlant(OdeWorld& world) : world_(world) {}

  [[nodiscard]] std::size_t joint_count() const override {
    return static_cast<std::size_t>(world_.model().joint_count());
  }
  [[nodiscard]] JointMotion motion(std::size_t joint) const override {
    const auto j = static_cast<Eigen::Index>(joint);
    return {world_.configuration().q[j], world_.velocity()[6 + j], world_.drive_torque()[j]};
  }
  /// `seconds` must be the world's own step.
  void step(std::span<const double> torques, double /*seconds*/) override {
    world_.step(Eigen::Map<const Eigen::VectorXd>(torques.data(),
                                                  static_cast<Eigen::Index>(torques.size())));
  }

 private:
  OdeWorld& world_;
};

}  // namespace clamber
