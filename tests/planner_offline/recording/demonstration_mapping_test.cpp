// What becomes of whole recordings on COMAN.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "planner_offline/recording/import.hpp"
#include "planner_offline/retarget/retarget.hpp"
#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"
#include "tests/planner_offline/recording/recordings.hpp"

namespace clamber {
namespace {

class Mapping : public testing::Test {
 protected:
  static std::filesystem::path coman_folder() {
    return std::filesystem::path(CLAMBER_SOURCE_DIR) / "configs" / "robots" / "coman";
  }

  RobotMotion map(const std::filesystem::path& file) {
    return retarget(import_recording(file), model_, config_);
  }

  double angle(const Configuration& x, const char* joint) const {
    return degrees(x.q[*model_.find_joint(joint)]);
  }

  /// Lowest point of a contact link, m.
  double height(const Configuration& x, const char* contact) const {
    RobotData data;
    forward_kinematics(model_, x, data);
    const auto& link = model_.contacts[static_cast<std::size_t>(*model_.find_contact(contact))];
    double lowest = 1e9;
    for (const auto& p : link.points) {
      lowest =
          std::min(lowest, (data.X_WB[static_cast<std::size_t>(link.body)] * p).z() - link.radius);
    }
    return lowest;
  }

  RobotModel model_ = load_robot(coman_folder() / "robot.yaml");
  RetargetConfig config_ = load_retarget_config(coman_folder() / "retarget.yaml");
};

TEST_F(Mapping, DefaultDemonstrationEndsOnAllFours) {
  const auto robot = map(demonstration_file());
  EXPECT_TRUE(robot.synthetic);
  EXPECT_EQ(robot.rate, 100.0);
  EXPECT_TRUE(robot.clamped.empty()) << robot.clamped.front().joint;
  const auto& end = robot.frames.back();
  std::vector<double> heights;
  for (const auto* contact : {"Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"}) {
    heights.push_back(height(end, contact));
  }
  const auto [least, most] = std::minmax_element(heights.begin(), heights.end());
  EXPECT_LT(*most - *least, 0.05);
  EXPECT_GT(*least, 0.10);
  for (const auto* side : {"L", "R"}) {
    const std::string s(side);
    EXPECT_NEAR(angle(end, (s + "KneeSag").c_str()), 95.0, 8.0);
    EXPECT_NEAR(angle(end, (s + "Elbj").c_str()), -95.0, 10.0);
    // Thigh within 15 deg of vertical.
    RobotData data;
    forward_kinematics(model_, end, data);
    const auto shank = static_cast<std::size_t>(*model_.find_joint(s + "KneeSag")) + 1;
    const auto thigh = static_cast<std::size_t>(*model_.find_joint(s + "HipSag")) + 1;
    Eigen::Vector3d down = data.X_WB[shank].p - data.X_WB[thigh].p;
    down.y() = 0.0;  // the hip's axes stand beside each other
    EXPECT_LT(down.normalized().z(), -std::cos(15.0 * 3.14159 / 180.0));
    // Forearm points forward and lies flat.
    const auto& wrist =
        model_.contacts[static_cast<std::size_t>(*model_.find_contact(s + "wrist"))];
    const auto& elbow = model_.contacts[static_cast<std::size_t>(*model_.find_contact(s + "elb"))];
    const Eigen::Vector3d forearm =
        data.X_WB[static_cast<std::size_t>(wrist.body)] * wrist.points[0] -
        data.X_WB[static_cast<std::size_t>(elbow.body)] * elbow.points[0];
    EXPECT_GT(forearm.normalized().x(), std::cos(15.0 * 3.14159 / 180.0));
  }
}

TEST_F(Mapping, DefaultDemonstrationMovesWithinTheDrivesSpeed) {
  const auto robot = map(demonstration_file());
  for (std::size_t f = 1; f < robot.frames.size(); ++f) {
    const JointVector step = robot.frames[f].q - robot.frames[f - 1].q;
    EXPECT_LT(step.cwiseAbs().maxCoeff() * robot.rate, 1.6);  // rad/s
  }
}

TEST_F(Mapping, SameInputsSameBytes) {
  const auto a = map(demonstration_file());
  const auto b = map(demonstration_file());
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (std::size_t f = 0; f < a.frames.size(); ++f) {
    ASSERT_EQ(a.frames[f].q, b.frames[f].q);
    ASSERT_EQ(a.frames[f].X_WB.p, b.frames[f].X_WB.p);
  }
}

TEST_F(Mapping, RealClimbBringsHandsAndKneesUp) {
  const auto file = recordings_folder() / "holosoma" / "seq_0.npy";
  CLAMBER_NEEDS_RECORDING(file);
  const auto robot = map(file);
  EXPECT_FALSE(robot.synthetic);
  const auto& start = robot.frames.front();
  const auto& end = robot.frames.back();
  EXPECT_NEAR(height(start, "Lfoot"), 0.0, 0.01);
  EXPECT_NEAR(height(start, "Rfoot"), 0.0, 0.01);
  // The box scaled to the robot: 0.48 m * 0.5168 / hip height.
  const double top = 0.48 * 0.5168 / robot.human_leg_length;
  for (const auto* contact : {"Lwrist", "Rwrist", "Lknee", "Rknee"}) {
    EXPECT_NEAR(height(end, contact), top, 0.06) << contact;
  }
  for (const auto* contact : {"Lelb", "Relb"}) EXPECT_GT(height(end, contact), top + 0.1);
  EXPECT_GT(end.X_WB.p.x() - start.X_WB.p.x(), 0.3);  // forward
  EXPECT_LT(std::abs(end.X_WB.p.y() - start.X_WB.p.y()), 0.1);
  // Real knees fold further than COMAN's.
  EXPECT_EQ(robot.clamped.size(), 2U);
}

TEST_F(Mapping, EveryRealRecordingStaysWithinTheLimits) {
  const auto folder = recordings_folder();
  CLAMBER_NEEDS_RECORDING(folder / "mvnx");
  for (const auto* name :
       {"holosoma/seq_3.npy", "holosoma/climb_seq0_from_box2_h0.48_100hz.csv", "cmu/01_02.amc",
        "mvnx/fullbody_v3_240hz.mvnx", "mvnx/upperbody_v4_60hz.mvnx"}) {
    const auto robot = map(folder / name);
    EXPECT_FALSE(robot.frames.empty());
    for (const auto& frame : robot.frames) {
      for (int j = 0; j < model_.joint_count(); ++j) {
        const auto& joint = model_.joints[static_cast<std::size_t>(j)];
        ASSERT_GE(frame.q[j], joint.lower) << name << " " << joint.name;
        ASSERT_LE(frame.q[j], joint.upper) << name << " " << joint.name;
      }
      ASSERT_TRUE(frame.X_WB.p.allFinite());
    }
  }
}

}  // namespace
}  // namespace clamber
