// Properties of the reference on random plans: continuous to the second derivative through pauses,
// slow-downs, resumes and changes of plan at any instant; within its limits; right at its end.
#include <gtest/gtest.h>

#include <random>
#include <tuple>
#include <vector>

#include "control/controller.hpp"
#include "control/plan_clock.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

constexpr double kDt = 1e-3;
constexpr double kPauseTime = 0.25;
// Peaks of a cubic ramp over the whole rate: 1.5 / T and 6 / T^2.
constexpr double kClockAcceleration = 1.5 / kPauseTime;
constexpr double kClockJerk = 6.0 / (kPauseTime * kPauseTime);

// ---- the clock

TEST(PlanClock, ASteadyRateCountsTicks) {
  PlanClock clock;
  clock.configure(kPauseTime, kDt);
  clock.start(0.0, 0.5, 1.0);
  for (int i = 0; i < 4000; ++i) {
    EXPECT_EQ(clock.time(), i * kDt * 0.5);
    EXPECT_FALSE(clock.reached(2.0));
    clock.advance();
  }
  EXPECT_TRUE(clock.reached(2.0));
}

TEST(PlanClock, RampsWithinItsLimitsWheneverTheAimChanges) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  PlanClock clock;
  clock.configure(kPauseTime, kDt);
  clock.start(0.0, 1.0, 1.0);
  double time = 0.0, rate = 1.0, acceleration = 0.0;
  for (int i = 0; i < 200000; ++i) {
    // From several in one ramp to long after it.
    if (random() % (i % 2000 < 1000 ? 40 : 900) == 0)
      clock.aim(random() % 3 == 0 ? 0.0 : random() % 2 == 0 ? 1.0 : share(random));
    clock.advance();
    ASSERT_GE(clock.rate(), 0.0);
    ASSERT_LE(clock.rate(), 1.0);
    ASSERT_LE(std::abs(clock.acceleration()), kClockAcceleration * 1.000001);
    ASSERT_LE(std::abs(clock.acceleration() - acceleration), kClockJerk * kDt * 1.000001);
    ASSERT_NEAR(clock.rate() - rate, 0.5 * kDt * (acceleration + clock.acceleration()),
                kClockJerk * kDt * kDt);
    ASSERT_NEAR(clock.time() - time, 0.5 * kDt * (rate + clock.rate()), 1e-8);
    time = clock.time();
    rate = clock.rate();
    acceleration = clock.acceleration();
  }
}

TEST(PlanClock, StandsAfterThePauseTimeAndRunsAgain) {
  PlanClock clock;
  clock.configure(kPauseTime, kDt);
  clock.start(1.0, 1.0, 1.0);
  clock.aim(0.0);
  for (int i = 0; i < 250; ++i) clock.advance();
  EXPECT_TRUE(clock.stands());
  EXPECT_NEAR(clock.time(), 1.0 + 0.5 * kPauseTime, 1e-12);
  const double where = clock.time();
  for (int i = 0; i < 100; ++i) clock.advance();
  EXPECT_EQ(clock.time(), where);
  clock.aim(1.0);
  for (int i = 0; i < 250; ++i) clock.advance();
  EXPECT_EQ(clock.rate(), 1.0);
}

// ---- what follows it

constexpr std::uint32_t kJoints = 3;
constexpr std::size_t kKeyframes = 25;

std::vector<ImageKeyframe> random_keyframes(std::mt19937& random) {
  std::uniform_real_distribution<double> step(0.08, 0.2), move(-0.06, 0.06), torque(-9.0, 9.0);
  std::vector<ImageKeyframe> keyframes(kKeyframes);
  for (std::size_t i = 0; i < kKeyframes; ++i) {
    if (i > 0) keyframes[i].time = keyframes[i - 1].time + step(random);
    for (std::size_t j = 0; j < kJoints; ++j) {
      keyframes[i].q[j] = (i > 0 ? keyframes[i - 1].q[j] : 0.0) + move(random);
      keyframes[i].tau[j] = torque(random);
    }
  }
  return keyframes;
}

struct Plan {
  std::vector<ImageKeyframe> keyframes;
  std::vector<std::byte> image = test::make_image(kJoints, keyframes);
  std::vector<double> workspace = std::vector<double>(Controller::workspace_size(kKeyframes));
  explicit Plan(std::mt19937& random) : keyframes(random_keyframes(random)) {}
};

ControllerConfig config_with(double start_distance_limit) {
  ControllerConfig config = test::make_config(kJoints);
  config.pause_time = kPauseTime;
  config.start_distance_limit = start_distance_limit;
  return config;
}

/// A robot that is where it is asked to be, and a check of every tick's reference.
class Follower {
 public:
  explicit Follower(unsigned seed) : random_(seed), plan_(random_) {
    report_ = controller_.load(config_, test::kRobotHash, plan_.image, plan_.workspace);
    EXPECT_EQ(report_.status, LoadStatus::kOk);
    controller_.request(OperatorCommand::kArm);
    controller_.request(OperatorCommand::kStart);
  }

  TickStatus tick() {
    const TickStatus status = controller_.tick(states_, commands_, frame_);
    for (std::size_t j = 0; j < kJoints; ++j) check(j);
    for (std::size_t j = 0; j < kJoints; ++j) {
      states_[j].q = commands_[j].q;
      states_[j].dq = commands_[j].dq;
    }
    return status;
  }

  /// The clamped spline rests at the plan's ends but does accelerate there.
  void forgive_acceleration() { acceleration_known_ = false; }

  std::mt19937 random_;
  Plan plan_;
  ControllerConfig config_ = config_with(2.0);
  Controller controller_;
  LoadReport report_;
  TelemetryFrame frame_;
  std::vector<JointState> states_{kJoints};
  std::vector<JointCommand> commands_{kJoints};
  double velocity_ = 0.0;  ///< of plans switched to, rad/s
  double acceleration_ = 0.0;
  double jerk_ = 0.0;

 private:
  void check(std::size_t j) {
    const double q = commands_[j].q;
    const double dq = commands_[j].dq;
    const double ddq = (dq - dq_[j]) / kDt;
    const double v = std::max({report_.velocity, velocity_, config_.start_speed * 2.0});
    const double a = std::max({report_.acceleration, acceleration_, 40.0});
    const double jerk =
        std::max({report_.jerk, jerk_, 600.0}) + 3.0 * a * kClockAcceleration + v * kClockJerk;
    const double most = a + v * kClockAcceleration;
    if (known_) {
      ASSERT_NEAR(q - q_[j], 0.5 * kDt * (dq + dq_[j]), jerk * kDt * kDt * kDt);
      ASSERT_LE(std::abs(dq), v + 1e-9);
      ASSERT_LE(std::abs(ddq), most) << "tick " << frame_.sequence;
    }
    if (known_ && acceleration_known_) {
      ASSERT_LE(std::abs(ddq - ddq_[j]), 2.0 * jerk * kDt) << "tick " << frame_.sequence;
    }
    q_[j] = q;
    dq_[j] = dq;
    ddq_[j] = ddq;
    if (j + 1 == kJoints) {
      acceleration_known_ = known_;
      known_ = true;
    }
  }

  bool known_ = false;
  bool acceleration_known_ = false;
  std::array<double, kJoints> q_{}, dq_{}, ddq_{};
};

class ReferenceProperties : public testing::TestWithParam<unsigned> {};

/// Where the plan begins and ends the spline's own acceleration sets in and ends.
TickStatus tick_forgiving_ends(Follower& robot, TickStatus& before) {
  const double time = robot.frame_.plan_time;
  if (before == TickStatus::kMovingToStart || time < 0.01 ||
      time > robot.plan_.keyframes.back().time - 0.01)
    robot.forgive_acceleration();
  return before = robot.tick();
}

TEST_P(ReferenceProperties, PausesSlowsAndGoesOnAnywhere) {
  Follower robot(GetParam());
  TickStatus status = TickStatus::kIdle;
  int pauses = 0;
  for (int i = 0; i < 100000 && status != TickStatus::kFinished; ++i) {
    switch (robot.random_() % 300) {
      case 0:
      case 1:
        robot.controller_.request(OperatorCommand::kPause);
        break;
      case 2:
        robot.controller_.set_speed(1e-3 * static_cast<double>(100 + robot.random_() % 901));
        break;
      default:
        break;
    }
    if (status == TickStatus::kPaused && robot.random_() % 200 == 0)
      robot.controller_.request(OperatorCommand::kResume);
    pauses += status == TickStatus::kPaused ? 1 : 0;
    tick_forgiving_ends(robot, status);
    ASSERT_NE(status, TickStatus::kFault) << to_string(robot.controller_.fault());
    if (testing::Test::HasFatalFailure()) return;
  }
  EXPECT_EQ(status, TickStatus::kFinished);
  EXPECT_GT(pauses, 100);
  for (std::size_t j = 0; j < kJoints; ++j)
    EXPECT_EQ(robot.commands_[j].q, robot.plan_.keyframes.back().q[j]);
}

TEST_P(ReferenceProperties, APausedReferenceStandsInTime) {
  for (int at = 210; at < 2200; at += 97) {
    Follower robot(GetParam());
    TickStatus status = TickStatus::kIdle;
    for (int i = 0; i < at; ++i) tick_forgiving_ends(robot, status);
    robot.controller_.request(OperatorCommand::kPause);
    for (int i = 0; i < 252; ++i) tick_forgiving_ends(robot, status);
    const auto held = robot.commands_;
    for (int i = 0; i < 50; ++i) tick_forgiving_ends(robot, status);
    ASSERT_EQ(status, TickStatus::kPaused);
    for (std::size_t j = 0; j < kJoints; ++j) {
      EXPECT_EQ(robot.commands_[j].q, held[j].q);
      EXPECT_EQ(robot.commands_[j].dq, 0.0);
    }
    if (testing::Test::HasFatalFailure()) return;
  }
}

TEST_P(ReferenceProperties, BlendsIntoAnotherPlanAndIntoARunningOne) {
  for (const bool running : {false, true})
    for (int at = 230; at < 2000; at += 411) {
      Follower robot(GetParam());
      TickStatus status = TickStatus::kIdle;
      for (int i = 0; i < at; ++i) tick_forgiving_ends(robot, status);
      Plan other(robot.random_);
      ControllerPlan plan;
      const LoadReport report =
          Controller::open(robot.config_, test::kRobotHash, other.image, other.workspace, plan);
      ASSERT_EQ(report.status, LoadStatus::kOk);
      robot.velocity_ = std::max(report.velocity, 1.5);
      robot.acceleration_ = report.acceleration * 2.0;  // a blend is no spline
      robot.jerk_ = std::max(report.jerk, robot.report_.jerk) * 8.0;
      const double join = running ? other.keyframes[7].time + 0.013 : 0.0;
      const SwitchStatus taken = robot.controller_.switch_plan(plan, join);
      ASSERT_EQ(taken, SwitchStatus::kOk) << to_string(taken);
      EXPECT_EQ(robot.controller_.switch_plan(plan, join), SwitchStatus::kNotNow);
      robot.plan_.keyframes = other.keyframes;
      status = robot.tick();
      EXPECT_EQ(status, TickStatus::kMovingToStart);
      for (int i = 0; i < 10000 && status != TickStatus::kFinished; ++i) {
        const double time = robot.frame_.plan_time;
        const bool starts = !running && time < 0.01;
        if (starts || time > other.keyframes.back().time - 0.01) robot.forgive_acceleration();
        status = robot.tick();
        ASSERT_NE(status, TickStatus::kFault);
        if (testing::Test::HasFatalFailure()) return;
      }
      EXPECT_EQ(status, TickStatus::kFinished);
      for (std::size_t j = 0; j < kJoints; ++j)
        EXPECT_EQ(robot.commands_[j].q, other.keyframes.back().q[j]);
    }
}

INSTANTIATE_TEST_SUITE_P(RandomPlans, ReferenceProperties, testing::Range(0u, 6u));

TEST(Reference, RefusesASwitchToAFarPlanAndOneThatWouldLeaveTheLimits) {
  std::mt19937 random(1);
  Plan own(random), other(random);
  for (ImageKeyframe& k : other.keyframes) k.q[1] += 0.6;
  other.image = test::make_image(kJoints, other.keyframes);
  std::vector<JointState> states(kJoints);
  std::vector<JointCommand> commands(kJoints);
  TelemetryFrame frame;
  for (const auto& [distance, velocity, expected] :
       {std::tuple{2.0, 4.0, SwitchStatus::kOk}, std::tuple{0.2, 4.0, SwitchStatus::kTooFar},
        std::tuple{2.0, 0.9, SwitchStatus::kLeavesLimits}}) {
    ControllerConfig config = config_with(distance);
    config.start_speed = 2.0;
    Controller controller;
    ASSERT_EQ(controller.load(config, test::kRobotHash, own.image, own.workspace).status,
              LoadStatus::kOk);
    ControllerPlan plan;
    ASSERT_EQ(Controller::open(config, test::kRobotHash, other.image, other.workspace, plan).status,
              LoadStatus::kOk);
    for (JointControl& joint : config.joints) joint.velocity_limit = velocity;
    static_cast<void>(controller.load(config, test::kRobotHash, own.image, own.workspace));
    controller.request(OperatorCommand::kArm);
    controller.request(OperatorCommand::kStart);
    for (int i = 0; i < 800; ++i) {
      static_cast<void>(controller.tick(states, commands, frame));
      for (std::size_t j = 0; j < kJoints; ++j) states[j].q = commands[j].q;
    }
    EXPECT_EQ(to_string(controller.switch_plan(plan)), to_string(expected));
    EXPECT_EQ(controller.supervision().mode, Mode::kExecuting);
  }
}

TEST(Reference, LoadChecksAccelerationAndJerk) {
  std::mt19937 random(5);
  Plan plan(random);
  ControllerConfig config = config_with(0.5);
  Controller controller;
  const LoadReport report = controller.load(config, test::kRobotHash, plan.image, plan.workspace);
  ASSERT_EQ(report.status, LoadStatus::kOk);
  EXPECT_GT(report.velocity, 0.0);
  EXPECT_GT(report.acceleration, 0.0);
  EXPECT_GT(report.jerk, 0.0);
  config.acceleration_limit = 0.99 * report.acceleration;
  EXPECT_EQ(controller.load(config, test::kRobotHash, plan.image, plan.workspace).status,
            LoadStatus::kTooHard);
  config.acceleration_limit = 1.01 * report.acceleration;
  config.jerk_limit = 0.99 * report.jerk;
  EXPECT_EQ(controller.load(config, test::kRobotHash, plan.image, plan.workspace).status,
            LoadStatus::kTooJerky);
  // Half the speed: an eighth of the jerk.
  config.time_scale = 0.5;
  const LoadReport slow = controller.load(config, test::kRobotHash, plan.image, plan.workspace);
  EXPECT_EQ(slow.status, LoadStatus::kOk);
  EXPECT_DOUBLE_EQ(slow.jerk, report.jerk / 8.0);
}

}  // namespace
}  // namespace clamber
