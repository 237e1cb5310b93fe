#include "sim_backend/scenario.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "sim_fixture.hpp"

namespace clamber {
namespace {

using test::coman;
using test::source;

const char* const kGood = R"(name: box
friction: 0.8
obstacles:
  - name: box
    position: [0.45, 0.0]
    size: [0.9, 1.0, 0.275]
    yaw: 0.1
start:
  position: [-0.13, 0.02]
  yaw: 0.3
goal:
  posture: all_fours
  contacts: [Lwrist, Rwrist]
)";

std::string with(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Scenario, ReadsEveryKey) {
  const Scenario scenario = parse_scenario(kGood, "good.yaml");
  EXPECT_EQ(scenario.name, "box");
  EXPECT_EQ(scenario.friction, 0.8);
  ASSERT_EQ(scenario.obstacles.size(), 1u);
  EXPECT_EQ(scenario.obstacles[0].name, "box");
  EXPECT_TRUE(scenario.obstacles[0].center.isApprox(Eigen::Vector3d(0.45, 0.0, 0.1375)));
  EXPECT_TRUE(scenario.obstacles[0].half_extents.isApprox(Eigen::Vector3d(0.45, 0.5, 0.1375)));
  EXPECT_EQ(scenario.obstacles[0].yaw, 0.1);
  EXPECT_DOUBLE_EQ(scenario.obstacles[0].top(), 0.275);
  EXPECT_TRUE(scenario.start_position.isApprox(Eigen::Vector3d(-0.13, 0.02, 0.0)));
  EXPECT_EQ(scenario.start_yaw, 0.3);
  EXPECT_THAT(scenario.goal_contacts, testing::ElementsAre("Lwrist", "Rwrist"));
  EXPECT_EQ(scenario.hash.size(), 64u);
}

TEST(Scenario, AGoalIsAWordOrAMap) {
  std::string text = kGood;
  const std::size_t from = text.find("goal:"), to = text.find("contacts:");
  const std::size_t end = text.find('\n', to);
  text.replace(from, end - from, "goal: over");
  const Scenario scenario = parse_scenario(text, "over.yaml");
  EXPECT_EQ(scenario.goal, Goal::kOver);
  const RobotModel model = load_robot(source("configs/robots/coman/robot.yaml"));
  EXPECT_THAT(all_fours_contacts(model, scenario),
              testing::UnorderedElementsAre("Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"));
  const Scenario other = with_goal(scenario, Goal::kBackDown);
  EXPECT_EQ(other.goal, Goal::kBackDown);
  EXPECT_NE(other.hash, scenario.hash);
  EXPECT_EQ(with_goal(scenario, Goal::kOver).hash, scenario.hash);
}

TEST(Scenario, ShippedFilesDifferInHeightOnly) {
  for (const double height : {0.20, 0.275, 0.35}) {
    const std::string number = height == 0.275 ? "0.275" : height == 0.20 ? "0.20" : "0.35";
    const Scenario scenario = load_scenario(source("configs/scenarios/box_" + number + ".yaml"));
    ASSERT_EQ(scenario.obstacles.size(), 1u);
    const ObstacleBox& box = scenario.obstacles[0];
    EXPECT_DOUBLE_EQ(box.top(), height);
    EXPECT_DOUBLE_EQ(box.center.x() - box.half_extents.x(), 0.0);
    EXPECT_GE(2.0 * box.half_extents.x(), 0.8);
    EXPECT_DOUBLE_EQ(2.0 * box.half_extents.y(), 1.0);
    EXPECT_EQ(scenario.friction, 0.8);
    EXPECT_EQ(scenario.goal, Goal::kAllFours);
    EXPECT_THAT(scenario.goal_contacts,
                testing::ElementsAre("Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"));
  }
}

struct BadCase {
  const char* from;
  const char* to;
  const char* complaint;
};

class BadScenario : public testing::TestWithParam<BadCase> {};

TEST_P(BadScenario, IsRefusedWithFileLineAndKey) {
  const BadCase& bad = GetParam();
  try {
    static_cast<void>(parse_scenario(with(bad.from, bad.to), "bad.yaml"));
    FAIL() << "accepted: " << bad.to;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::ContainsRegex("^bad.yaml:[0-9]+: "));
    EXPECT_THAT(error.what(), testing::HasSubstr(bad.complaint));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadScenario,
    testing::Values(
        BadCase{"friction: 0.8", "friction: 0", "friction"},
        BadCase{"friction: 0.8", "friction: -1", "friction"},
        BadCase{"friction: 0.8", "friction: .nan", "friction"},
        BadCase{"friction: 0.8", "friction: slippery", "friction"},
        BadCase{"friction: 0.8\n", "", "friction"},
        BadCase{"friction: 0.8", "friction: 0.8\nfriction: 0.9", "friction"},
        BadCase{"friction: 0.8", "fricton: 0.8", "fricton"},
        BadCase{"size: [0.9, 1.0, 0.275]", "size: [0.9, 0, 0.275]", "size"},
        BadCase{"size: [0.9, 1.0, 0.275]", "size: [0.9, 1.0, -0.275]", "size"},
        BadCase{"size: [0.9, 1.0, 0.275]", "size: [0.9, 1.0]", "size"},
        BadCase{"size: [0.9, 1.0, 0.275]", "size: [0.9, 1.0, .inf]", "size"},
        BadCase{"size: [0.9, 1.0, 0.275]", "size: big", "size"},
        BadCase{"position: [0.45, 0.0]", "position: [0.45, .nan]", "position"},
        BadCase{"  - name: box", "  - name: floor", "name"},
        BadCase{"  - name: box\n    position: [0.45, 0.0]\n    size: [0.9, 1.0, 0.275]\n"
                "    yaw: 0.1\n",
                "  []\n", "obstacles"},
        BadCase{"    yaw: 0.1", "    yaw: 0.1\n    colour: red", "colour"},
        BadCase{"    yaw: 0.1", "    yaw: 0.1\n  - {name: box, position: [2, 0], size: [1, 1, 1]}",
                "name"},
        BadCase{"  yaw: 0.3", "  yaw: [0.3]", "start.yaw"},
        BadCase{"posture: all_fours", "posture: handstand", "goal.posture"},
        BadCase{"contacts: [Lwrist, Rwrist]", "contacts: []", "goal.contacts"},
        BadCase{"contacts: [Lwrist, Rwrist]", "contacts: [Lwrist, Lwrist]", "goal.contacts"},
        BadCase{"goal:\n", "goals:\n", "goals"}, BadCase{"obstacles:\n", "obstacles: [\n", ""}));

TEST(Scenario, MissingFileIsNamed) {
  try {
    static_cast<void>(load_scenario("no/such/scenario.yaml"));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("no/such/scenario.yaml"));
  }
}

TEST(Scenario, HeightOverrideChangesTheFirstObstacleAndItsIdentity) {
  const Scenario scenario = parse_scenario(kGood, "good.yaml");
  const Scenario high = with_height(scenario, 0.35);
  EXPECT_DOUBLE_EQ(high.obstacles[0].top(), 0.35);
  EXPECT_DOUBLE_EQ(high.obstacles[0].center.z(), 0.175);
  EXPECT_NE(high.hash, scenario.hash);
  EXPECT_NE(high.name, scenario.name);
  EXPECT_EQ(with_height(scenario, 0.35).hash, high.hash);
  EXPECT_THROW(static_cast<void>(with_height(scenario, 0.0)), InputError);
  EXPECT_THROW(static_cast<void>(with_height(scenario, std::numeric_limits<double>::quiet_NaN())),
               InputError);
}

TEST(StartConfiguration, SolesAreFlatOnTheFloorAtTheStartPose) {
  const RobotModel model = coman();
  Scenario scenario = parse_scenario(kGood, "good.yaml");
  const Configuration x = start_configuration(model, scenario);
  RobotData data;
  forward_kinematics(model, x, data);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  int corners = 0;
  for (const ContactLink& contact : model.contacts) {
    if (!contact.is_patch) {
      continue;
    }
    const Pose& X_WB = data.X_WB[static_cast<std::size_t>(contact.body)];
    EXPECT_NEAR(std::atan2(X_WB.R(1, 0), X_WB.R(0, 0)), scenario.start_yaw, 1e-6);
    for (const Eigen::Vector3d& point : contact.points) {
      EXPECT_NEAR((X_WB * point).z(), 0.0, 1e-9);
      middle += X_WB * point;
      ++corners;
    }
  }
  ASSERT_EQ(corners, 8);
  EXPECT_TRUE((middle / corners).isApprox(scenario.start_position, 1e-9));
  EXPECT_TRUE(x.q.isApprox(model.home));
}

TEST(StartConfiguration, ToesStandAFewCentimetresBeforeTheBox) {
  const RobotModel model = coman();
  const Configuration x = start_configuration(model, test::box_scenario());
  RobotData data;
  forward_kinematics(model, x, data);
  double toe = -1.0;
  for (const ContactLink& contact : model.contacts) {
    if (contact.is_patch) {
      for (const Eigen::Vector3d& point : contact.points) {
        toe = std::max(toe, (data.X_WB[static_cast<std::size_t>(contact.body)] * point).x());
      }
    }
  }
  EXPECT_LT(toe, -0.02);
  EXPECT_GT(toe, -0.05);
}

TEST(StartConfiguration, UnevenSolesAreRefused) {
  RobotModel model = coman();
  model.home[*model.find_joint("LAnkSag")] += 0.2;
  EXPECT_THROW(static_cast<void>(start_configuration(model, test::box_scenario())), InputError);
}

}  // namespace
}  // namespace clamber
