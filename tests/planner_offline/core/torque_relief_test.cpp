// Torque relief: its direction takes load off.
#include "planner_offline/certify/torque_relief.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

/// Squatting: soles level and below the centre of mass, knees bent by `knee`.
Configuration squatting(double knee) {
  Configuration x = standing();
  const double change = knee - x.q[joint_of("LKneeSag")];
  for (const std::string side : {"L", "R"}) {
    x.q[joint_of(side + "KneeSag")] += change;
    x.q[joint_of(side + "HipSag")] -= 0.5 * change;
    x.q[joint_of(side + "AnkSag")] -= 0.5 * change;
  }
  return x;
}

TEST(TorqueRelief, MeasureIsTheFourthPowerOfTheLoad) {
  const Configuration x = squatting(1.0);
  const ContactSet contacts = feet(box(), x);
  TorqueRelief relief(coman(), {});
  ContactForces forces(coman(), {});
  const ForceSolution solution = forces.solve(data_at(x), contacts);
  ASSERT_EQ(solution.status, Equilibrium::kFeasible);
  double sum = 0.0;
  for (int j = 0; j < coman().joint_count(); ++j) {
    sum += std::pow(solution.tau[j] / coman().joints[static_cast<std::size_t>(j)].torque_limit, 4);
  }
  EXPECT_NEAR(relief.measure(x, contacts), sum, 1e-12);
}

TEST(TorqueRelief, LoadFallsAlongTheDirection) {
  TorqueRelief relief(coman(), {});
  for (const double knee : {0.8, 1.0, 1.2, 1.4}) {
    Configuration x = squatting(knee);
    const ContactSet contacts = feet(box(), x);
    double measure = relief.measure(x, contacts);
    ASSERT_GT(measure, 0.0) << knee;
    const double before = measure;
    for (int i = 0; i < 10; ++i) {
      constexpr double kStep = 2e-3;
      const JointVector direction = relief.direction(x, contacts, measure, kStep);
      EXPECT_NEAR(direction.cwiseAbs().maxCoeff(), kStep, 1e-12);
      x.q += direction;
      const double now = relief.measure(x, contacts);
      ASSERT_GT(now, 0.0) << "out of balance";
      EXPECT_LT(now, measure) << "knee " << knee << " step " << i;
      measure = now;
    }
    EXPECT_LT(measure, 0.95 * before);
  }
}

/// Leaning forward as a whole until the centre of mass is a hand beyond the toes.
Configuration falling() {
  Configuration x = squatting(1.0);
  x.X_WB.R = rotation_exp({0.0, 0.6, 0.0}) * x.X_WB.R;
  return x;
}

TEST(TorqueRelief, OutOfBalanceIsInfinitelyHeavy) {
  const Configuration x = falling();
  const ContactSet contacts = feet(box(), x);
  TorqueRelief relief(coman(), {});
  const double measure = relief.measure(x, contacts);
  EXPECT_TRUE(std::isinf(measure));
  EXPECT_EQ(relief.direction(x, contacts, measure, 0.01).norm(), 0.0);
}

TEST(TorqueRelief, ProbesOutOfBalanceAreSkipped) {
  // From a balanced measure at a posture where no probe balances: nothing to go by, and finite.
  const Configuration x = falling();
  TorqueRelief relief(coman(), {});
  EXPECT_EQ(relief.direction(x, feet(box(), x), 1.0, 0.01).norm(), 0.0);
}

TEST(TorqueRelief, DeeperIsHeavier) {
  TorqueRelief relief(coman(), {});
  double last = 0.0;
  for (const double knee : {0.4, 0.7, 1.0, 1.3}) {
    const Configuration x = squatting(knee);
    const double measure = relief.measure(x, feet(box(), x));
    EXPECT_GT(measure, last) << knee;
    last = measure;
  }
}

}  // namespace
}  // namespace clamber
