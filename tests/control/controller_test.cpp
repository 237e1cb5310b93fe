#include "control/controller.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

constexpr std::uint32_t kJoints = 4;
constexpr std::size_t kKeyframes = 31;  // 3 s

struct Rig {
  ControllerConfig config = test::make_config(kJoints);
  std::vector<std::byte> image =
      test::make_image(kJoints, test::smooth_keyframes(kJoints, kKeyframes));
  std::vector<double> workspace = std::vector<double>(Controller::workspace_size(kKeyframes));
  test::PlantRobot robot{kJoints};
  Controller controller;
  TelemetryFrame frame;
  TickStatus status = TickStatus::kWaiting;

  LoadReport load() {
    const LoadReport report = controller.load(config, test::kRobotHash, image, workspace);
    controller.request(OperatorCommand::kArm);
    controller.request(OperatorCommand::kStart);
    return report;
  }
  void tick() {
    status = controller.tick(robot.states, robot.commands, frame);
    robot.step(config.dt);
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  void place(double q) {
    for (std::size_t j = 0; j < kJoints; ++j) robot.states[j].q = robot.plants[j].q = q;
  }
};

TEST(Controller, WalksThroughItsModesAndArrives) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  std::array<int, 9> seen{};
  std::uint64_t ticks = 0;
  do {
    rig.tick();
    ++seen[static_cast<std::size_t>(rig.status)];
    ++ticks;
  } while (rig.status != TickStatus::kFinished && ticks < 10000);
  EXPECT_EQ(seen[static_cast<std::size_t>(TickStatus::kMovingToStart)], 200);
  EXPECT_EQ(seen[static_cast<std::size_t>(TickStatus::kTracking)], 3000);
  EXPECT_EQ(seen[static_cast<std::size_t>(TickStatus::kHolding)], 300);
  EXPECT_EQ(ticks, rig.controller.expected_ticks() + 1);
  const ImageKeyframe last = test::smooth_keyframes(kJoints, kKeyframes).back();
  for (std::size_t j = 0; j < kJoints; ++j) {
    EXPECT_EQ(rig.frame.q_ref[j], last.q[j]);
    EXPECT_NEAR(rig.robot.states[j].q, last.q[j], 0.01);
  }
  EXPECT_EQ(rig.frame.phase, last.phase);
}

TEST(Controller, ReferencePassesThroughEveryKeyframe) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  const auto keyframes = test::smooth_keyframes(kJoints, kKeyframes);
  rig.run(200);
  for (std::size_t i = 0; i < 3000; ++i) {
    rig.tick();
    if (i % 100 != 0) continue;
    const ImageKeyframe& k = keyframes[i / 100];
    EXPECT_NEAR(rig.frame.plan_time, k.time, 1e-12);
    for (std::size_t j = 0; j < kJoints; ++j) {
      EXPECT_NEAR(rig.frame.q_ref[j], k.q[j], 1e-12);
      EXPECT_NEAR(rig.frame.tau_ff[j], k.tau[j], 1e-9);
    }
  }
}

TEST(Controller, ReferenceLeadsByTheStretchOfSprings) {
  Rig rigid, elastic;
  elastic.config.joints[1].spring_stiffness = 200.0;
  ASSERT_EQ(rigid.load().status, LoadStatus::kOk);
  ASSERT_EQ(elastic.load().status, LoadStatus::kOk);
  for (int i = 0; i < 2500; ++i) {
    rigid.tick();
    elastic.tick();
    EXPECT_EQ(elastic.frame.q_ref[0], rigid.frame.q_ref[0]);
    if (rigid.status == TickStatus::kTracking) {
      EXPECT_NEAR(elastic.frame.q_ref[1], rigid.frame.q_ref[1] + rigid.frame.tau_ff[1] / 200.0,
                  1e-12);
    }
  }
}

TEST(Controller, ReferenceIsSmoothFromTheMeasuredPostureOn) {
  Rig rig;
  rig.place(0.2);
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  std::array<double, 3> last{};
  for (int i = 0; i < 5000; ++i) {
    rig.tick();
    ASSERT_NE(rig.status, TickStatus::kFault);
    const double q = rig.frame.q_ref[0];
    const double acceleration = (q - 2.0 * last[0] + last[1]) / 1e-6;
    if (i == 0) {
      EXPECT_EQ(q, 0.2);
    }
    // A step of 10 microradians in the reference would show as 10 rad/s^2.
    if (i > 2) {
      EXPECT_LT(std::abs(acceleration), 6.0) << i;
    }
    last = {q, last[0], last[1]};
  }
}

TEST(Controller, TakesOverWithoutATorqueStep) {
  Rig rig;
  for (auto& s : rig.robot.states) s.tau = 7.0;
  rig.place(0.1);
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.tick();
  for (const auto& c : rig.robot.commands) EXPECT_DOUBLE_EQ(c.tau, 7.0);
}

TEST(Controller, ChangesGainsAndFeedForwardWithoutATorqueStep) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(1500);
  auto before = rig.robot.commands;
  rig.controller.set_feed_forward(FeedForward::kNone);
  rig.tick();
  for (std::size_t j = 0; j < kJoints; ++j)
    EXPECT_NEAR(rig.robot.commands[j].tau, before[j].tau, 1e-12);
  EXPECT_EQ(rig.frame.tau_ff[0], 0.0);
  before = rig.robot.commands;
  rig.controller.set_gains(std::vector<PidGains>(kJoints, {.kp = 200.0, .ki = 0.0, .kd = 1.0}));
  rig.tick();
  for (std::size_t j = 0; j < kJoints; ++j)
    EXPECT_NEAR(rig.robot.commands[j].tau, before[j].tau, 1e-12);
}

TEST(Controller, TimeScaleStretchesThePlan) {
  Rig rig;
  rig.config.time_scale = 0.5;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(200 + 6000);
  EXPECT_EQ(rig.status, TickStatus::kTracking);
  rig.tick();
  EXPECT_EQ(rig.status, TickStatus::kHolding);
}

TEST(Controller, LetsTheDriveHoldAndWaitsForALostJoint) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(1000);
  const double plan_time = rig.frame.plan_time;
  const double torque = rig.robot.commands[2].tau;
  const double reference = rig.frame.q_ref[2];
  for (int i = 0; i < 5; ++i) {
    if (i % 2 == 0)
      rig.robot.states[2].q = std::numeric_limits<double>::quiet_NaN();
    else
      rig.robot.states[2].flags |= kJointStale;
    rig.tick();
    rig.robot.states[2].flags = 0;
    EXPECT_EQ(rig.status, TickStatus::kWaiting);
    // What the drive makes of it where the joint last was is what the host last asked for.
    const JointCommand& blind = rig.robot.commands[2];
    EXPECT_EQ(blind.q, reference);
    EXPECT_EQ(blind.kp, rig.config.joints[2].gains.kp);
    EXPECT_EQ(blind.kd, rig.config.joints[2].gains.kd);
    const test::Plant& plant = rig.robot.plants[2];
    EXPECT_NEAR(blind.tau + blind.kp * (blind.q - plant.q) - blind.kd * plant.dq, torque, 0.5);
    EXPECT_EQ(rig.frame.plan_time, plan_time);
    for (const auto& c : rig.robot.commands) EXPECT_TRUE(std::isfinite(c.tau));
  }
  rig.tick();
  EXPECT_EQ(rig.status, TickStatus::kTracking);
  EXPECT_NEAR(rig.frame.plan_time, plan_time + 1e-3, 1e-9);
}

TEST(Controller, FaultsWhenAJointStaysLost) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(1000);
  for (int i = 0; i < 6; ++i) {
    rig.robot.states[2].dq = std::numeric_limits<double>::infinity();
    rig.tick();
  }
  EXPECT_EQ(rig.status, TickStatus::kFault);
  EXPECT_EQ(rig.controller.fault(), FaultCode::kStaleState);
  EXPECT_EQ(rig.controller.fault_joint(), 2u);
  rig.run(100);
  EXPECT_EQ(rig.status, TickStatus::kFault);
}

TEST(Controller, DoesNotFollowAnEncoderThatJumps) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(1000);
  for (int i = 0; i < 50; ++i) {
    rig.robot.states[2].q += 0.2;
    rig.tick();
    EXPECT_EQ(rig.robot.commands[2].kp, 0.0);
    EXPECT_LT(std::abs(rig.robot.commands[2].tau), 5.0);  // the PID would ask for 120 N m
    EXPECT_EQ(rig.status, i < 5 ? TickStatus::kWaiting : TickStatus::kFault);
  }
  EXPECT_EQ(rig.controller.fault(), FaultCode::kUnbelievable);
  EXPECT_EQ(rig.controller.fault_joint(), 2u);
}

TEST(Controller, DoesNotBelieveAReadingThatStandsStillWhileThePlanMoves) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(1000);
  const JointState frozen = rig.robot.states[2];
  const double start = rig.frame.q_ref[2];
  int ticks = 0;
  for (; rig.status != TickStatus::kFault && ticks < 1000; ++ticks) {
    rig.robot.states[2] = frozen;
    rig.tick();
  }
  EXPECT_EQ(rig.controller.fault(), FaultCode::kUnbelievable);
  EXPECT_NEAR(rig.frame.q_ref[2] - start, 0.005, 0.001);
}

/// A few lost replies, each of another joint, are no reason to give up.
TEST(Controller, CountsLostTicksPerJoint) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(1000);
  for (std::size_t i = 0; i < 100; ++i) {
    rig.robot.states[i % kJoints].flags |= kJointStale;
    rig.tick();
    rig.robot.states[i % kJoints].flags = 0;
    EXPECT_EQ(rig.status, TickStatus::kWaiting);
  }
}

TEST(Controller, HoldsWhereItIsWhenTrackingFails) {
  Rig rig;
  rig.config.tracking_error_limit = 0.05;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(1000);
  rig.robot.plants[1].load = 45.0;  // stronger than the drive
  int ticks = 0;
  for (; rig.status != TickStatus::kFault && ticks < 1000; ++ticks) rig.tick();
  ASSERT_EQ(rig.status, TickStatus::kFault);
  EXPECT_EQ(rig.controller.fault(), FaultCode::kTrackingError);
  EXPECT_EQ(rig.controller.fault_joint(), 1u);
  rig.robot.plants[1].load = 0.0;
  rig.run(3000);
  EXPECT_EQ(rig.status, TickStatus::kFault);
  for (const auto& s : rig.robot.states) EXPECT_NEAR(s.dq, 0.0, 1e-3);
}

TEST(Controller, FaultsOnADriveFaultAndOnAFarStart) {
  Rig rig;
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(10);
  rig.robot.states[3].flags = kJointFault;
  rig.tick();
  EXPECT_EQ(rig.status, TickStatus::kFault);
  EXPECT_EQ(rig.controller.fault(), FaultCode::kDriveFault);

  Rig far;
  far.place(0.6);
  ASSERT_EQ(far.load().status, LoadStatus::kOk);
  far.tick();
  EXPECT_EQ(far.status, TickStatus::kFault);
  EXPECT_EQ(far.controller.fault(), FaultCode::kStartDistance);
}

TEST(Controller, TellsThePolicyOfThePhaseItIsIn) {
  EXPECT_EQ(Controller().lost_host_policy(), FailurePolicy::kHold);
  Rig rig;
  auto keyframes = test::smooth_keyframes(kJoints, kKeyframes);
  for (ImageKeyframe& k : keyframes)
    if (k.phase == 1) k.failure_policy = static_cast<std::uint32_t>(FailurePolicy::kLower);
  rig.image = test::make_image(kJoints, keyframes);
  ASSERT_EQ(rig.load().status, LoadStatus::kOk);
  // Keyframes 11 to 20, so the phase lasts from keyframe 10, at 1 s of the plan, to the 20th.
  const auto lowers = [&] { return rig.controller.lost_host_policy() == FailurePolicy::kLower; };
  while (rig.frame.plan_time < 0.995) {
    rig.tick();
    ASSERT_FALSE(lowers()) << rig.frame.plan_time;
  }
  rig.run(10);
  EXPECT_EQ(rig.controller.lost_host_policy(1.1), FailurePolicy::kHold);  // of the phase to come
  while (rig.frame.plan_time < 1.995) {
    rig.tick();
    ASSERT_TRUE(lowers()) << rig.frame.plan_time;
  }
  rig.run(10);
  do {
    rig.tick();
    ASSERT_FALSE(lowers()) << rig.frame.plan_time;
  } while (rig.status != TickStatus::kFinished);
}

TEST(Controller, WithoutAPlanItCommandsNothing) {
  Rig rig;
  rig.robot.commands[0].tau = 5.0;
  rig.tick();
  EXPECT_EQ(rig.status, TickStatus::kFault);
  EXPECT_EQ(rig.controller.fault(), FaultCode::kNotLoaded);
  EXPECT_EQ(rig.robot.commands[0].tau, 0.0);
}

// ---- supervision; what follows on what: supervisor_test.cpp

Rig executing(const auto& change) {
  Rig rig;
  change(rig.config);
  EXPECT_EQ(rig.load().status, LoadStatus::kOk);
  rig.run(1000);
  EXPECT_EQ(rig.status, TickStatus::kTracking);
  return rig;
}

TEST(Controller, CommandsNothingBeforeItIsArmedAndHoldsUntilItIsStarted) {
  Rig rig;
  rig.place(0.1);
  for (auto& s : rig.robot.states) s.tau = 3.0;
  ASSERT_EQ(rig.controller.load(rig.config, test::kRobotHash, rig.image, rig.workspace).status,
            LoadStatus::kOk);
  EXPECT_EQ(rig.controller.supervision().mode, Mode::kBoot);
  rig.controller.request(OperatorCommand::kStart);  // without arm: nothing
  for (int i = 0; i < 50; ++i) {
    static_cast<void>(rig.controller.tick(rig.robot.states, rig.robot.commands, rig.frame));
    for (const auto& c : rig.robot.commands) EXPECT_EQ(c.tau, 0.0);
  }
  EXPECT_EQ(rig.controller.supervision().mode, Mode::kDisabled);
  rig.controller.request(OperatorCommand::kArm);
  rig.tick();
  EXPECT_EQ(rig.status, TickStatus::kIdle);
  for (const auto& c : rig.robot.commands) EXPECT_DOUBLE_EQ(c.tau, 3.0);
  rig.run(500);
  for (const auto& s : rig.robot.states) EXPECT_NEAR(s.q, 0.1, 0.01);
  rig.controller.request(OperatorCommand::kStart);
  rig.tick();
  EXPECT_EQ(rig.status, TickStatus::kMovingToStart);
  rig.controller.request(OperatorCommand::kDisarm);  // not in motion
  rig.tick();
  EXPECT_EQ(rig.status, TickStatus::kMovingToStart);
}

TEST(Controller, PausesStopsAndStartsAgain) {
  Rig rig = executing([](auto&) {});
  rig.controller.request(OperatorCommand::kPause);
  rig.run(300);
  EXPECT_EQ(rig.status, TickStatus::kPaused);
  const double time = rig.frame.plan_time;
  EXPECT_NEAR(time, 0.8 + 0.125, 2e-3);
  rig.run(1000);
  EXPECT_EQ(rig.frame.plan_time, time);
  rig.controller.request(OperatorCommand::kResume);
  rig.run(500);
  EXPECT_EQ(rig.status, TickStatus::kTracking);
  EXPECT_GT(rig.frame.plan_time, time + 0.3);
  rig.controller.request(OperatorCommand::kStop);
  rig.controller.request(OperatorCommand::kResume);  // does not outrank stop
  rig.run(400);
  EXPECT_EQ(rig.status, TickStatus::kStopped);
  EXPECT_EQ(rig.controller.fault(), FaultCode::kNone);
  rig.controller.request(OperatorCommand::kStart);
  for (int i = 0; i < 8000 && rig.status != TickStatus::kFinished; ++i) rig.tick();
  EXPECT_EQ(rig.status, TickStatus::kFinished);
}

TEST(Controller, AnEstopIsHeldUntilItIsAcknowledged) {
  Rig rig = executing([](auto&) {});
  rig.controller.request(OperatorCommand::kEstop);
  rig.run(400);
  EXPECT_EQ(rig.status, TickStatus::kFault);
  EXPECT_EQ(rig.controller.fault(), FaultCode::kEstop);
  EXPECT_EQ(rig.controller.supervision().mode, Mode::kHolding);
  const double held = rig.frame.q_ref[0];
  for (const auto command :
       {OperatorCommand::kStart, OperatorCommand::kResume, OperatorCommand::kArm}) {
    rig.controller.request(command);
    rig.run(100);
    EXPECT_EQ(rig.status, TickStatus::kFault);
    EXPECT_EQ(rig.frame.q_ref[0], held);
  }
  rig.controller.request(OperatorCommand::kAck);
  rig.run(10);
  EXPECT_EQ(rig.status, TickStatus::kIdle);
  rig.controller.request(OperatorCommand::kStart);
  rig.run(10);
  EXPECT_EQ(rig.status, TickStatus::kMovingToStart);
}

TEST(Controller, LowersSlowlyThenLetsGo) {
  Rig rig = executing([](auto& c) { c.failure_policy = FailurePolicy::kLower; });
  rig.robot.plants[1].load = -8.0;
  rig.run(500);
  const double before = rig.robot.commands[1].tau;
  const double height = rig.robot.states[1].q;
  rig.controller.request(OperatorCommand::kEstop);
  rig.tick();
  EXPECT_EQ(rig.controller.supervision().mode, Mode::kLowering);
  EXPECT_NEAR(rig.robot.commands[1].tau, before, 0.5);  // no step
  double fastest = 0.0, last = rig.robot.commands[1].tau;
  for (int i = 0; i < 2990; ++i) {
    rig.tick();
    fastest = std::max(fastest, std::abs(rig.robot.states[1].dq));
    ASSERT_LE(std::abs(rig.robot.commands[1].tau - last), 1.0);
    last = rig.robot.commands[1].tau;
    ASSERT_EQ(rig.controller.supervision().mode, Mode::kLowering);
  }
  EXPECT_LT(rig.robot.states[1].q, height - 0.1);  // it sinks,
  EXPECT_LT(fastest, 8.0 / 20.0);                  // slower than the damping alone allows
  rig.run(20);
  EXPECT_EQ(rig.controller.supervision().mode, Mode::kFault);
  for (const auto& c : rig.robot.commands) EXPECT_EQ(c.tau, 0.0);
  for (const auto command : {OperatorCommand::kArm, OperatorCommand::kStart}) {
    rig.controller.request(command);
    rig.tick();
    EXPECT_EQ(rig.controller.supervision().mode, Mode::kFault);
  }
  for (auto& plant : rig.robot.plants) plant.load = 0.0;
  rig.controller.request(OperatorCommand::kAck);
  rig.run(2);
  EXPECT_EQ(rig.controller.supervision().mode, Mode::kDisabled);
  rig.controller.request(OperatorCommand::kArm);
  rig.run(300);
  EXPECT_EQ(rig.status, TickStatus::kIdle);
  for (const auto& s : rig.robot.states) EXPECT_NEAR(s.dq, 0.0, 1e-3);
}

TEST(Controller, GoesLimpWhereThatIsThePolicy) {
  Rig rig = executing([](auto& c) { c.failure_policy = FailurePolicy::kLimp; });
  rig.robot.states[2].flags = kJointFault;
  rig.tick();
  EXPECT_EQ(rig.controller.supervision().mode, Mode::kLimp);
  EXPECT_EQ(rig.controller.fault(), FaultCode::kDriveFault);
  for (const auto& c : rig.robot.commands) {
    EXPECT_EQ(c.tau, 0.0);
    EXPECT_EQ(c.kp + c.kd, 0.0);
  }
}

TEST(Controller, WatchesEveryInputOfTheSupervisor) {
  const auto fault = [](const auto& config, const auto& disturb, int ticks = 300) {
    Rig rig = executing(config);
    for (int i = 0; i < ticks && rig.status != TickStatus::kFault; ++i) {
      disturb(rig);
      rig.tick();
    }
    return std::pair(rig.controller.fault(), rig.controller.fault_joint());
  };
  const auto none = [](auto&) {};
  EXPECT_EQ(fault(none, [](Rig&) {}), std::pair(FaultCode::kNone, 0u));
  EXPECT_EQ(fault([](auto& c) { c.saturation_time = 0.1; },
                  [](Rig& r) { r.robot.states[1].flags |= kJointSaturated; }),
            std::pair(FaultCode::kSaturation, 1u));
  EXPECT_EQ(
      fault([](auto& c) { c.overspeed_factor = 0.5; }, [](Rig& r) { r.robot.states[2].dq = 2.5; }),
      std::pair(FaultCode::kOverspeed, 2u));
  EXPECT_EQ(fault([](auto& c) { c.jump_limit = 9.0, c.tracking_error_limit = 9.0; },
                  [](Rig& r) { r.robot.states[3].q = 2.2; }),
            std::pair(FaultCode::kJointLimit, 3u));
  EXPECT_EQ(fault(none, [](Rig& r) { r.robot.states[3].temperature = 111.0; }),
            std::pair(FaultCode::kTemperature, 3u));
  EXPECT_EQ(fault(none, [](Rig& r) { r.controller.set_bus_health({.down = true}); }),
            std::pair(FaultCode::kBusDown, 0u));
  EXPECT_EQ(fault(none, [](Rig& r) { r.controller.set_bus_health({.skipped_ticks = 101}); }),
            std::pair(FaultCode::kWatchdog, 0u));
  EXPECT_EQ(fault(none, [](Rig& r) { r.controller.set_bus_health({.skipped_ticks = 100}); }),
            std::pair(FaultCode::kNone, 0u));
}

TEST(Controller, CommandsWaitInBootUntilEveryJointIsHeardUnlessOneTakesThemBack) {
  for (const bool stopped : {false, true}) {
    Rig rig;
    ASSERT_EQ(rig.load().status, LoadStatus::kOk);
    rig.robot.states[0].flags = kJointStale;
    rig.tick();
    EXPECT_EQ(rig.status, TickStatus::kWaiting);
    for (const auto& c : rig.robot.commands) EXPECT_EQ(c.tau, 0.0);
    if (stopped) rig.controller.request(OperatorCommand::kStop);
    rig.tick();
    rig.robot.states[0].flags = 0;
    rig.tick();
    EXPECT_EQ(rig.status, stopped ? TickStatus::kIdle : TickStatus::kMovingToStart);
  }
}

TEST(Controller, RefusesWhatItCannotExecute) {
  const auto status = [](const auto& change) {
    Rig rig;
    change(rig);
    return rig.load().status;
  };
  EXPECT_EQ(status([](Rig& r) { r.config.dt = 0.0; }), LoadStatus::kBadConfig);
  EXPECT_EQ(status([](Rig& r) { r.config.joint_count = 33; }), LoadStatus::kBadConfig);
  EXPECT_EQ(status([](Rig& r) { r.config.joints[1].gains.kp = std::nan(""); }),
            LoadStatus::kBadConfig);
  EXPECT_EQ(status([](Rig& r) { r.config.tracking_error_limit = std::nan(""); }),
            LoadStatus::kBadConfig);
  EXPECT_EQ(status([](Rig& r) { r.config.joint_count = 3; }), LoadStatus::kBadImage);
  EXPECT_EQ(status([](Rig& r) { r.image[200] ^= std::byte{1}; }), LoadStatus::kBadImage);
  EXPECT_EQ(status([](Rig& r) { r.workspace.resize(10); }), LoadStatus::kWorkspaceTooSmall);
  EXPECT_EQ(status([](Rig& r) { r.config.joints[2].velocity_limit = 0.01; }), LoadStatus::kTooFast);
  EXPECT_EQ(status([](Rig& r) { r.config.time_scale = 100.0; }), LoadStatus::kTooFast);
  EXPECT_EQ(status([](Rig& r) {
              auto k = test::smooth_keyframes(kJoints, kKeyframes);
              for (std::size_t i = 15; i < k.size(); ++i) k[i].q[0] += 1.0;  // a jump rings
              r.image = test::make_image(kJoints, k);
              for (auto& joint : r.config.joints) joint.velocity_limit = 100.0;
            }),
            LoadStatus::kOvershoot);
}

TEST(Controller, TwoRunsCommandTheSameBytes) {
  const auto run = [] {
    Rig rig;
    rig.place(0.05);
    EXPECT_EQ(rig.load().status, LoadStatus::kOk);
    std::vector<JointCommand> log;
    std::vector<TelemetryFrame> frames;
    for (int i = 0; i < 4000; ++i) {
      rig.tick();
      log.insert(log.end(), rig.robot.commands.begin(), rig.robot.commands.end());
      frames.push_back(rig.frame);
    }
    return std::pair(log, frames);
  };
  const auto [log_a, frames_a] = run();
  const auto [log_b, frames_b] = run();
  ASSERT_EQ(log_a.size(), log_b.size());
  EXPECT_EQ(std::memcmp(log_a.data(), log_b.data(), log_a.size() * sizeof(JointCommand)), 0);
  EXPECT_EQ(std::memcmp(frames_a.data(), frames_b.data(), frames_a.size() * sizeof(TelemetryFrame)),
            0);
}

}  // namespace
}  // namespace clamber
