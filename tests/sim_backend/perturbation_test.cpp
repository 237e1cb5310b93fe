// Perturbed worlds: draws, what they change, springs, drives and encoders.
#include "sim_backend/perturbation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "sim_fixture.hpp"

namespace clamber {
namespace {

TEST(Perturbation, TheSeedAloneGivesTheDraw) {
  const RobotModel model = test::coman();
  const Perturbation a = draw_perturbation({}, model, 7), b = draw_perturbation({}, model, 7);
  EXPECT_EQ(a.mass, b.mass);
  EXPECT_EQ(a.com, b.com);
  EXPECT_EQ(a.friction, b.friction);
  EXPECT_EQ(a.start_position, b.start_position);
  EXPECT_EQ(a.joint_friction, b.joint_friction);
  EXPECT_EQ(a.drives.torque_factor, b.drives.torque_factor);
  EXPECT_EQ(a.drives.delay, b.drives.delay);
  EXPECT_NE(a.friction, draw_perturbation({}, model, 8).friction);
}

TEST(Perturbation, DrawsFillTheirRanges) {
  const RobotModel model = test::coman();
  const PerturbationRange range;
  double low_friction = 9, high_friction = 0, high = 0, forward = 0, heaviest = 0;
  int springs = 0, exact = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    const Perturbation p = draw_perturbation(range, model, seed);
    low_friction = std::min(low_friction, p.friction);
    high_friction = std::max(high_friction, p.friction);
    high = std::max(high, std::abs(p.height));
    forward = std::max(forward, std::abs(p.start_position.x()));
    springs += p.springs ? 1 : 0;
    exact += p.stepper == OdeStepper::kExact ? 1 : 0;
    for (const double mass : p.mass) heaviest = std::max(heaviest, std::abs(mass - 1.0));
    EXPECT_GE(p.drives.delay, 0.0);
    EXPECT_LE(p.drives.delay, range.delay);
  }
  EXPECT_GE(low_friction, 0.5);
  EXPECT_LT(low_friction, 0.51);
  EXPECT_GT(high_friction, 0.99);
  EXPECT_LE(high_friction, 1.0);
  EXPECT_GT(high, 0.0098);
  EXPECT_LE(high, 0.01);
  EXPECT_GT(forward, 0.0196);
  EXPECT_LE(forward, 0.02);
  EXPECT_GT(heaviest, 0.0499);
  EXPECT_LE(heaviest, 0.05);
  EXPECT_NEAR(springs, 200, 40);
  EXPECT_GT(exact, 15);
}

TEST(Perturbation, EveryPartCanBeLeftOut) {
  const RobotModel model = test::coman();
  const Scenario scenario = test::box_scenario();
  Perturbation p = draw_perturbation({}, model, 3);
  for (const std::string_view part : kPerturbationParts) {
    EXPECT_TRUE(leave_out(p, part)) << part;
  }
  EXPECT_FALSE(leave_out(p, "weather"));
  const Configuration start = start_configuration(model, scenario);
  EXPECT_EQ(perturbed(start, scenario, p).X_WB.p, start.X_WB.p);
  EXPECT_EQ(perturbed(scenario, p).friction, scenario.friction);
  EXPECT_EQ(perturbed(scenario, p).obstacles[0].top(), scenario.obstacles[0].top());
  EXPECT_EQ(perturbed(model, p).bodies[5].mass, model.bodies[5].mass);
  EXPECT_EQ(perturbed(OdeOptions{}, p).iterations, OdeOptions{}.iterations);
}

TEST(Perturbation, ChangesModelScenarioAndStart) {
  const RobotModel model = test::coman();
  const Scenario scenario = test::box_scenario();
  const Perturbation p = draw_perturbation({}, model, 3);
  const RobotModel other = perturbed(model, p);
  double mass = 0.0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    EXPECT_DOUBLE_EQ(other.bodies[b].mass, model.bodies[b].mass * p.mass[b]);
    EXPECT_DOUBLE_EQ(other.bodies[b].com.x(), model.bodies[b].com.x() + p.com[b].x());
    mass += other.bodies[b].mass;
  }
  EXPECT_DOUBLE_EQ(other.total_mass, mass);
  const Scenario there = perturbed(scenario, p);
  EXPECT_NEAR(there.obstacles[0].top() - scenario.obstacles[0].top(), p.height, 1e-15);
  EXPECT_NEAR(there.obstacles[0].center.z(), there.obstacles[0].half_extents.z(), 1e-15);
  const Configuration from = start_configuration(model, scenario);
  const Configuration to = perturbed(from, scenario, p);
  EXPECT_DOUBLE_EQ(to.X_WB.p.z(), from.X_WB.p.z());
  // The soles' mid-point moves by the offset; the base is turned about it.
  const Eigen::Vector3d arm = from.X_WB.p - scenario.start_position;
  const Eigen::Vector3d turned = Eigen::AngleAxisd(p.start_yaw, Eigen::Vector3d::UnitZ()) * arm;
  EXPECT_NEAR(to.X_WB.p.x(), scenario.start_position.x() + turned.x() + p.start_position.x(),
              1e-12);
  EXPECT_NEAR(Eigen::Quaterniond(to.X_WB.R).angularDistance(Eigen::Quaterniond(from.X_WB.R)),
              std::abs(p.start_yaw), 1e-9);
}

/// One hinge with a spring between rotor and link, no gravity.
RobotModel elastic_joint(double stiffness, double damping = 0.0) {
  RobotModel model = test::one_joint(0.5, 0.1387, 0.0);
  model.joints[0].spring_stiffness = stiffness;
  model.joints[0].spring_damping = damping;
  return model;
}

OdeOptions elastic(double step) {
  OdeOptions options;
  options.gravity.setZero();
  options.springs = true;
  options.step = step;
  return options;
}

Scenario empty_world() {
  Scenario scenario = test::box_scenario();
  scenario.obstacles[0].center.x() = 100.0;
  return scenario;
}

Configuration aloft(const RobotModel& model) {
  Configuration x;
  x.X_WB.p.z() = 10.0;
  x.q = JointVector::Zero(model.joint_count());
  return x;
}

TEST(Springs, MotorAndLinkSwingAgainstEachOther) {
  // Two inertias on a spring: w^2 = k (1/I_r + 1/I_l); the base is too heavy to matter.
  const RobotModel model = elastic_joint(395.46);
  OdeWorld world(model, empty_world(), aloft(model), elastic(1e-4));
  const JointVector none = JointVector::Zero(1);
  JointVector push = none;
  push[0] = 20.0;
  for (int i = 0; i < 100; ++i) world.step(push);  // 10 ms
  double last = 0.0, first_cross = 0.0, last_cross = 0.0;
  int crossings = 0;
  for (int i = 0; i < 10000; ++i) {
    world.step(none);
    const double stretch = world.motor_position()[0] - world.configuration().q[0];
    if (last > 0.0 && stretch <= 0.0) {
      (crossings++ == 0 ? first_cross : last_cross) = world.time();
    }
    last = stretch;
  }
  const double period = (last_cross - first_cross) / (crossings - 1);
  EXPECT_NEAR(period, 2.0 * M_PI / std::sqrt(395.46 * (1.0 / 0.1387 + 1.0 / 0.5)), 5e-4);
  // What the push gave both inertias together is kept.
  const double momentum = 0.1387 * world.motor_rate()[0] + 0.5 * world.velocity()[6];
  EXPECT_NEAR(momentum, 20.0 * 0.01, 2e-3);
}

TEST(Springs, CarryTheLinksWeightAtRestStretchedByIt) {
  // A link held at rest: the motor leads by torque over stiffness.
  RobotModel model = elastic_joint(120.0, 0.198);
  model.bodies[1].com = {0.3, 0.0, 0.0};
  model.joints[0].damping = 3.0;
  OdeOptions options = elastic(1e-3);
  options.gravity = {0.0, 0.0, -9.81};
  Configuration x = aloft(model);
  OdeWorld world(model, empty_world(), x, options);
  world.set_base_guide(x.X_WB);
  JointVector tau(1);
  for (int i = 0; i < 4000; ++i) {
    tau[0] = 300.0 * (0.0 - world.motor_position()[0]) - 10.0 * world.motor_rate()[0];
    world.step(tau);
  }
  const double weight = 9.81 * 0.3 * std::cos(world.configuration().q[0]);
  EXPECT_NEAR(-world.drive_torque()[0], weight, 0.02);  // positive q lowers the link
  EXPECT_NEAR(world.configuration().q[0] - world.motor_position()[0], weight / 120.0, 3e-4);
}

TEST(Springs, VeryStiffOnesAreRigid) {
  RobotModel model = elastic_joint(1e7);
  model.joints[0].damping = 2.0;
  OdeOptions rigid = elastic(1e-3);
  rigid.springs = false;
  OdeWorld a(model, empty_world(), aloft(model), elastic(1e-3));
  OdeWorld b(model, empty_world(), aloft(model), rigid);
  JointVector tau(1);
  for (int i = 0; i < 500; ++i) {
    tau[0] = 5.0 * std::sin(0.02 * i);
    a.step(tau);
    b.step(tau);
  }
  EXPECT_NEAR(a.configuration().q[0], b.configuration().q[0], 1e-4);
  EXPECT_NEAR(b.motor_position()[0], b.configuration().q[0], 0.0);
}

TEST(JointFriction, TakesItsTorqueFromAMovingJoint) {
  RobotModel model = test::one_joint(0.5, 0.0, 0.0);
  model.joints[0].friction = 1.0;
  OdeOptions options = elastic(1e-3);
  options.springs = false;
  OdeWorld world(model, empty_world(), aloft(model), options);
  JointVector tau(1);
  tau[0] = 3.0;
  for (int i = 0; i < 200; ++i) world.step(tau);
  EXPECT_NEAR(world.velocity()[6], (3.0 - 1.0) / 0.5 * 0.2, 0.02);
  tau[0] = 0.0;
  for (int i = 0; i < 600; ++i) world.step(tau);
  EXPECT_NEAR(world.velocity()[6], 0.0, 0.01);
  tau[0] = 0.5;  // below the dry friction: it creeps and does not go
  for (int i = 0; i < 500; ++i) world.step(tau);
  EXPECT_LT(std::abs(world.velocity()[6]), 0.011);
}

class ImperfectBus : public testing::Test {
 protected:
  RobotModel model = elastic_joint(395.46);
  std::vector<JointCommand> commands{1};
  std::vector<JointState> states{1};

  OdeWorld make(double step, bool springs = false) const {
    OdeOptions options = elastic(step);
    options.springs = springs;
    return OdeWorld(model, empty_world(), aloft(model), options);
  }
};

TEST_F(ImperfectBus, StepsAsOftenAsATickNeeds) {
  OdeWorld half = make(5e-4), twice = make(2e-3);
  OdeBus fine(half, {}, 1e-3), coarse(twice, {}, 1e-3);
  ASSERT_EQ(fine.enable(), BusStatus::kOk);
  ASSERT_EQ(coarse.enable(), BusStatus::kOk);
  for (int i = 0; i < 10; ++i) {
    ASSERT_EQ(fine.exchange(commands, states, 0), BusStatus::kOk);
    ASSERT_EQ(coarse.exchange(commands, states, 0), BusStatus::kOk);
    EXPECT_EQ(states[0].sequence, static_cast<std::uint64_t>(i + 1));
  }
  EXPECT_NEAR(half.time(), 0.010, 1e-12);
  EXPECT_NEAR(twice.time(), 0.010, 1e-12);
}

TEST_F(ImperfectBus, DelaysCommands) {
  OdeWorld world = make(1e-3);
  OdeBus bus(world, {.torque_factor = {}, .delay = 0.002}, 1e-3);
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  commands[0].tau = 7.0;
  std::vector<double> given;
  for (int i = 0; i < 4; ++i) {
    ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
    given.push_back(world.drive_torque()[0]);
  }
  EXPECT_EQ(given, (std::vector<double>{0.0, 0.0, 7.0, 7.0}));
}

TEST_F(ImperfectBus, TorqueConstantsAreWrongUnseen) {
  OdeWorld world = make(1e-3);
  OdeBus bus(world, {.torque_factor = {1.05}}, 1e-3);
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  commands[0].tau = 10.0;
  ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
  EXPECT_DOUBLE_EQ(world.drive_torque()[0], 10.5);
  EXPECT_DOUBLE_EQ(states[0].tau, 10.0);
  EXPECT_EQ(states[0].flags, kJointEnabled);
}

TEST_F(ImperfectBus, EncodersCountOnTheMotorsSide) {
  OdeWorld world = make(1e-3, true);
  OdeBus bus(world,
             {.torque_factor = {}, .encoder_resolution = 1e-3, .encoder_noise = 2e-4, .seed = 5},
             1e-3);
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  commands[0].tau = 15.0;
  double before = 0.0;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
    const double counts = states[0].q / 1e-3;
    EXPECT_NEAR(counts, std::round(counts), 1e-6);
    EXPECT_NEAR(states[0].q, world.motor_position()[0], 0.5e-3 + 2e-4 + 1e-9);
    if (i > 0) {
      EXPECT_NEAR(states[0].dq, (states[0].q - before) / 1e-3, 1e-9);
    }
    before = states[0].q;
  }
  EXPECT_GT(std::abs(world.motor_position()[0] - world.configuration().q[0]), 2e-3);
}

}  // namespace
}  // namespace clamber
