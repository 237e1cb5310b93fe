// Whether a stretch can be done: at rest in its postures the robot balances, within its torques.
// Any thread (one StretchCheck each); allocates; never blocks.
#pragma once

#include <string>
#include <vector>

#include "planner_offline/search/stretch.hpp"
#include "planner_offline/settings.hpp"

namespace clamber {

/// Why a candidate does not do, and by how far (m; a nominal length where it is not a distance).
struct Rejection {
  std::string why;  ///< empty: it does
  double shortfall = 0.0;
};

/// What a failure that is no distance counts as when attempts are compared.
inline constexpr double kNominalShortfall = 0.05;  // m

class StretchCheck {
 public:
  StretchCheck(const RobotModel& model, const PlannerSettings& settings)
      : model_(model), settings_(settings), forces_(model, settings.forces) {}

  /// Every third posture of each stretch must stand still within friction cones and torque limits
  /// and keep three quarters of the support margin.
  [[nodiscard]] Rejection check(const std::vector<Stretch>& stretches);

 private:
  [[nodiscard]] Rejection check(const Stretch& stretch, const Configuration& x);

  const RobotModel& model_;
  const PlannerSettings& settings_;
  ContactForces forces_;
  RobotData data_;
};

/// "Lwrist+Rwrist"
[[nodiscard]] std::string names_of(const RobotModel& model, const std::vector<int>& links);

}  // namespace clamber
