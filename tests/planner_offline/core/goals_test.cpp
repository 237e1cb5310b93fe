// What follows the climb: the contact graph, the way back, standing up on top.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "planner_offline/planner.hpp"
#include "planner_offline/search/graph_search.hpp"
#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;
using testing::IsEmpty;

ContactSet holding_links(const std::vector<std::string>& names) {
  const RobotData data = data_at(standing());
  ContactSet contacts;
  for (const std::string& name : names) {
    contacts.push_back(make_contact(coman(), box(), data, link_of(name), 0));
  }
  return contacts;
}

std::vector<Touch> touching_links(const std::vector<std::string>& names) {
  std::vector<Touch> touches;
  for (const std::string& name : names) {
    touches.push_back({link_of(name), 0, {}, 0.0});
  }
  return touches;
}

/// "-lifted+touched" per change.
std::vector<std::string> words(const std::vector<ContactChange>& changes) {
  std::vector<std::string> words;
  for (const ContactChange& change : changes) {
    std::string word;
    for (const int link : change.lifts) word += "-" + coman().contacts[std::size_t(link)].name;
    for (const Touch& t : change.touches) word += "+" + coman().contacts[std::size_t(t.link)].name;
    words.push_back(word);
  }
  return words;
}

const std::vector<std::string> kAllFours = {"Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"};

TEST(ContactGraph, LightensLimbsBeforeItTakesThemOff) {
  EXPECT_THAT(
      words(changes_towards(coman(), holding_links(kAllFours), touching_links({"Lfoot", "Rfoot"}))),
      ElementsAre("-Lelb-Relb", "-Lknee+Lfoot", "-Rknee+Rfoot"));
  EXPECT_THAT(words(changes_towards(coman(), holding_links({"Lwrist", "Rwrist", "Lfoot", "Rfoot"}),
                                    touching_links({"Lfoot", "Rfoot"}))),
              ElementsAre("-Lwrist-Rwrist"));
}

TEST(ContactGraph, MakesOuterContactsFirstAndExchangesLegsOneByOne) {
  EXPECT_THAT(
      words(changes_towards(coman(), holding_links({"Lfoot", "Rfoot"}), touching_links(kAllFours))),
      ElementsAre("+Lwrist+Rwrist", "-Lfoot+Lknee", "-Rfoot+Rknee"));
  EXPECT_THAT(words(changes_towards(coman(), holding_links(kAllFours), touching_links(kAllFours))),
              IsEmpty());
}

TEST(Stretches, TheWayBackEndsWhereTheWayBegan) {
  const ContactSet both = holding_links({"Lfoot", "Rfoot"}), left = holding_links({"Lfoot"});
  Configuration there = standing();
  there.X_WB.p.x() += 0.1;
  const std::vector<Stretch> way = {
      {"go", Stretch::Kind::kMotion, {standing(), there}, both, {}, {}},
      {"unload", Stretch::Kind::kLoad, {there}, both, left, {}}};
  const std::vector<Stretch> back = reversed(way);
  ASSERT_EQ(back.size(), 2u);
  EXPECT_EQ(back[0].contacts.size(), 1u);
  EXPECT_EQ(back[0].next_contacts.size(), 2u);
  EXPECT_EQ(carrying(back[0]).size(), 1u);
  EXPECT_EQ(back[1].path.back().X_WB.p, standing().X_WB.p);
}

TEST(Stretches, MovedMovesPosturesAndSoles) {
  Pose X;
  X.R = Eigen::AngleAxisd(1.0, Vector3d::UnitZ()).toRotationMatrix();
  X.p = {0.3, -0.2, 0.0};
  const std::vector<Stretch> there =
      moved({{"go", Stretch::Kind::kMotion, {standing()}, feet(box(), standing()), {}, {}}}, X);
  const RobotData before = data_at(standing()), after = data_at(there[0].path[0]);
  for (const Contact& foot : there[0].contacts) {
    EXPECT_TRUE(touch_point(coman(), after, foot.link)
                    .isApprox(X * touch_point(coman(), before, foot.link), 1e-12));
    const auto body = std::size_t(coman().contacts[std::size_t(foot.link)].body);
    EXPECT_TRUE(foot.anchor.p.isApprox(after.X_WB[body].p, 1e-12));
  }
}

TEST(SolePose, LiesLevelWhereItIsAsked) {
  Touch touch{link_of("Rfoot"), 0, Vector3d(0.3, -0.1, 0.275), 0.4};
  const Pose pose = sole_pose(coman(), touch);
  Vector3d centre = Vector3d::Zero();
  for (const Vector3d& corner : coman().contacts[std::size_t(touch.link)].points) {
    EXPECT_NEAR((pose * corner).z(), 0.275, 1e-9);
    centre += pose * corner / 4.0;
  }
  EXPECT_LT((centre - *touch.position).norm(), 1e-9);
}

TEST(Goals, TheRobotStandsUpOnTop) {
  PlannerSettings settings;
  settings.search.steady_margin = -1.0;
  const Scenario scenario = with_goal(box(), Goal::kStandOnTop);
  const PlanningResult result =
      plan_climb(coman(), scenario, made_climb(), settings, [](double, const std::string&) {});
  const Keyframe& last = result.plan.keyframes.back();
  ASSERT_EQ(last.contacts.size(), 2u);
  const RobotData data = data_at(last.x);
  for (const PlannedContact& contact : last.contacts) {
    EXPECT_EQ(contact.surface, scenario.obstacles.front().name);
    const ContactLink& link = coman().contacts[std::size_t(link_of(contact.link))];
    EXPECT_TRUE(link.is_patch);
    for (const Vector3d& corner : link.points) {
      const Vector3d at = data.X_WB[std::size_t(link.body)] * corner;
      EXPECT_NEAR(at.z(), scenario.obstacles.front().top(), 1e-3);
      EXPECT_GT(at.x(), 0.02);  // the front face is at 0
    }
  }
  // Upright: the torso is as high above the soles as it was at the start, within a bend of the
  // knees.
  const double begun = standing(scenario).X_WB.p.z();
  EXPECT_GT(last.x.X_WB.p.z() - scenario.obstacles.front().top(), begun - 0.12);
  EXPECT_GT(last.x.X_WB.R(2, 2), 0.7);
  for (const Keyframe& keyframe : result.plan.keyframes) {
    EXPECT_GT(keyframe.support_margin, 0.0) << keyframe.time;
    EXPECT_GE(keyframe.torque_margin, 0.0) << keyframe.time;
  }
}

TEST(Goals, ATopWithoutRoomForSolesIsRefusedWithTheReason) {
  Scenario scenario = with_goal(box(), Goal::kStandOnTop);
  PlannerSettings settings;
  settings.search.steady_margin = -1.0;
  settings.search.most_seeds = 1;
  settings.references.surface_margin = 0.06;  // soles need more room than knees and wrists
  scenario.obstacles.front().half_extents.x() = 0.3;
  scenario.obstacles.front().center.x() = 0.3;
  settings.search.touch_samples = 0;
  try {
    (void)plan_climb(coman(), scenario, made_climb(), settings, [](double, const std::string&) {});
    FAIL() << "expected no plan";
  } catch (const PlanningFailed& failed) {
    EXPECT_THAT(failed.what(), testing::HasSubstr("stand_on_top"));
  }
}

}  // namespace
}  // namespace clamber
