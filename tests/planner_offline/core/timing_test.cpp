// Timing of a stretch: rest at both ends, speeds, the path itself.
#include "planner_offline/search/timing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

/// A straight way in joint space from standing, `steps` steps long.
Stretch way(const JointVector& to, int steps) {
  Stretch stretch;
  stretch.kind = Stretch::Kind::kMotion;
  const Configuration x = standing();
  for (int i = 0; i <= steps; ++i) {
    stretch.path.push_back(x);
    stretch.path.back().q += static_cast<double>(i) / steps * (to - x.q);
  }
  return stretch;
}

JointVector raised_arm() {
  JointVector q = coman().home;
  q[joint_of("LElbj")] += 0.8;
  return q;
}

struct Speeds {
  double joints = 0.0, com = 0.0, first = 0.0, last = 0.0;
};

Speeds speeds_of(const std::vector<TimedPosture>& timed) {
  Speeds speeds;
  for (std::size_t i = 1; i < timed.size(); ++i) {
    const double dt = timed[i].time - timed[i - 1].time;
    const double joints = (timed[i].x.q - timed[i - 1].x.q).cwiseAbs().maxCoeff() / dt;
    speeds.joints = std::max(speeds.joints, joints);
    speeds.com =
        std::max(speeds.com, (data_at(timed[i].x).com - data_at(timed[i - 1].x).com).norm() / dt);
    speeds.first = i == 1 ? joints : speeds.first;
    speeds.last = joints;
  }
  return speeds;
}

void expect_orderly(const std::vector<TimedPosture>& timed, double spacing) {
  ASSERT_GE(timed.size(), 3U);
  EXPECT_EQ(timed.front().time, 0.0);
  EXPECT_EQ(timed.front().share, 0.0);
  EXPECT_EQ(timed.back().share, 1.0);
  for (std::size_t i = 1; i < timed.size(); ++i) {
    EXPECT_GT(timed[i].time, timed[i - 1].time);
    EXPECT_LE(timed[i].time - timed[i - 1].time, spacing + 1e-12);
    EXPECT_GT(timed[i].share, timed[i - 1].share);
  }
}

TEST(Timing, MotionStartsAndEndsAtRestWhereThePathDoes) {
  const Stretch stretch = way(raised_arm(), 40);
  const TimingSettings settings;
  const auto timed = time_stretch(coman(), stretch, settings);
  expect_orderly(timed, settings.knot_spacing);
  EXPECT_LT((timed.front().x.q - stretch.path.front().q).norm(), 1e-12);
  EXPECT_LT((timed.back().x.q - stretch.path.back().q).norm(), 1e-9);
  const Speeds speeds = speeds_of(timed);
  EXPECT_LT(speeds.first, 0.15 * speeds.joints);
  EXPECT_LT(speeds.last, 0.15 * speeds.joints);
}

TEST(Timing, JointsKeepTheirSpeedAndUseIt) {
  for (const double limit : {0.2, 0.6, 1.5}) {
    for (const int steps : {10, 100}) {
      TimingSettings settings;
      settings.joint_speed = limit;
      settings.com_speed = 100.0;
      settings.knot_spacing = 0.02;
      const Speeds speeds = speeds_of(time_stretch(coman(), way(raised_arm(), steps), settings));
      EXPECT_LE(speeds.joints, 1.001 * limit) << steps;
      EXPECT_GE(speeds.joints, 0.9 * limit) << steps;
    }
  }
}

TEST(Timing, TheCentreOfMassKeepsItsSpeedAndUsesIt) {
  JointVector q = coman().home;
  q[joint_of("WaistSag")] += 0.5;
  TimingSettings settings;
  settings.joint_speed = 100.0;
  settings.knot_spacing = 0.02;
  const Speeds speeds = speeds_of(time_stretch(coman(), way(q, 60), settings));
  EXPECT_LE(speeds.com, 1.01 * settings.com_speed);
  EXPECT_GE(speeds.com, 0.9 * settings.com_speed);
}

TEST(Timing, NoJointTurnsBackOnAStraightWay) {
  const auto timed = time_stretch(coman(), way(raised_arm(), 30), {});
  const int j = joint_of("LElbj");
  for (std::size_t i = 1; i < timed.size(); ++i) {
    EXPECT_GE(timed[i].x.q[j], timed[i - 1].x.q[j] - 1e-12);
  }
}

TEST(Timing, UnevenStepsAreRunAtTheSameSpeed) {
  Stretch stretch = way(raised_arm(), 100);
  stretch.path.erase(stretch.path.begin() + 30, stretch.path.begin() + 60);  // one long step
  TimingSettings settings;
  settings.com_speed = 100.0;
  settings.knot_spacing = 0.02;
  EXPECT_LE(speeds_of(time_stretch(coman(), stretch, settings)).joints,
            1.02 * settings.joint_speed);
}

TEST(Timing, LoadStretchRestsForItsTime) {
  Stretch stretch;
  stretch.kind = Stretch::Kind::kLoad;
  stretch.path = {standing()};
  TimingSettings settings;
  settings.load_time = 1.3;
  const auto timed = time_stretch(coman(), stretch, settings);
  expect_orderly(timed, settings.knot_spacing);
  EXPECT_NEAR(timed.back().time, 1.3, 1e-12);
  for (const TimedPosture& posture : timed) {
    EXPECT_EQ(posture.x.q, stretch.path.front().q);
    EXPECT_EQ(posture.x.X_WB.p, stretch.path.front().X_WB.p);
    EXPECT_EQ(posture.x.X_WB.R, stretch.path.front().X_WB.R);
  }
}

TEST(Timing, AMotionThatGoesNowhereIsStillATimedStretch) {
  Stretch stretch = way(coman().home, 5);
  const auto timed = time_stretch(coman(), stretch, {});
  expect_orderly(timed, TimingSettings{}.knot_spacing);
  EXPECT_TRUE(timed.back().x.q.allFinite());
  EXPECT_LT((timed.back().x.q - coman().home).norm(), 1e-12);
}

TEST(Timing, CornersOfThePathAreTakenSlowlyEnough) {
  // Out and back again: at the turn the centre of mass would reverse within one knot.
  Stretch stretch = way(raised_arm(), 20);
  stretch.path.insert(stretch.path.end(), stretch.path.rbegin() + 1, stretch.path.rend());
  TimingSettings quick, gentle;
  quick.joint_speed = gentle.joint_speed = 4.0;
  quick.com_acceleration = 1e3;
  gentle.com_acceleration = 0.02;
  const auto fastest = [](const std::vector<TimedPosture>& timed) {
    double largest = 0.0;
    for (std::size_t i = 1; i + 1 < timed.size(); ++i) {
      const double h = timed[i].time - timed[i - 1].time;
      largest = std::max(largest, (data_at(timed[i + 1].x).com - 2.0 * data_at(timed[i].x).com +
                                   data_at(timed[i - 1].x).com)
                                          .norm() /
                                      (h * h));
    }
    return largest;
  };
  const auto hurried = time_stretch(coman(), stretch, quick);
  const auto slowed = time_stretch(coman(), stretch, gentle);
  EXPECT_GT(fastest(hurried), 1.2 * gentle.com_acceleration);
  EXPECT_LE(fastest(slowed), 1.2 * gentle.com_acceleration);
  EXPECT_GT(slowed.back().time, hurried.back().time);
}

}  // namespace
}  // namespace clamber
