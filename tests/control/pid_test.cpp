// The joint PID against a plant with the drives' published figures.
#include "control/pid.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

constexpr double kDt = 1e-3;
constexpr PidLimits kLimits{.torque = 30.0, .torque_rate = 5000.0};

JointPid make_pid(const PidGains& gains, const PidLimits& limits = kLimits) {
  JointPid pid;
  pid.configure(gains, limits, kDt, 2e-3, 0.05);
  return pid;
}

TEST(Pid, StepSettlesOnTheReference) {
  JointPid pid = make_pid({.kp = 300.0, .ki = 0.0, .kd = 3.0});
  pid.activate(0.0, 0.0);
  test::Plant plant;
  static_cast<void>(pid.update(0.0, 0.0, 0.0, 0.0));  // activation would soften the step
  double highest = 0.0;
  for (int i = 0; i < 2000; ++i) {
    plant.step(pid.update(0.05, plant.q, plant.dq, 0.0), kDt);
    highest = std::max(highest, plant.q);
  }
  EXPECT_NEAR(plant.q, 0.05, 1e-5);
  // Damping ratio 6 / (2 sqrt(300 * 0.139)) = 0.46 overshoots by exp(-pi z / sqrt(1 - z^2)) = 19 %.
  EXPECT_NEAR(highest / 0.05, 1.19, 0.06);
}

TEST(Pid, IntegralRemovesAConstantDisturbance) {
  for (const double ki : {0.0, 400.0}) {
    JointPid pid = make_pid({.kp = 600.0, .ki = ki, .kd = 3.0});
    pid.activate(0.0, 0.0);
    test::Plant plant{.load = -6.0};
    for (int i = 0; i < 10000; ++i) plant.step(pid.update(0.1, plant.q, plant.dq, 0.0), kDt);
    const double expected = ki > 0.0 ? 0.0 : 6.0 / 600.0;
    EXPECT_NEAR(0.1 - plant.q, expected, 1e-4);
  }
}

TEST(Pid, FeedForwardCarriesTheLoadWithoutError) {
  JointPid pid = make_pid({.kp = 600.0, .ki = 0.0, .kd = 3.0});
  pid.activate(0.0, 6.0);
  test::Plant plant{.load = -6.0};
  for (int i = 0; i < 3000; ++i) plant.step(pid.update(0.0, plant.q, plant.dq, 6.0), kDt);
  EXPECT_NEAR(plant.q, 0.0, 1e-9);
}

TEST(Pid, DoesNotWindUpWhileSaturated) {
  JointPid pid = make_pid({.kp = 600.0, .ki = 2000.0, .kd = 3.0});
  pid.activate(0.0, 0.0);
  // Blocked 0.5 rad from the reference: without anti-windup the integral reaches its clamp in 30
  // ms.
  for (int i = 0; i < 3000; ++i) EXPECT_LE(std::abs(pid.update(0.5, 0.0, 0.0, 0.0)), 30.0);
  EXPECT_LT(std::abs(pid.integral()), 6.0);
  // Freed and asked back to where it stands, it lets go at once.
  for (int i = 0; i < 20; ++i) static_cast<void>(pid.update(0.0, 0.0, 0.0, 0.0));
  EXPECT_LT(std::abs(pid.output()), 6.0);
}

TEST(Pid, RespectsTorqueAndRateLimits) {
  JointPid pid = make_pid({.kp = 5000.0, .ki = 100.0, .kd = 0.0}, {30.0, 1000.0});
  pid.activate(0.0, 0.0);
  double last = 0.0;
  for (int i = 0; i < 500; ++i) {
    const double tau = pid.update(i % 90 < 45 ? 1.0 : -1.0, 0.0, 0.0, 0.0);
    EXPECT_LE(std::abs(tau), 30.0);
    EXPECT_LE(std::abs(tau - last), 1000.0 * kDt + 1e-12);
    last = tau;
  }
}

TEST(Pid, ReferenceStepGivesNoDerivativeKick) {
  JointPid damped = make_pid({.kp = 10.0, .ki = 0.0, .kd = 50.0});
  damped.activate(0.0, 0.0);
  static_cast<void>(damped.update(0.0, 0.0, 0.0, 0.0));
  EXPECT_DOUBLE_EQ(damped.update(0.1, 0.0, 0.0, 0.0), 10.0 * 0.1);
}

TEST(Pid, DerivativeIsFiltered) {
  JointPid pid = make_pid({.kp = 0.0, .ki = 0.0, .kd = 1.0}, {30.0, 1e9});
  pid.activate(0.0, 0.0);
  static_cast<void>(pid.update(0.0, 0.0, 0.0, 0.0));
  double expected = 0.0;
  for (int i = 0; i < 10; ++i) {
    expected += (1.0 / 3.0) * (2.0 - expected);  // dt / (dt + 2 ms)
    EXPECT_NEAR(pid.update(0.0, 0.0, 2.0, 0.0), -expected, 1e-12);
  }
}

TEST(Pid, TakesOverFromTheAppliedTorqueWithoutAStep) {
  JointPid pid = make_pid({.kp = 600.0, .ki = 0.0, .kd = 3.0});
  pid.activate(0.0, 12.0);
  EXPECT_DOUBLE_EQ(pid.update(0.02, 0.0, 0.0, 0.0), 12.0);
  for (int i = 0; i < 1000; ++i) static_cast<void>(pid.update(0.02, 0.0, 0.0, 0.0));
  EXPECT_NEAR(pid.output(), 600.0 * 0.02, 1e-6);
  pid.set_gains({.kp = 100.0, .ki = 0.0, .kd = 1.0});
  EXPECT_NEAR(pid.update(0.02, 0.0, 0.0, 0.0), 12.0, 1e-6);
  for (int i = 0; i < 1000; ++i) static_cast<void>(pid.update(0.02, 0.0, 0.0, 0.0));
  EXPECT_NEAR(pid.output(), 2.0, 1e-6);
}

}  // namespace
}  // namespace clamber
