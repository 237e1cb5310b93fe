// What the primitives of a robot must leave free: configured pairs at home, and the parts beside a
// contact sphere when the sphere carries weight on a plane.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tests/robot_model/test_robots.hpp"

namespace clamber {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

const Geom& geom_of(const RobotModel& model, const std::string& name) {
  return model.geoms[at(model.find_geom(name).value())];
}

// Every primitive here is a set of core points (point, segment or box) grown by a radius.
Eigen::Vector3d nearest_core_point(const Geom& geom, const Pose& X_WB, const Eigen::Vector3d& p_W) {
  const Pose X_WG = X_WB * geom.X_BG;
  Eigen::Vector3d p = X_WG.inverse() * p_W;
  if (geom.shape == Shape::kBox) {
    p = p.cwiseMax(-geom.half_extents).cwiseMin(geom.half_extents);
  } else {
    p = {0.0, 0.0, std::clamp(p.z(), -0.5 * geom.length, 0.5 * geom.length)};
  }
  return X_WG * p;
}

// Alternating projections between two convex cores: slow but independent of any library.
double distance(const RobotModel& model, const RobotData& data, int a, int b) {
  const Geom& A = model.geoms[at(a)];
  const Geom& B = model.geoms[at(b)];
  Eigen::Vector3d p = data.X_WB[at(A.body)] * A.X_BG.p;
  Eigen::Vector3d q = p;
  for (int i = 0; i < 500; ++i) {
    q = nearest_core_point(B, data.X_WB[at(B.body)], p);
    p = nearest_core_point(A, data.X_WB[at(A.body)], q);
  }
  return (p - q).norm() - A.radius - B.radius;
}

class EveryRobotsPairs : public testing::TestWithParam<const char*> {};

// At home, and upright with the limbs straight, as a recording may begin.
TEST_P(EveryRobotsPairs, AreFreeWhenStanding) {
  const RobotModel robot = load_test_robot(GetParam());
  double smallest = std::numeric_limits<double>::max();
  for (const double bend : {1.0, 0.0}) {
    Configuration x;
    x.q = bend * robot.home;
    RobotData data;
    forward_kinematics(robot, x, data);
    for (const auto& pairs : {robot.collision_pairs, robot.planner_pairs}) {
      EXPECT_FALSE(pairs.empty());
      for (const auto& [a, b] : pairs) {
        const double gap = distance(robot, data, a, b);
        EXPECT_GT(gap, 0.005) << robot.geoms[at(a)].name << " and " << robot.geoms[at(b)].name;
        smallest = std::min(smallest, gap);
      }
    }
  }
  RecordProperty("smallest_gap_mm", std::to_string(1e3 * smallest));
}

INSTANTIATE_TEST_SUITE_P(Robots, EveryRobotsPairs, testing::Values("coman", "testbot"));

// Height of the lowest point of a geom above the plane through `origin` with normal `up`.
double height_over_plane(const RobotData& data, const Geom& geom, const Eigen::Vector3d& origin,
                         const Eigen::Vector3d& up) {
  const Eigen::Vector3d far_below = origin - 100.0 * up;
  const Eigen::Vector3d lowest = nearest_core_point(geom, data.X_WB[at(geom.body)], far_below);
  return up.dot(lowest - origin) - geom.radius;
}

// A forearm lying on a table: the table touches the spheres of elbow and wrist.
TEST(Coman, ALyingForearmTouchesWithElbowAndWristOnly) {
  const RobotModel coman = load_test_robot("coman");
  Configuration x;
  x.q = JointVector::Zero(coman.joint_count());
  RobotData data;
  forward_kinematics(coman, x, data);
  const Geom& elbow = geom_of(coman, "l_elbow");
  const Geom& wrist = geom_of(coman, "l_wrist");
  const Pose& X_WB = data.X_WB[at(elbow.body)];
  const Eigen::Vector3d along = X_WB.R * (wrist.X_BG.p - elbow.X_BG.p);
  const Eigen::Vector3d s = along.normalized();
  // Any plane under both spheres: turn it about the forearm.
  for (double angle = 0.0; angle < 360.0; angle += 15.0) {
    const Eigen::Vector3d side = s.unitOrthogonal();
    const Eigen::Vector3d n0 =
        std::cos(angle * kDegree) * side + std::sin(angle * kDegree) * s.cross(side);
    const double slope = (elbow.radius - wrist.radius) / along.norm();
    const Eigen::Vector3d up = std::sqrt(1.0 - slope * slope) * n0 - slope * s;
    const Eigen::Vector3d origin = X_WB * elbow.X_BG.p - elbow.radius * up;
    EXPECT_NEAR(height_over_plane(data, wrist, origin, up), 0.0, 1e-9);
    EXPECT_GT(height_over_plane(data, geom_of(coman, "l_forearm"), origin, up), 0.002);
  }
}

// Elbow on a table, forearm level and pointing forwards, upper arm leaning from upright to 60
// degrees in any direction the joints allow: the elbow's sphere is the lowest part of the arm.
TEST(Coman, AnElbowOnATableCarriesBeforeTheUpperArm) {
  const RobotModel coman = load_test_robot("coman");
  const Geom& elbow = geom_of(coman, "l_elbow");
  const Geom& upper_arm = geom_of(coman, "l_upper_arm");
  double smallest = 1.0;
  for (double lean = 0.0; lean <= 60.0; lean += 5.0) {
    for (double heading = 0.0; heading < 360.0; heading += 15.0) {
      Configuration x;
      x.q = JointVector::Zero(coman.joint_count());
      RobotData data;
      forward_kinematics(coman, x, data);
      // The upper arm hangs straight at q = 0: lean the plane instead of the arm.
      const Eigen::Vector3d up(std::sin(lean * kDegree) * std::cos(heading * kDegree),
                               std::sin(lean * kDegree) * std::sin(heading * kDegree),
                               std::cos(lean * kDegree));
      const Eigen::Vector3d origin = data.X_WB[at(elbow.body)] * elbow.X_BG.p - elbow.radius * up;
      smallest = std::min(smallest, height_over_plane(data, upper_arm, origin, up));
    }
  }
  EXPECT_GT(smallest, 0.002);
  RecordProperty("smallest_gap_mm", std::to_string(1e3 * smallest));
}

// Kneeling with the shank level and the thigh leaning up to 50 degrees forwards or backwards.
TEST(Coman, AKneelingLegTouchesWithTheKneeFirst) {
  const RobotModel coman = load_test_robot("coman");
  for (double lean = -50.0; lean <= 50.0; lean += 5.0) {
    const double knee_angle = 90.0 + lean;
    if (knee_angle > 110.0) {
      continue;
    }
    Configuration x;
    x.q = JointVector::Zero(coman.joint_count());
    x.q[*coman.find_joint("LKneeSag")] = knee_angle * kDegree;
    RobotData data;
    forward_kinematics(coman, x, data);
    const Geom& knee = geom_of(coman, "l_knee");
    const Eigen::Vector3d up = -data.X_WB[at(knee.body)].R.col(0);  // the shank's front faces down
    const Eigen::Vector3d origin = data.X_WB[at(knee.body)] * knee.X_BG.p - knee.radius * up;
    for (const char* part : {"l_thigh", "l_shank", "l_ankle"}) {
      EXPECT_GT(height_over_plane(data, geom_of(coman, part), origin, up), 0.002)
          << part << " at " << lean;
    }
  }
}

// The ankle's primitive stays above the sole however the ankle bends.
TEST(Coman, NothingOfTheFootReachesBelowTheSole) {
  const RobotModel coman = load_test_robot("coman");
  const Geom& sole = geom_of(coman, "r_sole");
  const Geom& ankle = geom_of(coman, "r_ankle");
  for (const double sag : {-1.2217, -0.6, 0.0, 0.6, 1.2217}) {
    Configuration x;
    x.q = JointVector::Zero(coman.joint_count());
    x.q[*coman.find_joint("RAnkSag")] = sag;
    RobotData data;
    forward_kinematics(coman, x, data);
    const Eigen::Vector3d up = data.X_WB[at(sole.body)].R.col(2);
    const Eigen::Vector3d origin = data.X_WB[at(sole.body)] * Eigen::Vector3d(0, 0, -0.09);
    EXPECT_GT(height_over_plane(data, ankle, origin, up), 0.03) << sag;
  }
}

// Not a fact of the robot but of the file: 30 solids, of which 22 are capsules.
TEST(Coman, CapsulesAreRecognised) {
  const RobotModel coman = load_test_robot("coman");
  std::array<int, 3> count{};
  for (const Geom& geom : coman.geoms) {
    ++count[static_cast<std::size_t>(geom.shape)];
  }
  EXPECT_EQ(count[static_cast<std::size_t>(Shape::kSphere)], 6);
  EXPECT_EQ(count[static_cast<std::size_t>(Shape::kBox)], 2);
  EXPECT_EQ(count[static_cast<std::size_t>(Shape::kCapsule)], 22);
  // Published: axis from (-0.05751, 0, 0.10937) to (-0.00912, 3e-5, 0.01051), radius 0.0716.
  const Geom& pelvis = geom_of(coman, "pelvis");
  EXPECT_EQ(pelvis.link, "Waist");
  EXPECT_NEAR(pelvis.radius, 0.0716, 5e-5);
  const Eigen::Vector3d low = pelvis.X_BG * Eigen::Vector3d(0, 0, 0.5 * pelvis.length);
  const Eigen::Vector3d high = pelvis.X_BG * Eigen::Vector3d(0, 0, -0.5 * pelvis.length);
  EXPECT_LT((low - Eigen::Vector3d(-0.00912, 3e-5, 0.01051)).norm(), 2e-5);
  EXPECT_LT((high - Eigen::Vector3d(-0.05751, 0, 0.10937)).norm(), 2e-5);
}

}  // namespace
}  // namespace clamber
