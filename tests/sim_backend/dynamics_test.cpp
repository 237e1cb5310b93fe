// The simulated robot away from contacts: joints, drives, gravity, energy, determinism.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "sim_fixture.hpp"

namespace clamber {
namespace {

using test::coman;
using test::hold;
using test::one_joint;

Scenario empty_floor() {
  Scenario scenario;
  scenario.name = "floor";
  return scenario;
}

Configuration aloft(const RobotModel& model, double height = 5.0) {
  Configuration x;
  x.q = model.home;
  x.X_WB.p.z() = height;
  return x;
}

OdeOptions weightless() {
  OdeOptions options;
  options.gravity.setZero();
  return options;
}

JointVector single(double tau) { return JointVector::Constant(1, tau); }

// --- one joint -------------------------------------------------------------------------------

TEST(ReflectedInertia, TorqueStepShowsLinkPlusReflectedInertia) {
  for (const double reflected : {0.0, 0.01, 0.1387}) {
    const RobotModel model = one_joint(0.02, reflected, 0.0);
    OdeWorld world(model, empty_floor(), aloft(model), weightless());
    constexpr int kSteps = 100;
    for (int k = 0; k < kSteps; ++k) {
      world.step(single(0.5));
    }
    const double expected = 0.5 / (0.02 + reflected) * kSteps * world.options().step;
    EXPECT_NEAR(world.velocity()[6], expected, 0.005 * expected) << reflected;
  }
}

TEST(ReflectedInertia, ResistsTheJointButNotTheBody) {
  // Base and link turn together: the rotor does not move against the stator.
  const RobotModel model = one_joint(0.02, 0.1387, 0.0);
  OdeWorld world(model, empty_floor(), aloft(model), weightless());
  VelocityVector v = VelocityVector::Zero(7);
  v[4] = 1.0;
  world.reset(aloft(model), v);
  for (int k = 0; k < 200; ++k) {
    world.step(single(0.0));
  }
  EXPECT_NEAR(world.velocity()[4], 1.0, 1e-6);
  EXPECT_NEAR(world.velocity()[6], 0.0, 1e-6);
}

TEST(JointDamping, IsStableFarBeyondTheExplicitLimit) {
  const RobotModel model = one_joint(1e-4, 0.0, 3.0);  // damping step / inertia = 30
  OdeWorld world(model, empty_floor(), aloft(model), weightless());
  VelocityVector v = VelocityVector::Zero(7);
  v[6] = 1.0;
  world.reset(aloft(model), v);
  double before = 1.0;
  for (int k = 0; k < 20; ++k) {
    world.step(single(0.0));
    EXPECT_LE(std::abs(world.velocity()[6]), std::max(before, 1e-6));
    before = std::abs(world.velocity()[6]);
  }
  EXPECT_LT(before, 1e-3);
}

TEST(JointDamping, SteadyRateIsTorqueOverDamping) {
  RobotModel model = one_joint(0.02, 0.1387, 3.0);
  OdeWorld world(model, empty_floor(), aloft(model), weightless());
  for (int k = 0; k < 600; ++k) {
    world.step(single(3.0));
  }
  EXPECT_NEAR(world.velocity()[6], 1.0, 0.01);
}

TEST(JointStop, HoldsAgainstTheDriveWithoutBouncing) {
  RobotModel model = one_joint(0.02, 0.1387, 0.0);
  model.joints[0].upper = 0.2;
  OdeWorld world(model, empty_floor(), aloft(model), weightless());
  double furthest = 0.0;
  double nearest_after_touch = 1.0;
  for (int k = 0; k < 1000; ++k) {
    world.step(single(50.0));
    furthest = std::max(furthest, world.configuration().q[0]);
    if (furthest > 0.2) {
      nearest_after_touch = std::min(nearest_after_touch, world.configuration().q[0]);
    }
  }
  EXPECT_NEAR(world.configuration().q[0], 0.2, 0.0015);
  EXPECT_GT(nearest_after_touch, 0.195);
  EXPECT_LT(furthest, 0.225);  // arrives with 11 rad/s, three times the joint's speed limit
}

TEST(JointStop, LetsGoFreely) {
  RobotModel model = one_joint(0.02, 0.1387, 0.0);
  model.joints[0].upper = 0.0;
  OdeWorld world(model, empty_floor(), aloft(model), weightless());
  for (int k = 0; k < 300; ++k) {
    world.step(single(20.0));
  }
  const double start = world.configuration().q[0];
  for (int k = 0; k < 100; ++k) {
    world.step(single(-1.0));
  }
  const double path = 0.5 * (1.0 / 0.1587) * 0.1 * 0.1;
  EXPECT_LT(world.configuration().q[0], start - path);
  EXPECT_GT(world.configuration().q[0], start - 1.25 * path);  // the stop's spring gave it a push
}

TEST(JointAngle, GoesOnBeyondHalfATurn) {
  RobotModel model = one_joint(0.02, 0.1, 0.0);
  model.joints[0].lower = -3.4;
  OdeWorld world(model, empty_floor(), aloft(model), weightless());
  for (int k = 0; k < 2000; ++k) {
    world.step(single(40.0 * (-3.3 - world.configuration().q[0]) - 4.0 * world.velocity()[6]));
  }
  EXPECT_NEAR(world.configuration().q[0], -3.3, 1e-3);
}

TEST(DriveTorque, Saturates) {
  const RobotModel model = one_joint(0.02, 0.1387, 0.0);
  OdeOptions options = weightless();
  OdeWorld world(model, empty_floor(), aloft(model), options);
  world.step(single(1000.0));
  EXPECT_EQ(world.drive_torque()[0], 50.0);
  options.saturate_at = 30.0;
  OdeWorld limited(model, empty_floor(), aloft(model), options);
  limited.step(single(-1000.0));
  EXPECT_EQ(limited.drive_torque()[0], -30.0);
  EXPECT_NEAR(limited.velocity()[6] / world.velocity()[6], -0.6, 1e-3);
}

// --- the whole robot -------------------------------------------------------------------------

class Stepper : public testing::TestWithParam<OdeStepper> {
 protected:
  OdeOptions options() const {
    OdeOptions options;
    options.stepper = GetParam();
    return options;
  }
};
INSTANTIATE_TEST_SUITE_P(Both, Stepper, testing::Values(OdeStepper::kQuick, OdeStepper::kExact),
                         [](const auto& stepper) {
                           return stepper.param == OdeStepper::kQuick ? "quick" : "exact";
                         });

TEST_P(Stepper, FreeFallIsFreeFall) {
  const RobotModel model = coman();
  OdeWorld world(model, empty_floor(), aloft(model), options());
  const JointVector none = JointVector::Zero(model.joint_count());
  constexpr int kSteps = 500;
  for (int k = 0; k < kSteps; ++k) {
    world.step(none);
  }
  const double h = world.options().step;
  // Semi-implicit Euler: v after n steps is g n h, the path g h^2 n (n + 1) / 2.
  EXPECT_NEAR(world.velocity()[2], -kGravity * kSteps * h, 1e-6);
  EXPECT_NEAR(world.configuration().X_WB.p.z(), 5.0 - kGravity * h * h * kSteps * (kSteps + 1) / 2,
              1e-6);
  EXPECT_LT((world.configuration().q - model.home).norm(), 1e-6);
  EXPECT_TRUE(world.contacts().empty());
}

TEST_P(Stepper, AccelerationMatchesTheModelsMassMatrix) {
  // Weightless and at rest: M a = S^T tau, reflected inertia on the joints' diagonal only.
  RobotModel model = coman();
  for (Joint& joint : model.joints) {
    joint.damping = 0.0;
  }
  model.collision_pairs.clear();
  OdeOptions ode = options();
  ode.gravity.setZero();
  const Configuration x = aloft(model);
  OdeWorld world(model, empty_floor(), x, ode);
  VelocityVector tau = VelocityVector::Zero(model.velocity_count());
  for (Eigen::Index j = 0; j < model.joint_count(); ++j) {
    tau[6 + j] = 2.0 * std::sin(1.0 + 3.0 * static_cast<double>(j));
  }
  RobotData data;
  forward_kinematics(model, x, data);
  MassMatrix M;
  mass_matrix(model, data, M);
  const VelocityVector a = M.ldlt().solve(tau);
  constexpr int kSteps = 20;
  for (int k = 0; k < kSteps; ++k) {
    world.step(tau.tail(model.joint_count()));
  }
  const VelocityVector expected = a * kSteps * ode.step;
  EXPECT_LT((world.velocity() - expected).norm(), 0.03 * expected.norm());
}

TEST_P(Stepper, PassiveRobotKeepsItsEnergy) {
  // One arm is thrown up from a fixed base, 23 undamped joints follow: a chaotic pendulum.
  RobotModel model = coman();
  for (Joint& joint : model.joints) {
    joint.damping = 0.0;
    joint.lower = -1e3;
    joint.upper = 1e3;
  }
  model.collision_pairs.clear();
  OdeOptions ode = options();
  ode.guide_stiffness = 1e8;
  ode.guide_damping = 1e6;
  const Configuration x = aloft(model);
  OdeWorld world(model, empty_floor(), x, ode);
  VelocityVector v = VelocityVector::Zero(model.velocity_count());
  v[6 + *model.find_joint("LShSag")] = -3.0;
  world.reset(x, v);
  double start = 0.0;
  double greatest_kinetic = 0.0;
  double worst = 0.0;
  for (int k = 0; k < 1500; ++k) {
    const double kinetic = test::kinetic_energy(model, world.configuration(), world.velocity());
    const double energy = kinetic + test::potential_energy(model, world.configuration());
    start = k == 0 ? energy : start;
    greatest_kinetic = std::max(greatest_kinetic, kinetic);
    worst = std::max(worst, std::abs(energy - start));
    world.set_base_guide(x.X_WB);
    world.step(JointVector::Zero(model.joint_count()));
  }
  EXPECT_GT(greatest_kinetic, 20.0);  // it did swing
  EXPECT_LT(worst, (GetParam() == OdeStepper::kExact ? 0.005 : 0.05) * greatest_kinetic);
}

TEST_P(Stepper, TumblingRobotKeepsMomentumAndEnergy) {
  RobotModel model = coman();
  for (Joint& joint : model.joints) {
    joint.damping = 0.0;
    joint.lower = -1e3;
    joint.upper = 1e3;
  }
  model.collision_pairs.clear();
  OdeOptions ode = options();
  ode.gravity.setZero();
  OdeWorld world(model, empty_floor(), aloft(model), ode);
  VelocityVector v = VelocityVector::Zero(model.velocity_count());
  v.segment<3>(3) << 0.5, -1.0, 2.0;
  v[6 + *model.find_joint("RShSag")] = 3.0;
  v[6 + *model.find_joint("LKneeSag")] = 2.0;
  world.reset(aloft(model), v);
  // Linear momentum: the base rows of the mass matrix give it.
  const auto momentum = [&]() -> Eigen::Vector3d {
    RobotData data;
    forward_kinematics(model, world.configuration(), data);
    MassMatrix M;
    mass_matrix(model, data, M);
    return (M * world.velocity()).head<3>();
  };
  const double energy = test::kinetic_energy(model, world.configuration(), world.velocity());
  const Eigen::Vector3d before = momentum();
  const JointVector none = JointVector::Zero(model.joint_count());
  for (int k = 0; k < 1000; ++k) {
    world.step(none);
  }
  EXPECT_LT((momentum() - before).norm(), 1e-3 * (1.0 + before.norm()));
  EXPECT_NEAR(test::kinetic_energy(model, world.configuration(), world.velocity()), energy,
              0.005 * energy);
}

TEST_P(Stepper, HangingTorquesMatchTheModelsGravity) {
  RobotModel model = coman();
  model.collision_pairs.clear();
  const Configuration x = aloft(model);
  OdeWorld world(model, empty_floor(), x, options());
  JointVector mean = JointVector::Zero(model.joint_count());
  double guide = 0.0;
  for (int k = 0; k < 4000; ++k) {
    world.set_base_guide(x.X_WB);
    world.step(hold(world, model.home));
    if (k >= 3000) {
      mean += world.drive_torque() / 1000.0;
      guide += world.guide_force().z() / 1000.0;
    }
  }
  RobotData data;
  forward_kinematics(model, world.configuration(), data);
  VelocityVector g;
  gravity_torque(model, data, g);
  for (Eigen::Index j = 0; j < mean.size(); ++j) {
    EXPECT_NEAR(mean[j], g[6 + j], 0.02 * std::abs(g[6 + j]) + 0.005)
        << model.joints[static_cast<std::size_t>(j)].name;
  }
  EXPECT_NEAR(guide, model.total_mass * kGravity, 0.01 * model.total_mass * kGravity);
}

TEST(BaseGuide, LeadsTheBaseAlongAPathAndLetsGo) {
  const RobotModel model = coman();
  const Configuration x = aloft(model);
  OdeWorld world(model, empty_floor(), x, weightless());
  Pose target = x.X_WB;
  for (int k = 0; k < 2000; ++k) {
    target.p.x() += 1e-4;
    target.R = Eigen::AngleAxisd(2.5e-4 * k, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    world.set_base_guide(target);
    world.step(hold(world, model.home));
  }
  EXPECT_LT((world.configuration().X_WB.p - target.p).norm(), 5e-3);
  EXPECT_LT(rotation_log(world.configuration().X_WB.R * target.R.transpose()).norm(), 0.01);
  world.set_base_guide(std::nullopt);
  world.step(hold(world, model.home));
  EXPECT_EQ(world.guide_force(), Eigen::Vector3d::Zero());
}

bool same_bytes(const OdeWorld& a, const OdeWorld& b) {
  const auto equal = [](const auto& m, const auto& n) {
    return std::memcmp(m.data(), n.data(), sizeof(double) * static_cast<std::size_t>(m.size())) ==
           0;
  };
  return equal(a.configuration().q, b.configuration().q) && equal(a.velocity(), b.velocity()) &&
         equal(a.configuration().X_WB.p, b.configuration().X_WB.p) &&
         equal(a.configuration().X_WB.R, b.configuration().X_WB.R);
}

TEST(Determinism, RunsAreByteEqualAlsoInterleavedAndAfterReset) {
  const RobotModel model = coman();
  const Scenario scenario = test::box_scenario();
  const auto run = [&](OdeWorld& world) {
    for (int k = 0; k < 300; ++k) {
      world.step(hold(world, model.home));
    }
  };
  OdeWorld first(model, scenario);
  run(first);
  OdeWorld a(model, scenario);
  OdeWorld b(model, scenario);
  for (int k = 0; k < 300; ++k) {
    a.step(hold(a, model.home));
    b.step(hold(b, model.home));
  }
  EXPECT_TRUE(same_bytes(first, a));
  EXPECT_TRUE(same_bytes(first, b));
  first.reset(start_configuration(model, scenario));
  run(first);
  EXPECT_TRUE(same_bytes(first, a));
  a.step(JointVector::Zero(model.joint_count()));
  EXPECT_FALSE(same_bytes(first, a));
}

}  // namespace
}  // namespace clamber
