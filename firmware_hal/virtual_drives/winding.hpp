// How warm a motor's winding is: copper losses in, one heat capacity, one way out.
// Any thread; allocates: never; blocks: never.
#pragma once

namespace clamber {

/// First order: C dT/dt = loss tau^2 - (T - ambient) / resistance, C = time_constant / resistance.
struct WindingHeat {
  double loss = 0.15;        ///< W per (N m)^2 at the joint: I^2 R by way of the torque constant
  double resistance = 1.25;  ///< K/W, winding to surroundings
  double time_constant = 300.0;  ///< s
  double limit = 100.0;          ///< degree Celsius: the drive switches itself off
  double ambient = 25.0;         ///< degree Celsius
};

class Winding {
 public:
  explicit Winding(const WindingHeat& heat) noexcept : heat_(heat), temperature_(heat.ambient) {}

  void pass(double torque, double seconds) noexcept {
    const double steady = heat_.ambient + heat_.resistance * heat_.loss * torque * torque;
    // Implicit, so that it is stable for any step.
    const double share = seconds / (heat_.time_constant + seconds);
    temperature_ += share * (steady - temperature_);
  }
  void set_temperature(double celsius) noexcept { temperature_ = celsius; }
  [[nodiscard]] double temperature() const noexcept { return temperature_; }
  [[nodiscard]] bool too_hot() const noexcept { return temperature_ > heat_.limit; }
  /// Cool enough to be switched on again: 5 K of hysteresis, so that it does not chatter.
  [[nodiscard]] bool cooled() const noexcept { return temperature_ < heat_.limit - 5.0; }

 private:
  WindingHeat heat_;
  double temperature_;
};

}  // namespace clamber
