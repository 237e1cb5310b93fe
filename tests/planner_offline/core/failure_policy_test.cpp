// What the planner foresees when drives let go slowly, and which policy it states.
#include "planner_offline/certify/failure_policy.hpp"

#include <gtest/gtest.h>

#include "planner_offline/certify/contact_forces.hpp"
#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

/// The torques that balance standing on both soles.
JointVector standing_torque(const Configuration& x) {
  ContactForces forces(coman(), {});
  const ForceSolution solution = forces.solve(data_at(x), feet(box(), x));
  EXPECT_EQ(solution.status, Equilibrium::kFeasible);
  return solution.tau;
}

TEST(Sinking, StiffJointsStayWhereTheyAre) {
  const Configuration x = standing();
  // Joints that hardly move while their torque fades.
  DrivesAlone drives;
  drives.lower_damping = 1e6;
  const Sinking held = foresee_sinking(coman(), box(), x, standing_torque(x), drives);
  EXPECT_LT(held.depth, 5e-3);
  EXPECT_LT(held.last_speed, 0.01);
}

TEST(Sinking, AStandingRobotGoesDownFastOneOnAllFoursDoesNot) {
  const Configuration up = standing();
  const Sinking standing_up = foresee_sinking(coman(), box(), up, standing_torque(up));
  EXPECT_GT(standing_up.fastest, 0.25);

  // Flat on the floor, away from the box: nowhere to go.
  Configuration lying = up;
  lying.X_WB.R = rotation_exp({0.0, 1.5707963, 0.0});
  lying.X_WB.p = {-3.0, 0.0, 0.15};
  const Sinking flat =
      foresee_sinking(coman(), box(), lying, JointVector::Zero(coman().joint_count()));
  EXPECT_LT(flat.last_speed, 0.05);
}

TEST(FailurePolicy, LeavesTheLeastTorqueAfterWhichTheRobotStaysUp) {
  FailureCase gentle{
      .needed = 5.0,
      .sinking = {.fastest = 0.1, .last_speed = 0.01, .depth = 0.02, .body_above = 0.2}};
  EXPECT_EQ(failure_policy(gentle), FailurePolicy::kLower);
  FailureCase other = gentle;
  other.sinking.fastest = 0.3;
  EXPECT_EQ(failure_policy(other), FailurePolicy::kHold);
  other = gentle;
  other.sinking.last_speed = 0.1;
  EXPECT_EQ(failure_policy(other), FailurePolicy::kHold);
  other = gentle;
  other.sinking.body_above = -1e-4;
  EXPECT_EQ(failure_policy(other), FailurePolicy::kHold);
  other = gentle;
  other.needed = 0.0;
  EXPECT_EQ(failure_policy(other), FailurePolicy::kLimp);
}

TEST(FailurePolicy, IsStatedPerPhaseAndAPhaseBeginsWhereTheOneBeforeEnded) {
  const Configuration x = standing();
  Keyframe upright;
  upright.x = x;
  upright.tau = standing_torque(x);
  Keyframe rest = upright;
  rest.tau.setZero();
  Plan plan;
  plan.phases = {{"a", 0.0}, {"b", 1.0}, {"c", 2.0}};
  for (int k = 0; k < 4; ++k) {
    plan.keyframes.push_back(k < 2 ? upright : rest);
    plan.keyframes.back().time = k;
    plan.keyframes.back().phase = std::max(0, k - 1);
  }
  plan.keyframes[1].phase = 0;
  const auto cases = failure_cases(coman(), box(), plan);
  ASSERT_EQ(cases.size(), 3u);
  EXPECT_GT(cases[0].needed, 1.0);
  EXPECT_GT(cases[1].needed, 1.0);  // begins with a's last keyframe
  EXPECT_EQ(cases[2].needed, 0.0);
  state_failure_policies(coman(), box(), plan);
  EXPECT_EQ(plan.phases[0].failure_policy, FailurePolicy::kHold);
  EXPECT_EQ(plan.phases[1].failure_policy, FailurePolicy::kHold);
  EXPECT_EQ(plan.phases[2].failure_policy, FailurePolicy::kLimp);
}

}  // namespace
}  // namespace clamber
