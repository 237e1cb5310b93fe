#include "robot_model/loader.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <set>

#include "tests/robot_model/test_robots.hpp"

namespace clamber {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

Eigen::Vector3d frame_position(const RobotModel& model, const RobotData& data,
                               const std::string& name) {
  const auto frame = model.find_frame(name);
  if (!frame) {
    ADD_FAILURE() << "no frame " << name;
    return Eigen::Vector3d::Zero();
  }
  const Frame& f = model.frames[at(*frame)];
  return data.X_WB[at(f.body)] * f.X_BF.p;
}

RobotData at_zero(const RobotModel& model) {
  Configuration x;
  x.q = JointVector::Zero(model.joint_count());
  RobotData data;
  forward_kinematics(model, x, data);
  return data;
}

TEST(Coman, HasThePublishedMassAndJoints) {
  const RobotModel coman = load_test_robot("coman");
  EXPECT_EQ(coman.name, "coman");
  EXPECT_NEAR(coman.total_mass, 28.8934, 5e-5);
  EXPECT_EQ(coman.ballast_mass, 0.0);
  ASSERT_EQ(coman.joint_count(), 23);
  EXPECT_EQ(coman.bodies.size(), 24U);
  EXPECT_EQ(coman.joints.front().name, "WaistLat");
  EXPECT_EQ(coman.joints[at(6)].name, "RKneeSag");
  EXPECT_EQ(coman.joints.back().name, "LElbj");
  for (const Joint& joint : coman.joints) {
    EXPECT_EQ(joint.torque_limit, 30.0);
    EXPECT_EQ(joint.drive_torque_limit, 50.0);
    EXPECT_EQ(joint.velocity_limit, 4.0);
    EXPECT_EQ(joint.damping, 3.0);
    EXPECT_EQ(joint.reflected_inertia, 0.1387);
    // The robot file's groups: soft elbows, integrators in legs and waist only.
    const bool elbow = joint.name.ends_with("Elbj");
    const bool arm = elbow || joint.name.find("Sh") != std::string::npos;
    EXPECT_EQ(joint.kp, elbow ? 300.0 : 1000.0) << joint.name;
    EXPECT_EQ(joint.kd, elbow ? 1.0 : 3.0) << joint.name;
    EXPECT_EQ(joint.ki, arm ? 0.1 : 100.0) << joint.name;
  }
  EXPECT_EQ(coman.joints[at(6)].lower, -0.1745);
  EXPECT_EQ(coman.joints[at(6)].upper, 1.9199);
}

TEST(Coman, BallastBringsItToThePapersMass) {
  const RobotModel bare = load_test_robot("coman");
  const RobotModel loaded = load_test_robot("coman", 1.0);
  EXPECT_NEAR(loaded.total_mass, 31.2, 0.01);
  EXPECT_NEAR(loaded.ballast_mass, 2.30, 1e-9);
  EXPECT_NEAR(loaded.total_mass, bare.total_mass + loaded.ballast_mass, 1e-9);
  EXPECT_NE(loaded.hash, bare.hash);
  const double half = load_test_robot("coman", 0.5).total_mass;
  EXPECT_NEAR(half, bare.total_mass + 1.15, 1e-9);
}

// Lengths of the robot's published figures, zero posture.
TEST(Coman, HasThePublishedSegmentLengths) {
  const RobotModel coman = load_test_robot("coman");
  const RobotData data = at_zero(coman);
  const auto p = [&](const std::string& name) { return frame_position(coman, data, name); };
  const double sole = p("l_sole").z();
  EXPECT_NEAR(p("base_link").z() - sole, 0.5168, 1e-6);
  EXPECT_NEAR(p("LFootmot").z() - sole, 0.0900, 1e-6);
  EXPECT_NEAR(p("LLowLeg").z() - sole, 0.2910, 1e-6);
  EXPECT_NEAR(p("LThighUpLeg").z() - p("LLowLeg").z(), 0.2258, 1e-6);
  EXPECT_NEAR(p("LThighUpLeg").y() - p("RThighUpLeg").y(), 0.1452, 1e-6);
  EXPECT_NEAR(p("DWL").z() - sole, 0.63592, 1e-5);
  EXPECT_NEAR(p("LShr").z() - sole, 0.84113, 1e-5);
  EXPECT_NEAR(p("LShr").y() - p("RShr").y(), 0.3116, 1e-6);
  EXPECT_NEAR(p("gaze").z() - sole, 0.94113, 1e-5);
  EXPECT_NEAR((p("LShr") - p("LElb")).norm(), 0.18062, 1e-5);
  EXPECT_NEAR((p("LElb") - p("l_wrist")).norm(), 0.22051, 1e-5);
  EXPECT_NEAR((p("l_toe") - p("l_sole")).norm(), 0.13, 1e-6);
  EXPECT_TRUE(data.com.isApprox(Eigen::Vector3d(-0.00113, -0.00013, 0.02548), 1e-3));
}

// Published positions for a bent posture, so that axes and signs count too.
TEST(Coman, MatchesThePublishedBentPosture) {
  const RobotModel coman = load_test_robot("coman");
  Configuration x;
  x.q = JointVector::Zero(coman.joint_count());
  const double degree = 3.14159265358979323846 / 180.0;
  const std::pair<const char*, double> angles[] = {
      {"HipSag", -25}, {"KneeSag", 50}, {"AnkSag", -25}, {"ShSag", 20}, {"Elbj", -80}};
  for (const auto& [joint, angle] : angles) {
    x.q[*coman.find_joint(std::string("L") + joint)] = angle * degree;
    x.q[*coman.find_joint(std::string("R") + joint)] = angle * degree;
  }
  x.q[*coman.find_joint("LShLat")] = 10.0 * degree;
  x.q[*coman.find_joint("RShLat")] = -10.0 * degree;
  RobotData data;
  forward_kinematics(coman, x, data);
  EXPECT_LT(
      (frame_position(coman, data, "l_sole") - Eigen::Vector3d(0.01048, 0.0726, -0.47681)).norm(),
      2e-5);
  EXPECT_LT(
      (frame_position(coman, data, "l_wrist") - Eigen::Vector3d(0.14207, 0.19626, 0.03039)).norm(),
      2e-5);
}

TEST(Coman, ContactsAreTheEightOfThePaper) {
  const RobotModel coman = load_test_robot("coman");
  ASSERT_EQ(coman.contacts.size(), 8U);
  for (const char* name :
       {"Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee", "Lfoot", "Rfoot"}) {
    ASSERT_TRUE(coman.find_contact(name)) << name;
  }
  const ContactLink& wrist = coman.contacts[at(*coman.find_contact("Lwrist"))];
  EXPECT_EQ(wrist.limb, "left_arm");
  EXPECT_EQ(wrist.radius, 0.025);
  EXPECT_FALSE(wrist.is_patch);
  EXPECT_EQ(coman.bodies[at(wrist.support_body)].name, "LShr");
  EXPECT_NEAR(wrist.support_length, 0.4011, 5e-4);  // arm length
  const ContactLink& knee = coman.contacts[at(*coman.find_contact("Rknee"))];
  EXPECT_EQ(coman.bodies[at(knee.support_body)].name, "RThighUpLeg");
  EXPECT_NEAR(knee.support_length, 0.2258, 1e-6);
  const ContactLink& foot = coman.contacts[at(*coman.find_contact("Rfoot"))];
  ASSERT_TRUE(foot.is_patch);
  ASSERT_EQ(foot.points.size(), 4U);
  const std::vector<Eigen::Vector3d> corners = {
      {0.13, 0.05, -0.09}, {-0.07, 0.05, -0.09}, {-0.07, -0.05, -0.09}, {0.13, -0.05, -0.09}};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT((foot.points[i] - corners[i]).norm(), 1e-12) << i;
  }
}

TEST(Coman, ForbiddenPartsAreTorsoAndPelvis) {
  const RobotModel coman = load_test_robot("coman");
  std::set<std::string> names;
  for (const int geom : coman.forbidden_geoms) {
    names.insert(coman.geoms[at(geom)].name);
  }
  EXPECT_EQ(names, (std::set<std::string>{"pelvis", "torso", "waist_lateral", "waist_sagittal"}));
}

TEST(Coman, HomeStandsOnLevelSoles) {
  const RobotModel coman = load_test_robot("coman");
  Configuration x;
  x.q = coman.home;
  RobotData data;
  forward_kinematics(coman, x, data);
  for (const char* contact : {"Lfoot", "Rfoot"}) {
    const ContactLink& foot = coman.contacts[at(*coman.find_contact(contact))];
    const Eigen::Vector3d up = data.X_WB[at(foot.body)].R.col(2);
    EXPECT_LT((up - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
    // The centre of mass over the soles, at least 2 cm from their edges.
    const Eigen::Vector3d toe = data.X_WB[at(foot.body)] * foot.points[0];
    const Eigen::Vector3d heel = data.X_WB[at(foot.body)] * foot.points[1];
    EXPECT_LT(data.com.x(), toe.x() - 0.02);
    EXPECT_GT(data.com.x(), heel.x() + 0.02);
  }
}

TEST(Coman, LoadsTheSameTwice) {
  EXPECT_EQ(load_test_robot("coman").hash, load_test_robot("coman").hash);
  EXPECT_EQ(load_test_robot("coman").hash.size(), 64U);
  EXPECT_NE(load_test_robot("coman").hash, load_test_robot("testbot").hash);
}

class EveryRobot : public testing::TestWithParam<const char*> {};

TEST_P(EveryRobot, KeepsTheModelsPromises) {
  const RobotModel robot = load_test_robot(GetParam());
  ASSERT_EQ(robot.bodies.size(), robot.joints.size() + 1);
  EXPECT_EQ(robot.bodies[0].parent, -1);
  double mass = 0.0;
  for (std::size_t b = 0; b < robot.bodies.size(); ++b) {
    const Body& body = robot.bodies[b];
    if (b > 0) {
      EXPECT_GE(body.parent, 0);
      EXPECT_LT(body.parent, static_cast<int>(b));
      EXPECT_NEAR(body.axis.norm(), 1.0, 1e-12);
      EXPECT_LT((body.X_PJ.R * body.X_PJ.R.transpose() - Eigen::Matrix3d::Identity()).norm(),
                1e-12);
    }
    EXPECT_GT(body.mass, 0.0);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(body.inertia).eigenvalues()[0], 0.0);
    mass += body.mass;
  }
  EXPECT_NEAR(mass, robot.total_mass, 1e-12);
  EXPECT_EQ(robot.home.size(), robot.joint_count());
  std::set<std::string> names;
  for (const Geom& geom : robot.geoms) {
    EXPECT_TRUE(names.insert(geom.name).second) << geom.name;
  }
}

TEST_P(EveryRobot, LinksOfTheUrdfAreFrames) {
  const RobotModel robot = load_test_robot(GetParam());
  for (const Body& body : robot.bodies) {
    const auto frame = robot.find_frame(body.name);
    ASSERT_TRUE(frame) << body.name;
    EXPECT_TRUE(robot.frames[at(*frame)].X_BF.p.isZero());
  }
}

INSTANTIATE_TEST_SUITE_P(Robots, EveryRobot, testing::Values("coman", "testbot"));

TEST(Testbot, DiffersFromComanInStructure) {
  const RobotModel robot = load_test_robot("testbot");
  EXPECT_EQ(robot.joint_count(), 30);
  // Depth first, siblings by name: the left arm hangs on the chest, which hangs on the waist.
  EXPECT_EQ(robot.joints.front().name, "l_hip_a");
  EXPECT_LT(*robot.find_joint("waist_turn"), *robot.find_joint("l_shoulder_a"));
  const Joint& turn = robot.joints[at(*robot.find_joint("neck_turn"))];
  EXPECT_NEAR(turn.upper, 6.28318530717958648, 1e-12);  // continuous: one turn each way
  EXPECT_EQ(turn.torque_limit, 8.0);                    // a group's figure, not the default
  EXPECT_EQ(turn.ki, 0.0);
  // A link fixed to a fixed link still belongs to the base.
  EXPECT_EQ(robot.frames[at(*robot.find_frame("compass"))].body, 0);
  EXPECT_NEAR(robot.bodies[0].mass, 6.5 + 1.7, 1e-12);
}

// The zero posture was laid out in world coordinates before the frames were turned.
TEST(Testbot, TurnedFramesLandWhereTheyWereLaidOut) {
  const RobotModel robot = load_test_robot("testbot");
  const RobotData data = at_zero(robot);
  const auto check = [&](const std::string& name, const Eigen::Vector3d& expected) {
    EXPECT_LT((frame_position(robot, data, name) - expected).norm(), 1e-7) << name;
  };
  check("compass", {-0.15, 0.02, 0.3});
  check("l_elbow_link", {0.02, 0.19, 0.24});
  check("r_wrist_b_link", {0.0, -0.19, 0.01});
  check("l_sole_plate", {0.03, 0.10, -0.72});
  const Geom& hand = robot.geoms[at(*robot.find_geom("l_hand"))];
  EXPECT_LT((data.X_WB[at(hand.body)] * hand.X_BG.p - Eigen::Vector3d(0, 0.19, -0.04)).norm(),
            1e-7);
  const ContactLink& foot = robot.contacts[at(*robot.find_contact("Lfoot"))];
  for (const Eigen::Vector3d& corner : foot.points) {
    EXPECT_NEAR((data.X_WB[at(foot.body)] * corner).z(), -0.73, 1e-7);
  }
}

}  // namespace
}  // namespace clamber
