#include "planner_offline/recording/mvnx.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "planner_offline/recording/joint_angles.hpp"
#include "robot_model/read_file.hpp"
#include "tests/planner_offline/recording/recordings.hpp"

namespace clamber {
namespace {

const std::map<std::string, std::pair<std::string, std::string>>& connected_segments() {
  static const std::map<std::string, std::pair<std::string, std::string>> joints = [] {
    std::map<std::string, std::pair<std::string, std::string>> all;
    const auto& specs = tools::segment_specs();
    for (std::size_t i = 1; i < specs.size(); ++i) {
      const std::pair<std::string, std::string> ends(
          specs[static_cast<std::size_t>(specs[i].parent)].label, specs[i].label);
      all[std::string(specs[i].joint)] = ends;
    }
    // Version 3's names of the joints at the collar bones.
    all["jRightC7Shoulder"] = all["jRightT4Shoulder"];
    all["jLeftC7Shoulder"] = all["jLeftT4Shoulder"];
    return all;
  }();
  return joints;
}

/// Largest difference between the file's jointAngle and the angles of its orientations, deg.
double worst_angle_error(const HumanMotion& motion) {
  double worst = 0.0;
  for (const auto& frame : motion.frames) {
    for (std::size_t j = 0; j < motion.joints.size(); ++j) {
      const auto& [parent, child] = connected_segments().at(motion.joints[j]);
      const Eigen::Vector3d angle = mvn_joint_angle(
          frame.orientation[motion.segment(parent)].toRotationMatrix(),
          frame.orientation[motion.segment(child)].toRotationMatrix(), motion.joints[j]);
      for (int k = 0; k < 3; ++k) {
        const double turn = 2.0 * 3.14159265358979323846;
        worst =
            std::max(worst, degrees(std::abs(std::remainder(angle[k] - frame.angle[j][k], turn))));
      }
    }
  }
  return worst;
}

/// Largest distance by which a child's origin moves in its parent's frame over the recording, m.
double worst_closure(const HumanMotion& motion, const std::vector<std::string>& joints) {
  double worst = 0.0;
  for (const auto& joint : joints) {
    const auto& [parent, child] = connected_segments().at(joint);
    const auto p = motion.segment(parent), c = motion.segment(child);
    const auto offset = [&](const HumanMotion::Frame& frame) {
      return Eigen::Vector3d(frame.orientation[p].conjugate() *
                             (frame.origin[c] - frame.origin[p]));
    };
    for (const auto& frame : motion.frames) {
      worst = std::max(worst, (offset(frame) - offset(motion.frames.front())).norm());
    }
  }
  return worst;
}

TEST(Mvnx, Version3AnglesFollowFromItsOrientations) {
  const auto file = recordings_folder() / "mvnx" / "fullbody_v3_240hz.mvnx";
  CLAMBER_NEEDS_RECORDING(file);
  const auto motion = parse_mvnx(read_file(file), "v3");
  EXPECT_EQ(motion.format, "MVNX 3");
  EXPECT_EQ(motion.rate, 240.0);
  EXPECT_EQ(motion.frames.size(), 4U);
  EXPECT_EQ(motion.joints.size(), 22U);
  EXPECT_FALSE(motion.synthetic);
  EXPECT_TRUE(motion.warnings.empty());
  EXPECT_LT(worst_angle_error(motion), 0.01);
}

TEST(Mvnx, Version4AnglesFollowFromItsOrientations) {
  const auto file = recordings_folder() / "mvnx" / "upperbody_v4_60hz.mvnx";
  CLAMBER_NEEDS_RECORDING(file);
  const auto motion = parse_mvnx(read_file(file), "v4");
  EXPECT_EQ(motion.format, "MVNX 4");
  EXPECT_EQ(motion.rate, 60.0);
  EXPECT_EQ(motion.frames.size(), 112U);
  EXPECT_TRUE(motion.warnings.empty());
  EXPECT_LT(worst_angle_error(motion), 0.01);
}

TEST(Mvnx, LimbsHangDownInTheAnatomicalFrame) {
  for (const auto* name : {"fullbody_v3_240hz.mvnx", "upperbody_v4_60hz.mvnx"}) {
    const auto file = recordings_folder() / "mvnx" / name;
    CLAMBER_NEEDS_RECORDING(file);
    const auto motion = parse_mvnx(read_file(file), name);
    for (const auto& [upper, lower] :
         {std::pair{"RightUpperArm", "RightForeArm"}, std::pair{"LeftUpperArm", "LeftForeArm"},
          std::pair{"RightForeArm", "RightHand"}, std::pair{"LeftForeArm", "LeftHand"}}) {
      const auto u = motion.segment(upper), l = motion.segment(lower);
      const auto& frame = motion.frames.back();
      const Eigen::Vector3d bone =
          frame.orientation[u].conjugate() * (frame.origin[l] - frame.origin[u]);
      EXPECT_NEAR(bone.normalized().z(), -1.0, 2e-4) << name << " " << upper;
    }
  }
}

TEST(Mvnx, JointsStayTogether) {
  const auto v4 = recordings_folder() / "mvnx" / "upperbody_v4_60hz.mvnx";
  CLAMBER_NEEDS_RECORDING(v4);
  // The suit's model lets joints drift by up to 1.9 mm each way.
  const auto motion = parse_mvnx(read_file(v4), "v4");
  EXPECT_LT(worst_closure(motion, motion.joints), 4e-3);
  const auto v3 = recordings_folder() / "mvnx" / "fullbody_v3_240hz.mvnx";
  const auto full = parse_mvnx(read_file(v3), "v3");
  EXPECT_LT(worst_closure(full, full.joints), 2e-4);
}

TEST(Mvnx, ReadsWhatTheToolWrites) {
  const tools::ClimbChoreography climb({});
  const auto motion = parse_mvnx(small_mvnx(), "made");
  EXPECT_TRUE(motion.synthetic);
  EXPECT_EQ(motion.segments.size(), 23U);
  EXPECT_EQ(motion.joints.size(), 22U);
  ASSERT_EQ(motion.frames.size(), 67U);
  EXPECT_LT(worst_angle_error(motion), 0.01);
  EXPECT_LT(worst_closure(motion, motion.joints), 3e-4);
  const auto figure = climb.at(10.0);
  const auto& frame = motion.frames[30];
  for (std::size_t i = 0; i < motion.segments.size(); ++i) {
    EXPECT_LT(angle_between(frame.orientation[i], Eigen::Quaterniond(figure.R[i])), 0.005);
    EXPECT_LT((frame.origin[i] - figure.p[i]).norm(), 1e-4);
  }
}

/// Positive angles of every joint class mean what the manual says.
TEST(Mvnx, SignsOfTheAngles) {
  const auto turned = [](double angle, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  };
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const Eigen::Vector3d X = Eigen::Vector3d::UnitX(), Y = Eigen::Vector3d::UnitY(),
                        Z = Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(mvn_joint_angle(I, turned(0.5, Y), "jL5S1").z(), 0.5, 1e-12);       // bends forward
  EXPECT_NEAR(mvn_joint_angle(I, turned(0.5, X), "jL5S1").x(), 0.5, 1e-12);       // leans right
  EXPECT_NEAR(mvn_joint_angle(I, turned(0.5, Z), "jL5S1").y(), 0.5, 1e-12);       // turns left
  EXPECT_NEAR(mvn_joint_angle(I, turned(-0.5, Y), "jRightHip").z(), 0.5, 1e-12);  // flexes
  EXPECT_NEAR(mvn_joint_angle(I, turned(0.5, Y), "jLeftKnee").z(), 0.5, 1e-12);
  EXPECT_NEAR(mvn_joint_angle(I, turned(-0.5, Y), "jRightElbow").z(), 0.5, 1e-12);
  EXPECT_NEAR(mvn_joint_angle(I, turned(-0.5, X), "jRightHip").x(), 0.5, 1e-12);  // abducts
  EXPECT_NEAR(mvn_joint_angle(I, turned(0.5, X), "jLeftHip").x(), 0.5, 1e-12);
  EXPECT_NEAR(mvn_joint_angle(I, turned(0.5, Z), "jRightHip").y(), 0.5, 1e-12);  // turns inward
  EXPECT_NEAR(mvn_joint_angle(I, turned(-0.5, Z), "jLeftHip").y(), 0.5, 1e-12);
}

}  // namespace
}  // namespace clamber
