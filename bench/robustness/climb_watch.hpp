// Watches a simulated climb against its plan and notes what goes wrong, in order of time.
// One thread; allocates; blocks: never.
#pragma once

#include <string>
#include <vector>

#include "planner_offline/plan.hpp"
#include "sim_backend/perturbation.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

struct ClimbEvent {
  double time = 0.0;  ///< s on the plan's clock
  std::string phase;
  std::string what;
};

/// What is an event, each noted once per joint or link:
///   - a joint at its torque limit for 0.1 s;
///   - a contact link that the plan loads with 15 N or more for 0.5 s and the world with less than
///     1 N: never loaded, or lost;
///   - a link that carries 20 N and has no contact in the plan for 0.5 s around it;
///   - torso or pelvis carrying, another link carrying more than 20 N;
///   - the base 5 cm or 8 degrees from where the plan has it, the start's offset taken along.
class ClimbWatch {
 public:
  ClimbWatch(const RobotModel& model, const Scenario& scenario, const Plan& plan,
             const Perturbation& perturbation);

  void observe(const OdeWorld& world, const TelemetryFrame& frame);

  [[nodiscard]] const std::vector<ClimbEvent>& events() const { return events_; }
  [[nodiscard]] double farthest() const { return farthest_; }  ///< m, of the base from the plan
  [[nodiscard]] double most_tilted() const { return most_tilted_; }  ///< rad, the same

 private:
  struct LinkWatch {
    double load = 0.0;   ///< N, low-passed
    double idle = 0.0;   ///< s that the plan loads it and the world does not
    double extra = 0.0;  ///< s that the world loads it and the plan has no contact
    bool was_loaded = false, idle_noted = false, extra_noted = false;
  };

  void note(const TelemetryFrame& frame, std::string what);
  void watch_torques(const TelemetryFrame& frame);
  void watch_links(const TelemetryFrame& frame);
  void watch_base(const TelemetryFrame& frame);
  /// Force that the plan has on the link: the least of the keyframes around, 0 without a contact.
  [[nodiscard]] double planned_force(std::size_t link) const;
  [[nodiscard]] bool planned_near(std::size_t link, double time) const;

  const RobotModel& model_;
  const Plan& plan_;
  Pose offset_;  ///< where the start's offset takes a planned pose
  std::size_t at_ = 0;
  double last_time_ = 0.0;
  std::vector<std::vector<double>> force_;  ///< N per keyframe and link, negative: no contact
  std::vector<double> saturated_;           ///< s per joint
  std::vector<LinkWatch> links_;
  bool far_noted_ = false, forbidden_noted_ = false, other_noted_ = false;
  double farthest_ = 0.0, most_tilted_ = 0.0;
  std::vector<ClimbEvent> events_;
};

}  // namespace clamber
