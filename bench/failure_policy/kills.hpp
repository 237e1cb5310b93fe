// Climbs a plan once in the simulation and, at chosen instants, finds out what becomes of the robot
// if its host falls silent there: the process is copied (fork), and in each copy the drives go on
// alone under one policy. One thread, jobs processes; allocates; throws InputError.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "control/controller.hpp"
#include "planner_offline/plan.hpp"
#include "sim_backend/perturbation.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

/// What became of the robot in `KillOptions::watch` seconds.
struct Outcome {
  bool fell = false;
  double after = 0.0;   ///< s from the kill to the fall, or to the end of the watch
  double speed = 0.0;   ///< m/s, fastest that the centre of mass sank or was thrown
  double sunk = 0.0;    ///< m, of the centre of mass at the end
  double hit = 0.0;     ///< N, largest force on torso or pelvis
  double effort = 0.0;  ///< (N m)^2, mean over joints of the squared torque at the end: heat
};

struct Kill {
  double time = 0.0;       ///< s since the first tick
  double plan_time = 0.0;  ///< s
  std::uint32_t phase = 0;
  FailurePolicy planned = FailurePolicy::kHold;
  std::array<Outcome, kFailurePolicies> of{};  ///< by policy

  [[nodiscard]] const Outcome& by(FailurePolicy policy) const {
    return of[static_cast<std::size_t>(policy)];
  }
};

/// A fall, as the simulator sees it, whatever the policy wanted:
///   - the centre of mass moves at `speed` or more: what goes down by a centimetre and a half in
///     free fall (0.54 m/s) is not held by anybody any more;
///   - or torso or pelvis carries more than `hit`, a share of the robot's weight: it has come down
///     on something, if slowly.
struct FallLimits {
  double speed = 0.5;  ///< m/s
  double hit = 0.5;    ///< of the weight
};

struct KillOptions {
  double stride = 0.01;  ///< s between kills
  double first = 0.0;    ///< s, of the first
  double last = 1e9;     ///< s: none after it
  double watch = 5.0;    ///< s after each
  int jobs = 2;          ///< processes at a time
  FallLimits fall;
  std::optional<Perturbation> perturbation;
  std::function<void(const Kill&)> done;  ///< after each instant, in their order
};

struct KillInputs {
  RobotModel model;
  Scenario scenario;
  Plan plan;
  std::vector<std::byte> image;
  ControllerConfig control;
};

/// @return the kills in order of time, from the controller's first tick to its last
[[nodiscard]] std::vector<Kill> kill_everywhere(const KillInputs& inputs,
                                                const KillOptions& options);

}  // namespace clamber
