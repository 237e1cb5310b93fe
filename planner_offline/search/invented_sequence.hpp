// Contact sequences without a demonstration: places out of a posture in which the robot rests on
// all its goal contacts, orders out of the contact graph.
// Start-up only: allocates; deterministic; throws InputError, PlanningFailed.
#pragma once

#include <vector>

#include "planner_offline/contacts/contact_sequence.hpp"
#include "planner_offline/settings.hpp"

namespace clamber {

/// One sequence for every order in which the contact graph leads from standing on the floor to the
/// scenario's goal contacts, for every posture found, the likeliest first.
/// @throws InputError     the goal names a link that the robot lacks
/// @throws PlanningFailed no posture rests on all goal contacts
[[nodiscard]] std::vector<ContactSequence> invented_sequences(const RobotModel& model,
                                                              const Scenario& scenario,
                                                              const PlannerSettings& settings);

}  // namespace clamber
