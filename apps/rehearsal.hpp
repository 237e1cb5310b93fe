// The simulated robot behind virtual drives, and the judge who watches it.
// Main thread; allocates; throws InputError.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "firmware_hal/virtual_drives/virtual_drives.hpp"
#include "robot_model/model.hpp"
#include "sim_backend/judge.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

class RehearsalWorld {
 public:
  /// The robot at the scenario's start. @param step s of simulated time per tick
  RehearsalWorld(const RobotModel& model, const Scenario& scenario, double step);
  ~RehearsalWorld();
  RehearsalWorld(const RehearsalWorld&) = delete;
  RehearsalWorld& operator=(const RehearsalWorld&) = delete;

  [[nodiscard]] JointPlant& plant();
  /// Once a tick in which the robot may have moved.
  void look();
  /// The judge's verdict: of the last time within kStopAllowance in which he saw the robot on top,
  /// if there was one, else of now. A host brakes before it switches off, and a robot that is only
  /// braked sinks.
  [[nodiscard]] ClimbVerdict verdict() const;
  [[nodiscard]] double time() const;  ///< s

  static constexpr double kStopAllowance = 1.0;  ///< s

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The hottest drive and its joint.
struct HottestDrive {
  double temperature = 0.0;  ///< degree Celsius
  std::string joint;
};
[[nodiscard]] HottestDrive hottest(const VirtualDrives& drives);

[[nodiscard]] nlohmann::ordered_json to_json(const ClimbVerdict& verdict);
/// Per drive: joint, bus, power, temperature, frames.
[[nodiscard]] nlohmann::ordered_json to_json(const BusMap& map, const VirtualDrives& drives);

}  // namespace clamber
