// Plays a mapped motion on the robot in the simulator and reads its contact sequence off it
// (paper III-B, III-C).
// One thread, and no other OdeWorld at the same time; allocates; never blocks.
//
// The joints follow the recording by PID position control; drives saturate where the robot's do.
// The base is guided along the recorded pelvis path by a spring-damper (OdeWorld::set_base_guide).
// It has to be: joint angles alone do not balance the robot, a free base falls sooner or later (the
// paper's Fig. 4), and from then on the contacts would be those of a fall, not of the
// demonstration.
// Where the robot's proportions make a limb too long for the motion, the obstacle pushes the limb
// and, through it, the base; the guide then gives way by some centimetres, and limbs that the
// demonstration had on the obstacle would lose it through no doing of their own. The guide is a
// device of ours, so its give is taken out again: contacts are sampled with the simulated joint
// angles and the base where the guide wants it. (Limbs that are pressed on then overlap the
// obstacle a little, which counts as contact.)
#pragma once

#include "planner_offline/contacts/adjustment.hpp"
#include "planner_offline/contacts/contact_sampler.hpp"
#include "planner_offline/contacts/contact_sequence.hpp"
#include "planner_offline/contacts/contact_states.hpp"
#include "planner_offline/motion.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

struct PlaybackConfig {
  double sample_period = 0.05;  ///< s between contact checks (paper III-C)
  double step = 1e-3;           ///< s, simulator and PID
  /// Of the simulator's quick stepper. Half of what executing a plan takes: the base is guided and
  /// only positions are read off. The contact sets stay those of 50 iterations, in 0.6 of the time.
  int iterations = 25;
  SamplerConfig sampler;
  StateConfig states;
  AdjustmentConfig adjustment;
};

struct Playback {
  Adjustment adjustment;
  Scenario scenario;  ///< with the obstacle and the start it was played with
  std::vector<ContactSample> samples;
  double peak_guide_force = 0.0;  ///< N, how much of the work the guide did
  double worst_base_error = 0.0;  ///< m, base to its guide
};

/// Plays the motion once before an obstacle as wide and deep as `scenario`'s first one, of the
/// adjusted height, front face at x = 0.
/// @throws InputError, PlanningFailed as find_adjustment(); InputError when the scenario has no
///         obstacle
[[nodiscard]] Playback play(const RobotModel& model, const RobotMotion& motion,
                            const Scenario& scenario, const PlaybackConfig& config);

/// Adjustment, playback, states and reduction. The notes say what was adjusted, what touched
/// besides contact links, and which links never made contact.
/// @throws InputError, PlanningFailed as play(); PlanningFailed when the playback shows no contact
[[nodiscard]] ContactSequence extract_contacts(const RobotModel& model, const RobotMotion& motion,
                                               const Scenario& scenario,
                                               const PlaybackConfig& config);
/// The same from a playback already made.
[[nodiscard]] ContactSequence contacts_of(const RobotModel& model, const RobotMotion& motion,
                                          const Playback& playback, const PlaybackConfig& config);

}  // namespace clamber
