// A short plan made without the planner's search: COMAN stands, lays both wrists on a table, leans
// weight on them, takes it off and lifts the hands. Contacts are exact by construction.
#pragma once

#include <string>

#include "planner_offline/plan.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber::test {

struct MadePlan {
  MadePlan();
  RobotModel model;
  Scenario scenario;
  Plan plan;
};

/// Made once per program.
const MadePlan& made_plan();

/// The plan's file as save_plan() writes it.
std::string text_of(const Plan& plan);

}  // namespace clamber::test
