// The moves a contact sequence asks for: which links land, which lift, in which order.
// Start-up only: allocates, throws InputError and PlanningFailed.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "planner_offline/contacts/contact.hpp"
#include "planner_offline/contacts/contact_sequence.hpp"

namespace clamber {

/// Links that change together between two contact sets.
struct Move {
  int state = 0;                              ///< index into the reduced sequence it leads to
  std::vector<int> lands;                     ///< links that make contact
  std::vector<int> lifts;                     ///< links that break contact first
  int surface = 0;                            ///< obstacle the links land on
  std::map<int, Eigen::Vector3d> references;  ///< link -> X_i^o in the obstacle's edge frame, m
  std::set<int>
      completes_limb;  ///< links after which their limb gets no further contact in the state
  /// A link that is set down again farther on: left out where it already is near its reference or
  /// cannot get any nearer.
  bool optional = false;
  JointVector hint;  ///< posture from the recording
};

/// Orders the reduced states' new contacts as they were first touched, one limb pair at a time, and
/// adds goal contacts that the recording lacks; a leg that the recording sets on its foot kneels
/// where the goal asks for its knee (both said in `notes`).
/// A link moves where it first rests on the obstacle: a state that brings none anew, because
/// contacts were given up or made again elsewhere, asks for no move.
/// @throws InputError     a state or the goal names a link that the robot lacks
/// @throws PlanningFailed no state has absolute stability, or a limb that the goal asks for is on
///                        the obstacle in none of them
[[nodiscard]] std::vector<Move> plan_moves(const RobotModel& model, const Scenario& scenario,
                                           const ContactSequence& sequence,
                                           std::vector<std::string>& notes);

/// Position in the first obstacle's edge frame (contact_sequence.hpp) to the world.
[[nodiscard]] Eigen::Vector3d from_edge_frame(const ObstacleBox& box, const Eigen::Vector3d& p);
[[nodiscard]] Eigen::Vector3d to_edge_frame(const ObstacleBox& box, const Eigen::Vector3d& p_W);

}  // namespace clamber
