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
  std::vector<std::string> missing_contacts;  ///< goal contacts that do not carry where they are to
  std::vector<std::string> unwanted_contacts;  ///< links that carry besides the soles, where only
                                               ///< soles are to
  double weight_on_obstacle = 0.0;             ///< share of the weight carried by the top, 0..1
  double weight_on_floor = 0.0;                ///< share carried by the floor, 0..1
  bool was_on_top = false;        ///< at some time the top carried the weight and the floor nothing
  bool on_the_right_side = true;  ///< over, back_down: the soles are where the goal says
  double rest_speed = 0.0;  ///< greatest joint rate or base velocity in the window, rad/s or m/s
};

/// What the judge minds, in one line; weight and speed always.
[[nodiscard]] std::string describe(const ClimbVerdict& verdict);

/// Watches samples and judges the last `window` seconds of them.
///
/// Success, for the whole window and at rest, torso and pelvis touching nothing:
///   all_fours     every goal contact is loaded on the top face of the scenario's first obstacle,
///   no
///                 other obstacle and no floor is touched, every obstacle contact is on the top
///                 face and the top carries the weight
///   stand_on_top  the same with the soles as goal contacts, and nothing but soles carries
///   over          the robot has been on top; now soles alone carry, on the floor, behind the far
///                 face, and no obstacle is touched
///   back_down     the same before the near face
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
  [[nodiscard]] bool carried_by_top(const Sample& sample) const;
  void judge_on_top(const Loads& loads, ClimbVerdict& verdict) const;
  void judge_on_floor(const Loads& loads, ClimbVerdict& verdict) const;

  RobotModel model_;
  Scenario scenario_;
  JudgeLimits limits_;
  std::vector<std::string> goal_contacts_;
  std::vector<bool> forbidden_;  ///< per geom
  bool was_on_top_ = false;
  std::deque<Sample> samples_;
};

}  // namespace clamber
