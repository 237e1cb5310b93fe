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

// ---- against a pendulum: reflected inertia, Coulomb and viscous friction, gravity

struct Pendulum {
  double inertia = 0.139;  ///< kg m^2
  double damping = 1.5;    ///< N m s/rad
  double friction = 0.8;   ///< N m, Coulomb
  double gravity = 15.0;   ///< N m at q = pi / 2
  double push = 0.0;       ///< N m, a disturbance
  double q = 0.0;
  double dq = 0.0;

  /// Semi-implicit; friction may stop the joint in a step but not turn it.
  void step(double tau, double dt) {
    const double drive = tau + push - gravity * std::sin(q);
    double next = (dq + dt * drive / inertia) / (1.0 + dt * damping / inertia);
    const double brake = dt * friction / inertia;
    next = std::abs(next) <= brake ? 0.0 : next - std::copysign(brake, next);
    dq = next;
    q += dt * dq;
  }
};

double run(JointPid& pid, Pendulum& plant, double q_ref, double tau_ff, int ticks) {
  double farthest = 0.0;
  for (int i = 0; i < ticks; ++i) {
    plant.step(pid.update(q_ref, plant.q, plant.dq, tau_ff), kDt);
    farthest = std::max(farthest, std::abs(q_ref - plant.q));
  }
  return farthest;
}

TEST(PidOnAPendulum, StepAgainstGravityAndFrictionSettles) {
  JointPid pid = make_pid({.kp = 600.0, .ki = 1500.0, .kd = 6.0});
  pid.activate(0.0, 0.0);
  Pendulum plant;
  run(pid, plant, 0.0, 0.0, 10);
  run(pid, plant, 0.03, 0.0, 4000);
  EXPECT_NEAR(plant.q, 0.03, 1e-3);
  EXPECT_NEAR(plant.dq, 0.0, 1e-3);
}

TEST(PidOnAPendulum, FeedForwardOfGravityTakesTheErrorThatThePidAloneLeaves) {
  const double q = 0.8;
  const double weight = 15.0 * std::sin(q);
  const auto error = [&](double tau_ff) {
    JointPid pid = make_pid({.kp = 600.0, .ki = 0.0, .kd = 6.0});
    Pendulum plant{.friction = 0.0, .q = q};
    pid.activate(0.0, weight);
    run(pid, plant, q, tau_ff, 3000);
    return q - plant.q;
  };
  EXPECT_NEAR(error(weight), 0.0, 1e-9);
  EXPECT_GT(error(0.0), 0.9 * weight / 600.0);
}

TEST(PidOnAPendulum, APushIsCaughtAndForgotten) {
  JointPid pid = make_pid({.kp = 600.0, .ki = 1500.0, .kd = 6.0});
  Pendulum plant{.q = 0.5};
  const double weight = 15.0 * std::sin(0.5);
  pid.activate(0.0, weight);
  run(pid, plant, 0.5, weight, 1000);
  plant.push = 8.0;
  EXPECT_LT(run(pid, plant, 0.5, weight, 300), 8.0 / 600.0 * 1.6);
  plant.push = 0.0;
  run(pid, plant, 0.5, weight, 3000);
  EXPECT_NEAR(plant.q, 0.5, 1.5e-3);
}

TEST(PidOnAPendulum, LeavesSaturationWithoutWindUp) {
  // Pushed beyond the drive's torque for a second, then let go: the integral has not grown, so the
  // joint returns without swinging past by more than its damping explains.
  JointPid pid = make_pid({.kp = 600.0, .ki = 1500.0, .kd = 8.0});
  Pendulum plant{.friction = 0.0};
  pid.activate(0.0, 0.0);
  plant.push = -36.0;
  run(pid, plant, 0.0, 0.0, 1000);
  ASSERT_LT(plant.q, -0.1);
  EXPECT_EQ(pid.output(), 30.0);
  const double away = std::abs(plant.q);
  plant.push = 0.0;
  double past = 0.0;
  for (int i = 0; i < 2000; ++i) {
    plant.step(pid.update(0.0, plant.q, plant.dq, 0.0), kDt);
    past = std::max(past, plant.q);
  }
  EXPECT_LT(past, 0.35 * away);
  EXPECT_NEAR(plant.q, 0.0, 2e-3);
}

TEST(PidOnAPendulum, ActivationAndGainChangesUnderLoadDoNotJerk) {
  Pendulum plant{.friction = 0.0, .q = 0.7};
  const double weight = 15.0 * std::sin(0.7);
  JointPid pid = make_pid({.kp = 600.0, .ki = 0.0, .kd = 6.0});
  // Somebody else carried it until now.
  pid.activate(0.0, weight);
  double last = weight;
  double fastest = 0.0;
  for (int i = 0; i < 6000; ++i) {
    if (i == 2000) pid.set_gains({.kp = 250.0, .ki = 200.0, .kd = 4.0});
    if (i == 4000) pid.set_gains({.kp = 900.0, .ki = 0.0, .kd = 8.0});
    const double tau = pid.update(0.7, plant.q, plant.dq, 0.0);
    ASSERT_LE(std::abs(tau - last), 0.6) << i;
    last = tau;
    plant.step(tau, kDt);
    fastest = std::max(fastest, std::abs(plant.dq));
  }
  EXPECT_LT(fastest, 0.35);
}

}  // namespace
}  // namespace clamber
