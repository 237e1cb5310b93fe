// contacts.yaml: round trip, and every way in which it can be unusable.
#include "planner_offline/contacts/contact_sequence.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;

std::filesystem::path scratch(const std::string& name) {
  return std::filesystem::path(testing::TempDir()) / ("contact_sequence_" + name + ".yaml");
}

RobotModel robot() {
  RobotModel model;
  model.name = "coman";
  for (const char* joint : {"LElbj", "LKneeSag"}) {
    model.joints.emplace_back();
    model.joints.back().name = joint;
  }
  for (const char* link : {"Lwrist", "Lknee", "Lfoot"}) {
    model.contacts.emplace_back();
    model.contacts.back().name = link;
  }
  return model;
}

ContactSequence example() {
  ContactState state;
  state.start = 1.05;
  state.end = 2.0 / 3.0 + 1.0;
  state.obstacle = {{"Lwrist", "box", {0.1, 1.0 / 3.0, 0.0}, 0.0123456789012345678}};
  state.floor = {{"Lfoot", "floor", {-0.1, 0.08, -0.275}, 0.0}};
  state.posture.q = (JointVector(2) << -1.4, 0.1 + 0.2).finished();
  state.posture.X_WB.p = {-0.2, 1e-17, 0.5};
  state.posture.X_WB.R =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  ContactSequence sequence;
  sequence.recording = "a: climb.mvnx";
  sequence.synthetic = true;
  sequence.robot = "coman";
  sequence.playback_obstacle_height = 0.235;
  sequence.joint_names = {"LElbj", "LKneeSag"};
  sequence.states = {state};
  sequence.reduced = {state};
  sequence.notes = {"One: \"quoted\".", "Two"};
  return sequence;
}

void expect_equal(const ContactState& a, const ContactState& b) {
  EXPECT_EQ(a.start, b.start);
  EXPECT_EQ(a.end, b.end);
  EXPECT_EQ(a.stability, b.stability);
  ASSERT_EQ(a.obstacle.size(), b.obstacle.size());
  EXPECT_EQ(a.obstacle[0].link, b.obstacle[0].link);
  EXPECT_EQ(a.obstacle[0].surface, b.obstacle[0].surface);
  EXPECT_EQ(a.obstacle[0].position, b.obstacle[0].position);
  EXPECT_EQ(a.obstacle[0].stability, b.obstacle[0].stability);
  ASSERT_EQ(a.floor.size(), b.floor.size());
  EXPECT_EQ(a.floor[0].position, b.floor[0].position);
  EXPECT_EQ(a.posture.q, b.posture.q);
  EXPECT_EQ(a.posture.X_WB.p, b.posture.X_WB.p);
  EXPECT_TRUE(a.posture.X_WB.R.isApprox(b.posture.X_WB.R, 1e-14));
}

TEST(ContactFile, ReadsWhatItWrote) {
  const auto file = scratch("round_trip");
  const ContactSequence written = example();
  save_contacts(written, file);
  const ContactSequence read = load_contacts(file, robot());
  EXPECT_EQ(read.recording, written.recording);
  EXPECT_EQ(read.synthetic, written.synthetic);
  EXPECT_EQ(read.robot, written.robot);
  EXPECT_EQ(read.playback_obstacle_height, written.playback_obstacle_height);
  EXPECT_EQ(read.joint_names, written.joint_names);
  EXPECT_EQ(read.notes, written.notes);
  ASSERT_EQ(read.states.size(), 1u);
  ASSERT_EQ(read.reduced.size(), 1u);
  expect_equal(read.states[0], written.states[0]);
  expect_equal(read.reduced[0], written.reduced[0]);
}

TEST(ContactFile, IsTheSameBytesEachTime) {
  save_contacts(example(), scratch("a"));
  save_contacts(example(), scratch("b"));
  EXPECT_EQ(read_file(scratch("a")), read_file(scratch("b")));
}

TEST(ContactFile, RefusesToSaveWhatIsNotFinite) {
  ContactSequence sequence = example();
  sequence.states[0].posture.q[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(save_contacts(sequence, scratch("nan")), InputError);
  EXPECT_THROW(save_contacts(example(), "/no/such/folder/contacts.yaml"), InputError);
}

struct BadFile {
  const char* name;
  const char* from;  ///< text of the good file ...
  const char* to;    ///< ... replaced by this, at its first occurrence
  const char* says;  ///< part of the message
};

class BadContactFile : public testing::TestWithParam<BadFile> {};

TEST_P(BadContactFile, IsRefusedWithFileLineAndKey) {
  const auto file = scratch(std::string("bad_") + GetParam().name);
  save_contacts(example(), file);
  std::string text = read_file(file);
  const auto at = text.find(GetParam().from);
  ASSERT_NE(at, std::string::npos) << GetParam().from << " is not in\n" << text;
  text.replace(at, std::string(GetParam().from).size(), GetParam().to);
  std::ofstream(file) << text;
  try {
    (void)load_contacts(file, robot());
    FAIL() << "accepted:\n" << text;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(file.string() + ":"));
    EXPECT_THAT(error.what(), HasSubstr(GetParam().says));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadContactFile,
    testing::Values(
        BadFile{"MissingKey", "recording:", "recoding:", "recoding"},
        BadFile{"MissingStart", "start: 1.05", "begin: 1.05", "begin"},
        BadFile{"NoRobot", "robot: \"coman\"\n", "", "robot"},
        BadFile{"OtherRobot", "robot: \"coman\"", "robot: \"walker\"", "walker"},
        BadFile{"UnknownLink", "Lwrist", "Ltoe", "unknown contact link 'Ltoe'"},
        BadFile{"LinkTwice", "obstacle:\n      - {",
                "obstacle:\n      - {link: Lwrist, surface: box, position: [0, 0, 0], stability: 0}"
                "\n      - {",
                "twice"},
        BadFile{"NaN", "0.235", ".nan", "playback_obstacle_height"},
        BadFile{"Infinite", "stability: 0\n", "stability: .inf\n", "stability"},
        BadFile{"NegativeStability", "stability: 0\n", "stability: -1\n", "stability"},
        BadFile{"NoNumber", "1.05", "soon", "start"},
        BadFile{"EndsBeforeItStarts", "end: 1.6", "end: 0.6", "end"},
        BadFile{"ZeroHeight", "0.235", "0", "playback_obstacle_height"},
        BadFile{"TwoCoordinates", "[0.1, ", "[", "position"},
        BadFile{"NoUnitQuaternion", "orientation: [0.9", "orientation: [0.2", "unit quaternion"},
        BadFile{"TooFewAngles", "q: [-1.4, ", "q: [", "posture"},
        BadFile{"UnknownJoint", "LElbj", "LElbow", "joint_names"},
        BadFile{"NoObstacleContact",
                "{link: \"Lwrist\", surface: \"box\", position: [0.1, 0.3333333333333333, 0], "
                "stability: 0.012345678901234568}",
                "", "obstacle"},
        BadFile{"NotYaml", "states:", "states: [", ""}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(ContactFile, MissingFileIsNamed) {
  try {
    (void)load_contacts(scratch("never_written"));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("never_written"));
  }
}

}  // namespace
}  // namespace clamber
