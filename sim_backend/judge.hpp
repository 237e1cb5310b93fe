// Did the robot climb? Judged from contacts and motion alone; knows nothing of any plan.
// One thread; allocates: yes; blocks: never.
#pragma once

#include <deque>
#include <span>
#include <string>
#include <vector>

#include "robot_model/model.hpp"
#include "sim_backend/contact_observation.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

struct JudgeLimits {
  double window = 2.0;          ///< s: what must hold, must hold over the last so many seconds
  double rest_speed = 0.05;     ///< m/s and rad/s: at rest below this
  double min_load = 2.0;        ///< N: a contact that carries less carries nothing (window mean)
  double weight_share = 0.95;   ///< of the weight on the obstacle's top (window mean)
  double top_tolerance = 5e-3;  ///< m: a contact on the top face is at its height within this
  double top_cosine = 0.9;      ///< and its normal points up at least this much
};

struct ClimbVerdict {
  bool success = false;
  double observed = 0.0;                        ///< s: span of the samples judged
  std::vector<std::string> final_contacts;      ///< contact links loaded on the obstacle's top
  std::vector<std::string> floor_contacts;      ///< links that touched the floor in the window
  std::vector<std::string> forbidden_contacts;  ///< torso or pelvis links that carried force
  std::vector<std::string> side_contacts;       ///< links loaded on the obstacle, not on its top
  std::vector<std::string> missing_contacts;    ///< goal contacts that are not in final_contacts
  double weight_on_obstacle = 0.0;              ///< share of the weight carried by the top, 0..1
  double rest_speed = 0.0;  ///< greatest joint rate or base velocity in the window, rad/s or m/s
};

/// What the judge minds, in one line; weight and speed always.
[[nodiscard]] std::string describe(const ClimbVerdict& verdict);

/// Watches samples and judges the last `window` seconds of them.
///
/// Success: every goal contact is loaded on the top face of the scenario's first obstacle, no other
/// obstacle and no floor is touched, every obstacle contact is on the top face, the top carries the
/// weight, torso and pelvis touch nothing, and all of that at rest for the whole window.
/// A belly-flop fails twice: its torso carries, its contacts do not.
class ClimbJudge {
 public:
  /// @throws InputError when a goal contact is none of the model's contact links
  ClimbJudge(const RobotModel& model, const Scenario& scenario, const JudgeLimits& limits = {});

  /// One look at the world; call every few milliseconds with time (s) increasing.
  /// @param velocity base and joints, see VelocityVector
  void push(double time, std::span<const ContactObservation> contacts,
            const VelocityVector& velocity);

  [[nodiscard]] ClimbVerdict verdict() const;

 private:
  struct Sample {
    double time = 0.0;
    double speed = 0.0;
    std::vector<ContactObservation> contacts;
  };
  struct Loads;

  [[nodiscard]] bool on_top(const ContactObservation& contact) const;
  [[nodiscard]] Loads mean_loads() const;

  RobotModel model_;
  Scenario scenario_;
  JudgeLimits limits_;
  std::vector<bool> forbidden_;  ///< per geom
  std::deque<Sample> samples_;
};

}  // namespace clamber
