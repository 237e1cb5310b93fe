// motion.csv: text and back.
#include "apps/motion_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

RobotModel two_joints() {
  RobotModel model;
  model.name = "small";
  for (const char* name : {"Hip", "Knee"}) {
    Joint joint;
    joint.name = name;
    model.joints.push_back(joint);
  }
  return model;
}

RobotMotion sample() {
  RobotMotion motion;
  motion.recording = "a person.mvnx";
  motion.synthetic = true;
  motion.rate = 100.0;
  motion.human_leg_length = 0.9;
  motion.clamped = {{"Knee", 0.1, 0.25}};
  for (int i = 0; i < 3; ++i) {
    Configuration x;
    x.X_WB.p = {0.1 * i, -0.2, 1.0 / 3.0};
    x.X_WB.R = rotation_exp({0.1, 0.2 * i, -3.0});
    x.q.resize(2);
    x.q << 0.1 + i, -1e-17;
    motion.frames.push_back(x);
  }
  return motion;
}

TEST(MotionFile, KeepsEverything) {
  const RobotModel model = two_joints();
  const RobotMotion before = sample();
  const RobotMotion after = parse_motion(format_motion(before, model), "m.csv", model);
  EXPECT_EQ(after.recording, before.recording);
  EXPECT_EQ(after.synthetic, before.synthetic);
  EXPECT_EQ(after.rate, before.rate);
  EXPECT_EQ(after.human_leg_length, before.human_leg_length);
  ASSERT_EQ(after.clamped.size(), 1u);
  EXPECT_EQ(after.clamped[0].joint, "Knee");
  EXPECT_EQ(after.clamped[0].worst, 0.1);
  EXPECT_EQ(after.clamped[0].share, 0.25);
  ASSERT_EQ(after.frames.size(), before.frames.size());
  for (std::size_t i = 0; i < after.frames.size(); ++i) {
    EXPECT_EQ(after.frames[i].q, before.frames[i].q);
    EXPECT_EQ(after.frames[i].X_WB.p, before.frames[i].X_WB.p);
    EXPECT_TRUE(after.frames[i].X_WB.R.isApprox(before.frames[i].X_WB.R, 1e-14));
  }
}

TEST(MotionFile, FindsJointsByName) {
  const RobotModel model = two_joints();
  std::string text = format_motion(sample(), model);
  const std::size_t at = text.find("Hip,Knee");
  text.replace(at, 8, "Knee,Hip");
  const RobotMotion motion = parse_motion(text, "m.csv", model);
  EXPECT_EQ(motion.frames[0].q[1], sample().frames[0].q[0]);
}

TEST(MotionFile, RefusesWhatItCannotUse) {
  const RobotModel model = two_joints();
  const std::string good = format_motion(sample(), model);
  const auto error = [&](const std::string& from, const std::string& to) -> std::string {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    try {
      static_cast<void>(parse_motion(text, "m.csv", model));
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  };
  using testing::HasSubstr;
  EXPECT_THAT(error("motion 1", "motion 2"), HasSubstr("m.csv:1: expected '# clamber motion 1'"));
  EXPECT_THAT(error("rate_hz: 100", "rate_hz: 0"), HasSubstr("rate_hz"));
  EXPECT_THAT(error("rate_hz: 100", "rate_hz: inf"), HasSubstr("m.csv:5: expected a finite"));
  EXPECT_THAT(error("synthetic: true", "synthetic: yes"), HasSubstr("expected true or false"));
  EXPECT_THAT(error(",Knee", ",Hip"), HasSubstr("'Hip' is there twice"));
  EXPECT_THAT(error(",Knee", ""), HasSubstr("'Knee' is missing"));
  EXPECT_THAT(error(",Knee", ",Knee,Toe"), HasSubstr("no joint 'Toe'"));
  EXPECT_THAT(error("0.1,-1e-17\n", "0.1\n"), HasSubstr("m.csv:9: expected 9 columns, found 8"));
  EXPECT_THAT(error("0.1,-1e-17\n", "nan,-1e-17\n"), HasSubstr("found 'nan'"));
  EXPECT_THAT(error("0.3333333333333333,", "0.3333333333333333,9"), HasSubstr("unit quaternion"));
}

}  // namespace
}  // namespace clamber
