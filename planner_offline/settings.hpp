// The planner's parameters: the paper's values as defaults, and what goes beyond the paper.
// Plain data; read from configs/planner/default.yaml (settings_file.hpp).
#pragma once

#include <vector>

#include "planner_offline/certify/contact_forces.hpp"
#include "planner_offline/clearance/clearance.hpp"
#include "planner_offline/ik/posture_ik.hpp"

namespace clamber {

/// Reference optimisation, paper IV-C.
struct ReferenceSettings {
  double w1 = 0.1;              ///< weight of the reach term in its phase, Eq. (10)
  double w2 = 0.1;              ///< weight of the support term in its phase
  double step = 2.0;            ///< alpha, Eq. (11)
  double ik_error = 0.01;       ///< m, IK_error that ends the first phase
  int most_iterations = 300;    ///< per posture, both phases (paper: over 300)
  double theta_max_deg = 35.0;  ///< Eq. (8): 0..35 degrees can support
  double surface_margin =
      0.045;                  ///< m, bounds b: contacts stay this far inside the surface's edges
  double press = 0.002;       ///< m, a limb's outer contact is sought this far below the surface
                              ///< while its inner one rests, so that it carries too
  double relief_share = 0.6;  ///< torque relief stops at about this share of the limit
  int relief_iterations = 60;
  bool posture_has_priority = false;  ///< true: Eq. (6), posture with the tasks; false: Eq. (7)
};

/// Search for intermediate postures, paper IV-D.
struct SearchSettings {
  std::size_t most_candidates = 40;  ///< keyframes, weight shifts and swings tried per attempt
  std::size_t most_attempts = 150;   ///< sets of contact places tried before there is no climb
  std::size_t wide_attempts = 15;    ///< the same with each of wide_clearances
  /// m to obstacle and floor, tried in turn before ClearanceSettings::obstacle: what another height
  /// of the obstacle and another start would take away. The first that gives a climb is taken.
  std::vector<double> wide_clearances = {0.020};
  /// A climb whose certificate holds for less than is stated is refused, and the search goes on.
  bool as_stated = false;
  std::size_t steady_attempts = 12;  ///< sets tried before a climb that is not steady is taken
  int most_steps = 400;           ///< inverse-kinematics steps of one motion before it is given up
  double support_margin = 0.012;  ///< m, CoM inside the support region
  double tight_margin = 0.008;    ///< m, the same once no climb was found with that
  double free_margin = 0.045;  ///< m, the same while nothing but feet carries: there is no hand to
                               ///< catch a disturbance
  double steady_margin =
      0.03;  ///< m, a climb with this worst margin is good enough to stop searching
  double settled_margin = 0.14;  ///< m, aimed at in the end, on all contacts
  double wanted_margin = 0.04;   ///< m, aimed at when weight is shifted
  double swing_height = 0.05;    ///< m above obstacle or start, first candidate
  double swing_step = 0.008;     ///< m, reference point per step
  double posture_step = 0.03;    ///< rad per step towards the posture hint
  double relief_from = 0.85;     ///< share of the torque limit at which motions start to avoid load
  double relief_full = 1.1;      ///< ... and from which they do nothing else with their freedom
  double com_step = 0.006;       ///< m per step
  std::size_t touch_samples = 40;       ///< starts from which a posture that touches is sought
  std::size_t most_touch_postures = 4;  ///< of them kept, the cheapest first
  std::size_t most_way_nodes = 1500;    ///< tries of the trees that look for a way between postures
  std::size_t order_attempts = 16;  ///< sets of places tried per contact order without a recording
  std::size_t most_seeds = 3;       ///< of random starts tried before there is no plan
  std::size_t seed = 1;             ///< the first of them
  double step_margin = 0.025;       ///< m, aimed at inside one sole while the other foot steps
  double step_length = 0.08;        ///< m, longest step when walking on the obstacle
  double step_turn = 0.35;          ///< rad, largest turn of a step
  /// Candidates of all attempts, whatever clearance, margin or places: what a search that finds
  /// nothing costs at most, some four minutes of two cores.
  std::size_t most_candidates_in_all = 8000;
};

/// Timing of the plan.
struct TimingSettings {
  double joint_speed = 0.6;       ///< rad/s, fastest joint
  double com_speed = 0.08;        ///< m/s
  double com_acceleration = 0.3;  ///< m/s^2, between keyframes
  double knot_spacing = 0.1;      ///< s between keyframes
  double load_time = 0.8;         ///< s to move weight onto or off a contact
};

struct PlannerSettings {
  double friction_share = 0.6;  ///< of the scenario's friction that contact forces may count on
  IkSettings ik;
  ClearanceSettings clearance;
  ForceSettings forces;
  ReferenceSettings references;
  SearchSettings search;
  TimingSettings timing;
};

}  // namespace clamber
