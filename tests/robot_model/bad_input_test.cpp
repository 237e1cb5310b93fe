// Every unusable robot description is refused with a message that names file and element.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <ostream>
#include <string>
#include <vector>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

// A small robot that loads: base, leg (a box for a sole), arm (a sphere for a hand) and a capsule.
const char* const kUrdf = R"(<?xml version="1.0"?>
<robot name="mini">
  <link name="base">
    <inertial><origin xyz="0 0 0"/><mass value="3"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <collision name="body_box"><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
  </link>
  <joint name="hip" type="revolute">
    <parent link="base"/><child link="leg"/><origin xyz="0 0 -0.1"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="50" velocity="4"/>
  </joint>
  <link name="leg">
    <inertial><mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision name="shin"><origin xyz="0 0 -0.2"/><geometry><cylinder radius="0.03" length="0.1"/></geometry></collision>
    <collision name="shin_a"><origin xyz="0 0 -0.15"/><geometry><sphere radius="0.03"/></geometry></collision>
    <collision name="shin_b"><origin xyz="0 0 -0.25"/><geometry><sphere radius="0.03"/></geometry></collision>
  </link>
  <joint name="ankle" type="continuous">
    <parent link="leg"/><child link="foot"/><origin xyz="0 0 -0.3"/><axis xyz="0 1 0"/>
    <limit effort="50" velocity="4"/>
  </joint>
  <link name="foot">
    <inertial><mass value="0.5"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision name="sole"><geometry><box size="0.2 0.1 0.04"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="50" velocity="4"/>
  </joint>
  <link name="arm">
    <inertial><mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision name="hand"><origin xyz="0 0.3 0"/><geometry><sphere radius="0.03"/></geometry></collision>
  </link>
</robot>
)";

const char* const kYaml = R"(name: mini
urdf: mini.urdf
joint_order: [hip, ankle, shoulder]
drives:
  default: {torque_limit: 30, reflected_inertia: 0.1, kp: 100, ki: 0, kd: 1}
contacts:
  - {name: Hand, limb: arm, geom: hand, support: arm}
  - {name: Foot, limb: leg, geom: sole, support: leg}
self_collision:
  - {group: hand on leg, each_of: [hand], with_each_of: [shin, sole]}
planner_collision:
  - {group: hand and foot, pairs: [[hand, sole]]}
forbidden_links: [base]
home: {hip: 0.3}
ballast:
  - {link: base, mass: 1.5}
)";

struct Case {
  std::string name;
  bool in_urdf;
  std::string from;  ///< replaced by `to`, first occurrence
  std::string to;
  std::vector<std::string> expected;  ///< all of them must be in the message
};

void PrintTo(const Case& bad, std::ostream* stream) { *stream << bad.name; }

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto position = text.find(from);
  EXPECT_NE(position, std::string::npos) << "the case edits nothing: " << from;
  return position == std::string::npos ? text : text.replace(position, from.size(), to);
}

class RobotFiles {
 public:
  RobotFiles() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    std::string folder = std::string("clamber_") + test->test_suite_name() + test->name();
    std::replace(folder.begin(), folder.end(), '/', '_');
    folder_ = std::filesystem::path(testing::TempDir()) / folder;
    std::filesystem::create_directories(folder_);
    write_urdf(kUrdf);
    write_yaml(kYaml);
  }
  ~RobotFiles() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  RobotFiles(const RobotFiles&) = delete;
  RobotFiles& operator=(const RobotFiles&) = delete;

  void write_urdf(const std::string& text) { std::ofstream(folder_ / "mini.urdf") << text; }
  void write_yaml(const std::string& text) { std::ofstream(yaml()) << text; }
  [[nodiscard]] std::filesystem::path yaml() const { return folder_ / "robot.yaml"; }
  [[nodiscard]] std::filesystem::path folder() const { return folder_; }

  [[nodiscard]] std::string error(const LoadOptions& options = {}) const {
    try {
      (void)load_robot(yaml(), options);
    } catch (const InputError& error) {
      return error.what();
    }
    return "loaded without an error";
  }

 private:
  std::filesystem::path folder_;
};

class BadRobot : public testing::TestWithParam<Case> {};

TEST_P(BadRobot, IsRefusedByName) {
  const Case& bad = GetParam();
  RobotFiles files;
  if (bad.in_urdf) {
    files.write_urdf(replaced(kUrdf, bad.from, bad.to));
  } else {
    files.write_yaml(replaced(kYaml, bad.from, bad.to));
  }
  const std::string message = files.error();
  EXPECT_THAT(message, testing::HasSubstr(bad.in_urdf ? "mini.urdf" : "robot.yaml"));
  for (const std::string& expected : bad.expected) {
    EXPECT_THAT(message, testing::HasSubstr(expected));
  }
  EXPECT_EQ(message.find('\n'), std::string::npos) << "one line, please: " << message;
  RecordProperty("message", message.substr(message.rfind('/') + 1));
}

const char* const kHipLimit = R"(<limit lower="-1" upper="1" effort="50" velocity="4"/>)";

const std::vector<Case> kUrdfCases = {
    {"BadXml", true, "</robot>", "", {"mini.urdf:", "not a usable URDF: bad XML"}},
    {"NoRobot", true, "<robot name=\"mini\">", "<robot>", {"not a usable URDF", "name"}},
    {"TwoRoots", true, "</robot>", "<link name=\"stray\"/></robot>", {"not a usable URDF", "root"}},
    {"TwoParents",
     true,
     "<parent link=\"leg\"/><child link=\"foot\"/>",
     "<parent link=\"leg\"/><child link=\"arm\"/>",
     {"link 'arm'", "'ankle'", "'shoulder'", "tree"}},
    {"Cycle",
     true,
     "</robot>",
     "<link name=\"p\"/><link name=\"q\"/>"
     "<joint name=\"pq\" type=\"fixed\"><parent link=\"p\"/><child link=\"q\"/></joint>"
     "<joint name=\"qp\" type=\"fixed\"><parent link=\"q\"/><child link=\"p\"/></joint></robot>",
     {"link 'p'", "cycle", "tree"}},
    {"RootInACycle",
     true,
     "</robot>",
     "<joint name=\"back\" type=\"fixed\"><parent link=\"arm\"/><child link=\"base\"/></joint>"
     "</robot>",
     {"link 'arm'", "cycle", "tree"}},
    {"UnknownParent",
     true,
     "<parent link=\"leg\"/>",
     "<parent link=\"log\"/>",
     {"not a usable URDF", "log"}},
    {"PrismaticJoint",
     true,
     "name=\"hip\" type=\"revolute\"",
     "name=\"hip\" type=\"prismatic\"",
     {"joint 'hip'", "revolute"}},
    {"PlanarJoint",
     true,
     "name=\"ankle\" type=\"continuous\"",
     "name=\"ankle\" type=\"planar\"",
     {"joint 'ankle'", "revolute"}},
    {"UnknownJointType", true, "type=\"continuous\"", "type=\"ball\"", {"ankle"}},
    {"MimicJoint",
     true,
     kHipLimit,
     std::string(kHipLimit) + "<mimic joint=\"ankle\"/>",
     {"joint 'hip'", "mimics"}},
    {"ZeroAxis", true, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>", {"joint 'hip'", "axis"}},
    {"MissingLimits", true, kHipLimit, "", {"hip", "limits"}},
    {"MissingLimitsOfContinuous",
     true,
     "<limit effort=\"50\" velocity=\"4\"/>",
     "",
     {"joint 'ankle'", "limit"}},
    {"CrossedLimits",
     true,
     kHipLimit,
     R"(<limit lower="1" upper="-1" effort="50" velocity="4"/>)",
     {"joint 'hip'", "lower limit"}},
    {"NoEffort",
     true,
     kHipLimit,
     R"(<limit lower="-1" upper="1" effort="0" velocity="4"/>)",
     {"joint 'hip'", "effort"}},
    {"NegativeDamping",
     true,
     kHipLimit,
     std::string(kHipLimit) + "<dynamics damping=\"-1\"/>",
     {"joint 'hip'", "damping"}},
    {"NanLimit",
     true,
     kHipLimit,
     R"(<limit lower="nan" upper="1" effort="50" velocity="4"/>)",
     {"hip"}},
    {"NanOrigin", true, "xyz=\"0 0 -0.1\"", "xyz=\"0 nan -0.1\"", {"hip"}},
    {"InfiniteMass", true, "<mass value=\"1\"/>", "<mass value=\"inf\"/>", {"leg"}},
    {"ZeroMass", true, "<mass value=\"1\"/>", "<mass value=\"0\"/>", {"link 'leg'", "mass"}},
    {"NegativeMass", true, "<mass value=\"1\"/>", "<mass value=\"-1\"/>", {"link 'leg'", "mass"}},
    {"MovingBodyWithoutMass",
     true,
     "<inertial><mass value=\"0.5\"/>\n      <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" "
     "iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial>",
     "",
     {"body 'foot'", "mass"}},
    {"InertiaNotPositive",
     true,
     "ixx=\"0.01\" ixy=\"0\"",
     "ixx=\"0.01\" ixy=\"0.02\"",
     {"link 'leg'", "positive definite"}},
    {"MeshCollision",
     true,
     "<sphere radius=\"0.03\"/></geometry></collision>\n  </link>\n</robot>",
     "<mesh filename=\"hand.stl\"/></geometry></collision>\n  </link>\n</robot>",
     {"link 'arm'", "'hand'", "mesh"}},
    {"BareCylinder",
     true,
     "<origin xyz=\"0 0 -0.25\"/>",
     "<origin xyz=\"0 0 -0.26\"/>",
     {"link 'leg'", "'shin'", "cylinder"}},
    {"CapsOfAnotherRadius",
     true,
     "<sphere radius=\"0.03\"/>",
     "<sphere radius=\"0.031\"/>",
     {"'shin'", "cylinder"}},
    {"NegativeRadius",
     true,
     "<origin xyz=\"0 0.3 0\"/><geometry><sphere radius=\"0.03\"/>",
     "<origin xyz=\"0 0.3 0\"/><geometry><sphere radius=\"-0.03\"/>",
     {"'hand'", "radius"}},
    {"FlatBox",
     true,
     "<box size=\"0.2 0.1 0.04\"/>",
     "<box size=\"0.2 0.1 0\"/>",
     {"'sole'", "box size"}},
    {"RepeatedCollisionName", true, "name=\"hand\"", "name=\"sole\"", {"link 'arm'", "'sole'"}},
    {"RepeatedLink", true, "<link name=\"foot\">", "<link name=\"leg\">", {"leg"}},
};

const std::vector<Case> kYamlCases = {
    {"BadYaml", false, "[hip, ankle, shoulder]", "[hip, ankle", {":4:", "not valid YAML"}},
    {"MissingKey", false, "home: {hip: 0.3}\n", "", {"missing key 'home'"}},
    {"UnknownKey", false, "ballast:", "balast:", {":16:", "balast", "unknown key"}},
    {"UnknownDriveKey", false, "kd: 1}", "kdd: 1}", {":5:", "drives.default.kdd", "unknown key"}},
    {"MissingGain", false, ", kd: 1}", "}", {"drives.default", "missing key 'kd'"}},
    {"NanGain", false, "kp: 100", "kp: .nan", {":5:", "drives.default.kp", "finite"}},
    {"WordForNumber", false, "kp: 100", "kp: stiff", {"drives.default.kp", "'stiff'"}},
    {"NegativeInertia",
     false,
     "reflected_inertia: 0.1",
     "reflected_inertia: -0.1",
     {"reflected_inertia", ">= 0"}},
    {"TorqueAboveTheDrives",
     false,
     "torque_limit: 30",
     "torque_limit: 60",
     {"'hip'", "torque_limit"}},
    {"UnknownJointInOrder", false, "[hip, ankle", "[hip, ankel", {":3:", "ankel"}},
    {"JointMissingFromOrder", false, ", ankle, shoulder", ", shoulder", {":3:", "'ankle'"}},
    {"JointTwiceInOrder", false, "[hip, ankle", "[hip, hip", {":3:", "'hip'", "twice"}},
    {"ChildBeforeParent", false, "[hip, ankle", "[ankle, hip", {":3:", "'ankle'", "parents first"}},
    {"ContactWithoutGeom", false, "geom: sole", "geom: heel", {":8:", "'heel'"}},
    {"ContactOnACapsule", false, "geom: sole", "geom: shin", {":8:", "capsule"}},
    {"ContactTwice", false, "name: Foot", "name: Hand", {":8:", "'Hand'", "twice"}},
    {"UnknownSupport", false, "support: leg", "support: hip_bone", {":8:", "'hip_bone'"}},
    {"SupportOfAnotherLimb", false, "support: leg", "support: arm", {":8:", "'arm'", "carry"}},
    {"PairOfNeighbours",
     false,
     "with_each_of: [shin, sole]",
     "with_each_of: [body_box]",
     {":10:", "neighbouring"}},
    {"PairTwice", false, "[shin, sole]}", "[shin, shin]}", {":10:", "twice"}},
    {"PairOfThree", false, "[[hand, sole]]", "[[hand, sole, shin]]", {":12:", "two"}},
    {"UnknownPair", false, "[[hand, sole]]", "[[hand, toe]]", {":12:", "'toe'"}},
    {"UnknownForbiddenLink",
     false,
     "forbidden_links: [base]",
     "forbidden_links: [belly]",
     {":13:", "'belly'"}},
    {"UnknownHomeJoint", false, "home: {hip: 0.3}", "home: {hop: 0.3}", {":14:", "'hop'"}},
    {"HomeOutsideLimits", false, "home: {hip: 0.3}", "home: {hip: 1.3}", {":14:", "'hip'"}},
    {"MissingUrdfKey", false, "urdf: mini.urdf", "model: mini.urdf", {":2:", "model"}},
};

std::string case_name(const testing::TestParamInfo<Case>& info) { return info.param.name; }
INSTANTIATE_TEST_SUITE_P(Urdf, BadRobot, testing::ValuesIn(kUrdfCases), case_name);
INSTANTIATE_TEST_SUITE_P(Yaml, BadRobot, testing::ValuesIn(kYamlCases), case_name);

TEST(RobotFile, TheUntouchedRobotLoads) {
  const RobotFiles files;
  const RobotModel robot = load_robot(files.yaml());
  EXPECT_EQ(robot.joint_count(), 3);
  EXPECT_EQ(robot.collision_pairs.size(), 2U);
}

TEST(RobotFile, MissingFilesAreNamed) {
  const RobotFiles files;
  std::filesystem::remove(files.folder() / "mini.urdf");
  EXPECT_THAT(files.error(), testing::EndsWith("mini.urdf: no such file"));
  std::filesystem::remove(files.yaml());
  EXPECT_THAT(files.error(), testing::EndsWith("robot.yaml: no such file"));
  std::filesystem::create_directory(files.yaml());
  EXPECT_THAT(files.error(), testing::HasSubstr("robot.yaml: is a directory"));
}

TEST(RobotFile, EveryByteOfBothFilesCounts) {
  RobotFiles files;
  const std::string hash = load_robot(files.yaml()).hash;
  files.write_yaml(std::string(kYaml) + "# a remark\n");
  const std::string other_yaml = load_robot(files.yaml()).hash;
  files.write_yaml(kYaml);
  files.write_urdf(std::string(kUrdf) + "\n");
  const std::string other_urdf = load_robot(files.yaml()).hash;
  EXPECT_NE(hash, other_yaml);
  EXPECT_NE(hash, other_urdf);
  EXPECT_NE(other_yaml, other_urdf);
}

TEST(RobotFile, BallastIsChecked) {
  RobotFiles files;
  EXPECT_THAT(files.error({.ballast_scale = -1.0}), testing::HasSubstr("ballast scale"));
  EXPECT_NEAR(load_robot(files.yaml(), {.ballast_scale = 2.0}).total_mass, 8.5, 1e-12);
  files.write_yaml(replaced(kYaml, "{link: base, mass: 1.5}", "{link: bass, mass: 1.5}"));
  EXPECT_THAT(files.error({.ballast_scale = 1.0}), testing::HasSubstr("'bass'"));
  files.write_yaml(replaced(kYaml, "mass: 1.5", "mass: -3.5"));
  EXPECT_THAT(files.error({.ballast_scale = 1.0}), testing::HasSubstr("link 'base'"));
}

TEST(RobotFile, MoreThan32JointsAreRefused) {
  std::string chain;
  for (int i = 0; i < 30; ++i) {
    const std::string n = std::to_string(i);
    chain += "<link name=\"tail" + n +
             "\"><inertial><mass value=\"0.1\"/><inertia ixx=\"1e-3\" ixy=\"0\" ixz=\"0\" "
             "iyy=\"1e-3\" iyz=\"0\" izz=\"1e-3\"/></inertial></link><joint name=\"t" +
             n + "\" type=\"continuous\"><parent link=\"" +
             (i == 0 ? std::string("base") : "tail" + std::to_string(i - 1)) +
             "\"/><child link=\"tail" + n +
             "\"/><axis xyz=\"0 0 1\"/><limit effort=\"50\" velocity=\"1\"/></joint>";
  }
  RobotFiles files;
  files.write_yaml(replaced(kYaml, "joint_order: [hip, ankle, shoulder]\n", ""));
  files.write_urdf(replaced(kUrdf, "</robot>", chain + "</robot>"));
  EXPECT_THAT(files.error(), testing::HasSubstr("33 movable joints: expected at most 32"));
}

}  // namespace
}  // namespace clamber
