// The simulated robot on floor and obstacle: weight, friction, standing, what is observed.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "sim_fixture.hpp"

namespace clamber {
namespace {

using test::coman;
using test::hold;
using test::single_body;

constexpr double kFriction = 0.8;

Geom slab() {
  Geom geom;
  geom.name = "slab";
  geom.link = "slab";
  geom.shape = Shape::kBox;
  geom.half_extents = {0.1, 0.1, 0.02};
  return geom;
}

Scenario floor_only() {
  Scenario scenario;
  scenario.name = "floor";
  scenario.friction = kFriction;
  return scenario;
}

/// Path and velocity of a slab after a second on a floor that leans by atan(slope) towards
/// `direction` (rad).
VelocityVector slide(double slope, double direction, Eigen::Vector3d* path = nullptr,
                     const Eigen::Vector3d& start_velocity = Eigen::Vector3d::Zero()) {
  const RobotModel model = single_body(slab(), 5.0);
  OdeOptions options;
  const double lean = std::atan(slope);
  options.gravity =
      kGravity * Eigen::Vector3d(std::sin(lean) * std::cos(direction),
                                 std::sin(lean) * std::sin(direction), -std::cos(lean));
  Configuration x;
  x.q = JointVector::Zero(0);
  x.X_WB.p.z() = 0.02;
  OdeWorld world(model, floor_only(), x, options);
  VelocityVector v = VelocityVector::Zero(6);
  v.head<3>() = start_velocity;
  world.reset(x, v);
  for (int k = 0; k < 1000; ++k) {
    world.step(JointVector::Zero(0));
  }
  if (path != nullptr) {
    *path = world.configuration().X_WB.p - x.X_WB.p;
  }
  return world.velocity();
}

class FrictionDirection : public testing::TestWithParam<int> {
 protected:
  double direction() const { return GetParam() * std::numbers::pi / 180.0; }
  Eigen::Vector3d down() const { return {std::cos(direction()), std::sin(direction()), 0.0}; }
};
INSTANTIATE_TEST_SUITE_P(Degrees, FrictionDirection,
                         testing::Values(0, 15, 30, 45, 60, 90, 135, 200, 315));

TEST_P(FrictionDirection, SticksBelowTheConeAndSlipsAboveIt) {
  Eigen::Vector3d path;
  slide(0.92 * kFriction, direction(), &path);
  EXPECT_LT(path.head<2>().norm(), 2e-3);
  slide(1.08 * kFriction, direction(), &path);
  EXPECT_GT(path.dot(down()), 0.05);
}

TEST_P(FrictionDirection, SlidingForceIsTheConesAndAgainstTheSlip) {
  Eigen::Vector3d path;
  const double slope = 1.5 * kFriction;
  const VelocityVector v = slide(slope, direction(), &path);
  const double lean = std::atan(slope);
  const double expected = kGravity * (std::sin(lean) - kFriction * std::cos(lean));
  EXPECT_NEAR(v.head<3>().dot(down()), expected, 0.05 * expected);
  EXPECT_LT((path - down() * path.dot(down())).head<2>().norm(), 0.02 * path.norm());
}

TEST_P(FrictionDirection, ASlidingSlabStopsAfterTheConesDistance) {
  Eigen::Vector3d path;
  const VelocityVector v = slide(0.0, 0.0, &path, 1.5 * down());
  const double expected = 1.5 * 1.5 / (2.0 * kFriction * kGravity);
  EXPECT_LT(v.norm(), 1e-3);
  EXPECT_NEAR(path.dot(down()), expected, 0.1 * expected);
}

TEST(Contact, ASphereOnTheBoxIsSeenOnItsTop) {
  Geom ball;
  ball.name = "ball";
  ball.link = "ball";
  ball.radius = 0.05;
  const RobotModel model = single_body(ball, 3.0);
  const Scenario scenario = test::box_scenario();
  Configuration x;
  x.q = JointVector::Zero(0);
  x.X_WB.p = {0.3, 0.1, 0.275 + 0.05 + 0.05};  // falls 5 cm
  OdeWorld world(model, scenario, x);
  for (int k = 0; k < 2000; ++k) {
    world.step(JointVector::Zero(0));
  }
  ASSERT_EQ(world.contacts().size(), 1u);
  const ContactObservation& contact = world.contacts()[0];
  EXPECT_EQ(contact.surface, Surface::kObstacle);
  EXPECT_EQ(world.surface_name(contact), "box");
  EXPECT_NEAR(contact.force.z(), 3.0 * kGravity, 1e-3);
  EXPECT_GT(contact.normal.z(), 0.999);
  EXPECT_NEAR(contact.position.z(), 0.275, 1e-3);
  EXPECT_NEAR(world.configuration().X_WB.p.z(), 0.275 + 0.05, 1e-3);
}

TEST(Contact, AFallingBodyNeverIsPulledAndDoesNotBounceHigh) {
  const RobotModel model = single_body(slab(), 5.0);
  Configuration x;
  x.q = JointVector::Zero(0);
  x.X_WB.p.z() = 0.12;
  OdeWorld world(model, floor_only(), x);
  bool touched = false;
  double highest_after = 0.0;
  for (int k = 0; k < 1000; ++k) {
    world.step(JointVector::Zero(0));
    for (const ContactObservation& contact : world.contacts()) {
      touched = true;
      EXPECT_GE(contact.normal_force(), -1e-9);
    }
    if (touched) {
      highest_after = std::max(highest_after, world.configuration().X_WB.p.z());
    }
  }
  EXPECT_TRUE(touched);
  EXPECT_LT(highest_after, 0.02 + 0.02);
}

struct Rest {
  double vertical = 0.0;    // N, mean
  double worst_drop = 0.0;  // m
  double worst_tilt = 0.0;  // rad
  VelocityVector balance;   // mean of S^T tau + sum J^T f - g, N m
  JointVector tau;          // mean
};

/// S^T tau + sum J^T f - g of the world's last step.
VelocityVector imbalance(const OdeWorld& world) {
  const RobotModel& model = world.model();
  RobotData data;
  forward_kinematics(model, world.configuration(), data);
  VelocityVector sum;
  gravity_torque(model, data, sum);
  sum = -sum;
  sum.tail(model.joint_count()) += world.drive_torque();
  const auto add = [&](int geom, const Eigen::Vector3d& p, const Eigen::Vector3d& f) {
    Jacobian3 J;
    point_jacobian(model, data, model.geoms[static_cast<std::size_t>(geom)].body, p, J);
    sum += J.transpose() * f;
  };
  for (const ContactObservation& contact : world.contacts()) {
    add(contact.geom, contact.position, contact.force);
    if (contact.surface == Surface::kRobot) {
      add(contact.other, contact.position, -contact.force);
    }
  }
  return sum;
}

double vertical_force(const OdeWorld& world) {
  double sum = 0.0;
  for (const ContactObservation& contact : world.contacts()) {
    sum += contact.surface == Surface::kRobot ? 0.0 : contact.force.z();
  }
  return sum;
}

/// Holds the posture x0 for `seconds`, means over the last one.
Rest rest(const RobotModel& model, const Configuration& x0, double seconds,
          const OdeOptions& options = {}) {
  OdeWorld world(model, test::box_scenario(), x0, options);
  const int steps = static_cast<int>(std::lround(seconds / options.step));
  const int window = 1000;
  Rest result;
  result.balance = VelocityVector::Zero(model.velocity_count());
  result.tau = JointVector::Zero(model.joint_count());
  for (int k = 0; k < steps; ++k) {
    world.step(hold(world, x0.q));
    const Configuration& x = world.configuration();
    result.worst_drop = std::max(result.worst_drop, x0.X_WB.p.z() - x.X_WB.p.z());
    result.worst_tilt =
        std::max(result.worst_tilt, rotation_log(x.X_WB.R * x0.X_WB.R.transpose()).norm());
    if (k >= steps - window) {
      result.vertical += vertical_force(world) / window;
      result.balance += imbalance(world) / window;
      result.tau += world.drive_torque() / window;
    }
  }
  return result;
}

Rest stand(const RobotModel& model, double seconds, const OdeOptions& options = {}) {
  return rest(model, start_configuration(model, test::box_scenario()), seconds, options);
}

/// Knees and forearms on the box, a millimetre above it.
Configuration all_fours(const RobotModel& model) {
  Configuration x;
  x.q = JointVector::Zero(model.joint_count());
  const auto set = [&](const std::string& joint, double q) { x.q[*model.find_joint(joint)] = q; };
  constexpr double kPitch = 1.35;
  set("WaistSag", 0.1);
  set("LShLat", 0.15);
  set("RShLat", -0.15);
  for (const std::string side : {"L", "R"}) {
    set(side + "HipSag", -kPitch);
    set(side + "KneeSag", 1.6);
    set(side + "AnkSag", 0.9);
    set(side + "ShSag", -kPitch - 0.4);
    set(side + "Elbj", -0.9);
  }
  x.X_WB.R = Eigen::AngleAxisd(kPitch, Eigen::Vector3d::UnitY()).toRotationMatrix();
  RobotData data;
  forward_kinematics(model, x, data);
  const ContactLink& knee = model.contacts[static_cast<std::size_t>(*model.find_contact("Lknee"))];
  const Eigen::Vector3d p = data.X_WB[static_cast<std::size_t>(knee.body)] * knee.points[0];
  x.X_WB.p = {0.35, 0.0, 0.275 + knee.radius + 0.001 - p.z()};
  return x;
}

TEST(AllFours, ForcesBalanceTheTorquesAndDoNotCreep) {
  const RobotModel model = coman();
  const Configuration x = all_fours(model);
  const Rest early = rest(model, x, 3.0);
  const Rest late = rest(model, x, 8.0);
  const double largest = late.tau.cwiseAbs().maxCoeff();
  EXPECT_GT(largest, 5.0);
  EXPECT_NEAR(late.vertical, model.total_mass * kGravity, 0.01 * model.total_mass * kGravity);
  EXPECT_LT(late.balance.tail(model.joint_count()).cwiseAbs().maxCoeff(), 0.02 * largest);
  // The friction between hands and knees is statically undetermined; it must not leak away.
  EXPECT_LT((late.tau - early.tau).cwiseAbs().maxCoeff(), 0.02 * largest);
}

TEST(Standing, AtHomeForFiveSeconds) {
  const RobotModel model = coman();
  const Rest result = stand(model, 5.0);
  EXPECT_LT(result.worst_drop, 0.01);
  EXPECT_LT(result.worst_tilt, 0.05);
  const double weight = model.total_mass * kGravity;
  EXPECT_NEAR(result.vertical, weight, 0.01 * weight);
}

TEST(Standing, TorquesMatchGravityAndContactForces) {
  const RobotModel model = coman();
  const Rest result = stand(model, 8.0);
  const double largest = result.tau.cwiseAbs().maxCoeff();
  EXPECT_GT(largest, 3.0);
  for (Eigen::Index j = 6; j < result.balance.size(); ++j) {
    EXPECT_NEAR(result.balance[j], 0.0, 0.02 * largest)
        << model.joints[static_cast<std::size_t>(j - 6)].name;
  }
  EXPECT_LT(result.balance.head<3>().norm(), 0.01 * model.total_mass * kGravity);
}

TEST(Standing, QuickAndExactStepperAgree) {
  const RobotModel model = coman();
  OdeOptions exact;
  exact.stepper = OdeStepper::kExact;
  const Rest reference = stand(model, 4.0, exact);
  const Rest quick = stand(model, 4.0);
  const double largest = reference.tau.cwiseAbs().maxCoeff();
  for (const char* name :
       {"LHipSag", "LKneeSag", "LAnkSag", "RHipSag", "RKneeSag", "RAnkSag", "WaistSag"}) {
    const int j = *model.find_joint(name);
    EXPECT_NEAR(quick.tau[j], reference.tau[j], 0.02 * largest) << name;
  }
}

TEST(Standing, CarriesTheBallast) {
  const RobotModel model = coman(1.0);
  EXPECT_NEAR(model.total_mass, 31.2, 0.05);
  const Rest result = stand(model, 5.0);
  EXPECT_LT(result.worst_drop, 0.01);
  EXPECT_NEAR(result.vertical, model.total_mass * kGravity, 0.01 * model.total_mass * kGravity);
}

TEST(Standing, WithoutTorqueTheRobotFalls) {
  const RobotModel model = coman();
  OdeWorld world(model, test::box_scenario());
  for (int k = 0; k < 3000; ++k) {
    world.step(JointVector::Zero(model.joint_count()));
  }
  EXPECT_LT(world.configuration().X_WB.p.z(), 0.4);
  EXPECT_TRUE(world.velocity().allFinite());
  EXPECT_LT(world.joint_separation(), 2e-3);
}

}  // namespace
}  // namespace clamber
