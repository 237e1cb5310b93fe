// Position-only recordings: joint positions become the segment frames that MVNX has.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "planner_offline/recording/acclaim.hpp"
#include "planner_offline/recording/import.hpp"
#include "planner_offline/recording/limb_frames.hpp"
#include "planner_offline/recording/npy.hpp"
#include "planner_offline/recording/parse_number.hpp"
#include "planner_offline/recording/position_csv.hpp"
#include "robot_model/read_file.hpp"
#include "tests/planner_offline/recording/made_positions.hpp"
#include "tests/planner_offline/recording/recordings.hpp"

namespace clamber {
namespace {

double bone_length(const HumanMotion& motion, std::size_t frame, const char* a, const char* b) {
  return (motion.frames[frame].origin[motion.segment(a)] -
          motion.frames[frame].origin[motion.segment(b)])
      .norm();
}

/// Largest change of a bone's length over the recording, m.
double length_change(const HumanMotion& motion, const char* a, const char* b) {
  double least = 1e9, most = 0.0;
  for (std::size_t f = 0; f < motion.frames.size(); ++f) {
    least = std::min(least, bone_length(motion, f, a, b));
    most = std::max(most, bone_length(motion, f, a, b));
  }
  return most - least;
}

constexpr std::pair<const char*, const char*> kBones[] = {
    {"RightUpperArm", "RightForeArm"},  {"RightForeArm", "RightHand"},
    {"LeftUpperArm", "LeftForeArm"},    {"LeftForeArm", "LeftHand"},
    {"RightUpperLeg", "RightLowerLeg"}, {"RightLowerLeg", "RightFoot"},
    {"LeftUpperLeg", "LeftLowerLeg"},   {"LeftLowerLeg", "LeftFoot"}};

TEST(ParseNumber, TakesWholeFiniteNumbersOnly) {
  EXPECT_EQ(parse_number(" -1.5e2 "), -150.0);
  EXPECT_EQ(parse_number("+2"), 2.0);
  EXPECT_EQ(parse_number("1e-400"), 0.0);
  for (const auto* bad : {"", "nan", "inf", "1x", "+-2", "1e400", "0x10", "1,5"}) {
    EXPECT_FALSE(parse_number(bad)) << bad;
  }
}

TEST(Npy, FloatAndDoubleAgree) {
  const auto single = parse_npy(make_npy(3, "<f4"), "f4");
  const auto full = parse_npy(make_npy(3, "<f8"), "f8", 50.0);
  EXPECT_EQ(single.rate, 120.0);
  EXPECT_EQ(full.rate, 50.0);
  ASSERT_EQ(single.points.size(), 53U);
  for (std::size_t f = 0; f < 3; ++f) {
    for (std::size_t p = 0; p < 53; ++p) {
      EXPECT_LT((single.frames[f].point[p] - full.frames[f].point[p]).norm(), 1e-6);
    }
  }
}

/// The made-up climb as bare positions gives back the orientations it was made from. The twist of
/// nearly straight limbs cannot be seen in positions: those are compared by direction only.
TEST(LimbFrames, GiveBackTheOrientationsOfTheMadeUpClimb) {
  const int frames = 221;
  auto motion = parse_npy(make_npy(frames, "<f8", 10.0), "made", 10.0);
  add_segments(motion);
  const tools::ClimbChoreography climb({});
  for (std::size_t f = 0; f < motion.frames.size(); ++f) {
    const auto figure = climb.at(static_cast<double>(f) / 10.0);
    for (std::size_t s = 0; s < motion.segments.size(); ++s) {
      const auto& specs = tools::segment_specs();
      const auto spec = std::find_if(specs.begin(), specs.end(),
                                     [&](const auto& x) { return x.label == motion.segments[s]; });
      const auto i = static_cast<std::size_t>(spec - specs.begin());
      const auto& q = motion.frames[f].orientation[s];
      const Eigen::Vector3d along = figure.R[i].col(2);
      const auto& label = motion.segments[s];
      if (label.find("Hand") != std::string::npos) continue;  // wrists are not seen
      if (label.find("Foot") != std::string::npos) {          // the roll follows the shank
        EXPECT_LT(angle_between(q, Eigen::Quaterniond(figure.R[i])), 6.0) << label << " " << f;
      } else if (label == "Pelvis" || label == "T8") {
        EXPECT_LT(angle_between(q, Eigen::Quaterniond(figure.R[i])), 1.0) << label << " " << f;
      } else if (label.find("Toe") == std::string::npos) {
        EXPECT_LT(degrees(std::acos(std::min(1.0, along.dot(q * Eigen::Vector3d::UnitZ())))), 1e-4)
            << label << " " << f;
      }
      if (label.find("UpperLeg") != std::string::npos && f > 30) {
        EXPECT_LT(angle_between(q, Eigen::Quaterniond(figure.R[i])), 3.0) << label << " " << f;
      }
      if (label.find("UpperArm") != std::string::npos && f > 30) {
        EXPECT_LT(angle_between(q, Eigen::Quaterniond(figure.R[i])), 1.0) << label << " " << f;
      }
    }
  }
}

TEST(LimbFrames, TwistOfAStraightLimbIsCarriedOn) {
  auto motion = parse_npy(make_npy(1, "<f8"), "made", 10.0);
  // Bend the right elbow sideways, then straighten it: the plane of the bend must stay.
  const auto elbow = *motion.find_point("RightForeArm"), wrist = *motion.find_point("RightHand");
  const auto base = motion.frames[0];
  motion.frames.clear();
  for (int f = 0; f <= 20; ++f) {
    auto frame = base;
    const double flexion = 1.0 - 0.05 * f;
    const Eigen::Vector3d upper =
        (base.point[elbow] - base.point[*motion.find_point("RightArm")]).normalized();
    const Eigen::Vector3d side = upper.cross(Eigen::Vector3d::UnitX()).normalized();
    frame.point[wrist] =
        base.point[elbow] + 0.25 * (std::cos(flexion) * upper + std::sin(flexion) * side);
    motion.frames.push_back(frame);
  }
  // Nearly straight, a bend of 12 deg in another plane is mostly noise.
  auto noisy = motion.frames.back();
  const Eigen::Vector3d upper =
      (base.point[elbow] - base.point[*motion.find_point("RightArm")]).normalized();
  const Eigen::Vector3d ahead = (Eigen::Vector3d::UnitX() - upper.x() * upper).normalized();
  noisy.point[wrist] = base.point[elbow] + 0.25 * (std::cos(0.21) * upper + std::sin(0.21) * ahead);
  motion.frames.push_back(noisy);
  add_segments(motion);
  const auto s = motion.segment("RightUpperArm");
  for (std::size_t f = 0; f < motion.frames.size(); ++f) {
    const double allowed = f + 1 < motion.frames.size() ? 1e-6 : 10.0;  // deg
    EXPECT_LT(angle_between(motion.frames[f].orientation[s], motion.frames[0].orientation[s]),
              allowed);
  }
}

class RealClimb : public testing::Test {
 protected:
  void SetUp() override { CLAMBER_NEEDS_RECORDING(folder_ / "seq_0.npy"); }
  std::filesystem::path folder_ = recordings_folder() / "holosoma";
};

TEST_F(RealClimb, BonesKeepTheirLength) {
  const auto motion = import_whole_recording(folder_ / "seq_0.npy");
  ASSERT_EQ(motion.frames.size(), 2801U);
  for (const auto& [a, b] : kBones) EXPECT_LT(length_change(motion, a, b), 1e-5) << a;
  EXPECT_NEAR(bone_length(motion, 0, "RightUpperArm", "RightForeArm"), 0.311, 0.001);
  EXPECT_NEAR(bone_length(motion, 0, "RightForeArm", "RightHand"), 0.254, 0.001);
  EXPECT_NEAR(bone_length(motion, 0, "LeftUpperLeg", "LeftLowerLeg"), 0.373, 0.001);
  EXPECT_NEAR(bone_length(motion, 0, "LeftLowerLeg", "LeftFoot"), 0.453, 0.001);
}

TEST_F(RealClimb, JointsMoveWithoutJumps) {
  const auto motion = import_recording(folder_ / "seq_0.npy");
  for (std::size_t f = 1; f < motion.frames.size(); ++f) {
    for (std::size_t s = 0; s < motion.segments.size(); ++s) {
      const double step =
          angle_between(motion.frames[f].orientation[s], motion.frames[f - 1].orientation[s]);
      EXPECT_LT(step * motion.rate, 700.0) << motion.segments[s] << " at frame " << f;
    }
  }
}

/// The csv is the same recording from frame 540 on, at 100 Hz and 0.47 m lower: every 50 ms the
/// two have a sample in common.
TEST_F(RealClimb, NpyAndCsvAgree) {
  const auto npy = import_whole_recording(folder_ / "seq_0.npy");
  const auto csv = import_whole_recording(folder_ / "climb_seq0_from_box2_h0.48_100hz.csv");
  EXPECT_EQ(csv.rate, 100.0);
  ASSERT_EQ(csv.segments, npy.segments);
  for (std::size_t k = 0; k < 160; ++k) {
    const auto& a = npy.frames[540 + 6 * k];
    const auto& b = csv.frames[5 * k];
    for (std::size_t s = 0; s < npy.segments.size(); ++s) {
      const Eigen::Vector3d lowered = a.origin[s] - Eigen::Vector3d(0.0, 0.0, 0.47);
      EXPECT_LT((lowered - b.origin[s]).norm(), 2e-4) << npy.segments[s];
    }
    for (const auto* segment : {"Pelvis", "T8", "RightLowerLeg", "LeftLowerLeg"}) {
      const auto s = npy.segment(segment);
      EXPECT_LT(angle_between(a.orientation[s], b.orientation[s]), 2.0) << segment << " " << k;
    }
  }
}

TEST(Acclaim, BonesKeepTheirLengthAndThePersonStandsUpright) {
  const auto file = recordings_folder() / "cmu" / "01_02.amc";
  CLAMBER_NEEDS_RECORDING(file);
  const auto motion = import_whole_recording(file);
  EXPECT_EQ(motion.format, "ASF/AMC");
  EXPECT_GT(motion.frames.size(), 4000U);
  for (const auto& [a, b] : kBones) EXPECT_LT(length_change(motion, a, b), 1e-6) << a;
  EXPECT_NEAR(bone_length(motion, 0, "LeftUpperLeg", "LeftLowerLeg"), 7.1578 / 0.45 * 0.0254, 1e-6);
  EXPECT_NEAR(motion.hip_height, 0.87, 0.05);
  // Upright: z up and the left hip to the left of where the chest faces.
  const auto& frame = motion.frames[0];
  const Eigen::Vector3d left =
      frame.origin[motion.segment("LeftUpperLeg")] - frame.origin[motion.segment("RightUpperLeg")];
  EXPECT_GT((frame.orientation[motion.segment("Pelvis")] * Eigen::Vector3d::UnitZ()).z(), 0.9);
  EXPECT_GT((frame.orientation[motion.segment("T8")] * Eigen::Vector3d::UnitY()).dot(left), 0.1);
  // Feet point forward, not backward.
  const Eigen::Vector3d forward =
      frame.orientation[motion.segment("Pelvis")] * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d foot =
      frame.origin[motion.segment("LeftToe")] - frame.origin[motion.segment("LeftFoot")];
  EXPECT_GT(foot.dot(forward), 0.05);
}

/// One bone turned by hand: the angles turn about the bone's own axes.
TEST(Acclaim, ForwardKinematics) {
  const auto skeleton = parse_asf(small_asf(), "x.asf");
  ASSERT_EQ(skeleton.bones.size(), 2U);
  EXPECT_NEAR(skeleton.bones[0].offset.y(), 2.0 / 0.45 * 0.0254, 1e-12);
  EXPECT_EQ(skeleton.bones[1].parent, 0);
  EXPECT_TRUE(skeleton.bones[1].dof.empty());
  EXPECT_NEAR(skeleton.bones[0].axis(1, 0), std::sin(20.0 * 3.14159265358979 / 180.0), 1e-12);
}

}  // namespace
}  // namespace clamber
