#include "sim_backend/ode_bus.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <numeric>
#include <vector>

#include "sim_fixture.hpp"

namespace clamber {
namespace {

class Bus : public testing::Test {
 protected:
  const RobotModel model = test::coman();
  OdeWorld world{model, test::box_scenario()};
  OdeBus bus{world};
  std::vector<JointCommand> commands{model.joints.size()};
  std::vector<JointState> states{model.joints.size()};
};

TEST_F(Bus, StandsStillUntilEnabledAndAfterDisable) {
  EXPECT_EQ(bus.exchange(commands, states, 0), BusStatus::kDown);
  EXPECT_EQ(world.time(), 0.0);
  EXPECT_EQ(bus.enable(), BusStatus::kOk);
  EXPECT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
  EXPECT_DOUBLE_EQ(world.time(), 1e-3);
  bus.disable();
  EXPECT_EQ(bus.exchange(commands, states, 0), BusStatus::kDown);
  EXPECT_EQ(bus.counters().exchanges, 1u);
}

TEST_F(Bus, RefusesSpansOfTheWrongLength) {
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  commands.pop_back();
  EXPECT_EQ(bus.exchange(commands, states, 0), BusStatus::kDown);
  EXPECT_EQ(world.time(), 0.0);
}

TEST_F(Bus, DriveLawUsesTheStateBeforeTheStep) {
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  const double q = world.configuration().q[0];
  commands[0] = {.q = q + 0.002, .dq = 0.5, .kp = 1000.0, .kd = 3.0, .tau = 0.25};
  ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
  EXPECT_NEAR(states[0].tau, 0.25 + 1000.0 * 0.002 + 3.0 * 0.5, 1e-9);
  EXPECT_EQ(states[0].q, world.configuration().q[0]);
  EXPECT_EQ(states[0].dq, world.velocity()[6]);
  EXPECT_NE(states[0].q, q);
  EXPECT_EQ(states[0].sequence, 1u);
  EXPECT_EQ(states[0].age, 0u);
  EXPECT_EQ(states[0].flags, kJointEnabled);
}

/// The drives alone: the last command until the watchdog, then what they were told.
class SilentBus : public Bus {
 protected:
  void kill_host(FailurePolicy policy) {
    ASSERT_EQ(bus.enable(), BusStatus::kOk);
    for (std::size_t j = 0; j < commands.size(); ++j)
      commands[j] = {.q = world.configuration().q[static_cast<Eigen::Index>(j)],
                     .kp = model.joints[j].kp,
                     .kd = model.joints[j].kd};
    for (int i = 0; i < 100; ++i) ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
    height_ = base();
    ASSERT_TRUE(bus.set_failure_policy(policy));
  }
  void pass(double seconds) {
    for (int i = 0; i < seconds * 1e3; ++i) bus.pass();
  }
  [[nodiscard]] double base() const { return world.configuration().X_WB.p.z(); }
  [[nodiscard]] double torque() const { return world.drive_torque().lpNorm<Eigen::Infinity>(); }
  double height_ = 0.0;
};

TEST_F(SilentBus, DrivesThatHoldKeepTheRobotStanding) {
  kill_host(FailurePolicy::kHold);
  pass(1.0);
  EXPECT_NEAR(base(), height_, 2e-3);
  EXPECT_GT(torque(), 1.0);
  // The host comes back: its command counts again.
  ASSERT_EQ(bus.exchange(std::vector<JointCommand>(commands.size()), states, 0), BusStatus::kOk);
  EXPECT_EQ(torque(), 0.0);
}

TEST_F(SilentBus, LimpDrivesLetGoWhenTheWatchdogRunsOut) {
  kill_host(FailurePolicy::kLimp);
  pass(0.019);
  EXPECT_GT(torque(), 0.5);
  pass(0.002);
  EXPECT_EQ(torque(), 0.0);
  pass(0.6);
  EXPECT_LT(base(), height_ - 0.05);
}

TEST_F(SilentBus, LoweringDrivesSinkLaterAndSlower) {
  kill_host(FailurePolicy::kLower);
  pass(0.6);
  EXPECT_NEAR(base(), height_, 0.03);
  pass(2.4 + DrivesAlone{}.watchdog);
  world.step(JointVector::Zero(model.joint_count()));
  EXPECT_TRUE(world.velocity().allFinite());
}

TEST_F(Bus, SaturationIsFlagged) {
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  commands[3].tau = 80.0;
  commands[4].tau = -10.0;
  ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
  EXPECT_EQ(states[3].tau, model.joints[3].drive_torque_limit);
  EXPECT_TRUE(states[3].flags & kJointSaturated);
  EXPECT_FALSE(states[4].flags & kJointSaturated);
}

TEST_F(Bus, ANotFiniteCommandIsAFaultWithoutTorque) {
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  commands[5].tau = std::numeric_limits<double>::quiet_NaN();
  ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
  EXPECT_TRUE(states[5].flags & kJointFault);
  EXPECT_EQ(states[5].tau, 0.0);
  EXPECT_TRUE(world.velocity().allFinite());
}

TEST_F(Bus, TruthOfAStandingRobotIsItsWeightOnTheFeet) {
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  for (std::size_t j = 0; j < commands.size(); ++j) {
    commands[j] = {.q = model.home[static_cast<Eigen::Index>(j)], .kp = 1000.0, .kd = 3.0};
  }
  for (int k = 0; k < 3000; ++k) {
    ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
  }
  TelemetryFrame frame;
  frame.force_other = 99.0;  // must be overwritten
  read_truth(world, frame);
  EXPECT_TRUE(frame.flags & kFrameHasTruth);
  const auto left = static_cast<std::size_t>(*model.find_contact("Lfoot"));
  const auto right = static_cast<std::size_t>(*model.find_contact("Rfoot"));
  const double weight = model.total_mass * kGravity;
  EXPECT_NEAR(frame.force_floor[left] + frame.force_floor[right], weight, 0.02 * weight);
  EXPECT_GT(frame.force_floor[left], 0.3 * weight);
  EXPECT_EQ(std::accumulate(frame.force_obstacle.begin(), frame.force_obstacle.end(), 0.0), 0.0);
  EXPECT_EQ(frame.force_forbidden, 0.0);
  EXPECT_EQ(frame.force_other, 0.0);
  EXPECT_EQ(frame.contact_count, model.contacts.size());
  EXPECT_NEAR(frame.base_position[2], world.configuration().X_WB.p.z(), 0.0);
  EXPECT_NEAR(frame.base_orientation[0], 1.0, 1e-3);
}

TEST_F(Bus, ARobotLyingOnItsBellyShowsForbiddenForce) {
  Configuration x = world.configuration();
  x.X_WB.R = Eigen::AngleAxisd(1.57, Eigen::Vector3d::UnitY()).toRotationMatrix();
  x.X_WB.p = {-1.0, 0.0, 0.3};
  world.reset(x);
  ASSERT_EQ(bus.enable(), BusStatus::kOk);
  double highest = 0.0;
  TelemetryFrame frame;
  for (int k = 0; k < 1500; ++k) {
    ASSERT_EQ(bus.exchange(commands, states, 0), BusStatus::kOk);
    read_truth(world, frame);
    highest = std::max(highest, frame.force_forbidden);
  }
  EXPECT_GT(highest, 20.0);
}

TEST_F(Bus, ForearmContactsCountForTheNearerOfWristAndElbow) {
  RobotData data;
  const Configuration& x = world.configuration();
  forward_kinematics(model, x, data);
  const int forearm = *model.find_geom("l_forearm");
  for (const char* name : {"Lwrist", "Lelb"}) {
    const int c = *model.find_contact(name);
    const ContactLink& link = model.contacts[static_cast<std::size_t>(c)];
    const Eigen::Vector3d p = data.X_WB[static_cast<std::size_t>(link.body)] * link.points[0];
    EXPECT_EQ(contact_link_of(model, x, forearm, p), c);
  }
  const int thigh = *model.find_geom("l_thigh");
  EXPECT_EQ(contact_link_of(model, x, thigh, Eigen::Vector3d::Zero()), -1);
}

}  // namespace
}  // namespace clamber
