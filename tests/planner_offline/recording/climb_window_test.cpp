#include "planner_offline/recording/climb_window.hpp"

#include <gtest/gtest.h>

#include "planner_offline/recording/import.hpp"
#include "tests/planner_offline/recording/recordings.hpp"

namespace clamber {
namespace {

TEST(ClimbWindow, DefaultDemonstration) {
  const auto motion = import_recording(demonstration_file());
  EXPECT_TRUE(motion.synthetic);
  EXPECT_TRUE(motion.warnings.empty());
  EXPECT_EQ(motion.source, "climb_table_synthetic.mvnx");
  EXPECT_LT(motion.start_time, 1.2);                               // the person still stands
  EXPECT_NEAR(motion.start_time + motion.duration(), 22.0, 0.02);  // rests on all fours
  EXPECT_NEAR(motion.floor, 0.0, 0.01);
  EXPECT_NEAR(motion.hip_height, 0.530 * 1.75, 0.01);
  EXPECT_NEAR(degrees(motion.heading), 0.0, 0.05);
}

TEST(ClimbWindow, RealClimbFromStandingToBothKnees) {
  const auto file = recordings_folder() / "holosoma" / "seq_0.npy";
  CLAMBER_NEEDS_RECORDING(file);
  const auto motion = import_recording(file);
  EXPECT_TRUE(motion.warnings.empty());
  const double first = motion.start_time * 120.0;
  const double last = first + static_cast<double>(motion.frames.size() - 1);
  EXPECT_GT(first, 490.0);  // both feet have arrived on the lower box
  EXPECT_LT(first, 600.0);  // hands are not on yet (651)
  EXPECT_GT(last, 1000.0);  // both knees are up (971) ...
  EXPECT_LT(last, 1130.0);  // ... and no foot has left for the top yet
  EXPECT_NEAR(motion.floor, 0.47, 0.025);
  EXPECT_NEAR(motion.hip_height, 0.89, 0.02);
  // The upper box's front edge runs along (1.5952, 0.1241): its normal points at -85.55 deg.
  EXPECT_NEAR(degrees(motion.heading), -85.55, 4.0);

  const auto level = [&](const HumanMotion::Frame& frame, const char* segment) {
    return frame.origin[motion.segment(segment)].z();
  };
  const auto& start = motion.frames.front();
  EXPECT_NEAR(level(start, "LeftFoot"), level(start, "RightFoot"), 0.03);
  const auto& end = motion.frames.back();
  const double top = 0.95;
  for (const auto* knee : {"LeftLowerLeg", "RightLowerLeg"}) {
    EXPECT_NEAR(level(end, knee), top + 0.1, 0.05);
  }
  for (const auto* foot : {"LeftFoot", "RightFoot"}) EXPECT_LT(level(end, foot), top + 0.05);
}

TEST(ClimbWindow, OptionsOverrideWhatIsFound) {
  ImportOptions options;
  options.window.start = 2.0;
  options.window.end = 10.0;
  options.window.floor = -0.1;
  const auto motion = import_recording(demonstration_file(), options);
  EXPECT_NEAR(motion.start_time, 2.0, 1e-9);
  EXPECT_NEAR(motion.duration(), 8.0, 1e-9);
  EXPECT_EQ(motion.floor, -0.1);
}

TEST(ClimbWindow, SteppingUpWithoutHandsIsKeptWhole) {
  const auto file = recordings_folder() / "holosoma" / "seq_3.npy";
  CLAMBER_NEEDS_RECORDING(file);
  const auto motion = import_recording(file);
  EXPECT_EQ(motion.frames.size(), 2401U);
  ASSERT_EQ(motion.warnings.size(), 1U);
  EXPECT_NE(motion.warnings[0].find("no hand support"), std::string::npos);
  EXPECT_NEAR(motion.hip_height, 0.90, 0.03);
}

TEST(HumanMotionTest, ResamplingKeepsEndsAndTurnsTheShortWay) {
  HumanMotion motion;
  motion.rate = 60.0;
  motion.segments = {"Pelvis"};
  for (int i = 0; i < 61; ++i) {
    Eigen::Quaterniond q(Eigen::AngleAxisd(0.01 * i, Eigen::Vector3d::UnitZ()));
    if (i % 2 == 1) q.coeffs() = -q.coeffs();  // the same rotation
    motion.frames.push_back({{q}, {Eigen::Vector3d(i, 0, 0)}, {}, {}});
  }
  const auto sampled = resample(motion, 100.0);
  ASSERT_EQ(sampled.frames.size(), 101U);
  for (std::size_t k = 0; k < sampled.frames.size(); ++k) {
    const double i = 0.6 * static_cast<double>(k);
    EXPECT_NEAR(sampled.frames[k].origin[0].x(), i, 1e-9);
    EXPECT_LT(
        angle_between(sampled.frames[k].orientation[0],
                      Eigen::Quaterniond(Eigen::AngleAxisd(0.01 * i, Eigen::Vector3d::UnitZ()))),
        1e-6);
  }
}

}  // namespace
}  // namespace clamber
