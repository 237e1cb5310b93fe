#include "sim_backend/judge.hpp"

#include <gmock/gmock.h>

#include "sim_fixture.hpp"

namespace clamber {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class Judge : public testing::Test {
 protected:
  const RobotModel model = test::coman();
  Scenario scenario = test::box_scenario();
  const double weight = model.total_mass * kGravity;
  VelocityVector rest = VelocityVector::Zero(model.velocity_count());

  ContactObservation on_box(const std::string& geom, double force) const {
    ContactObservation contact;
    contact.geom = *model.find_geom(geom);
    contact.surface = Surface::kObstacle;
    contact.position = {0.2, 0.0, scenario.obstacles[0].top() - 3e-4};
    contact.force = {0.0, 0.0, force};
    return contact;
  }
  ContactObservation on_floor(const std::string& geom, double force) const {
    ContactObservation contact = on_box(geom, force);
    contact.surface = Surface::kFloor;
    contact.position.z() = 0.0;
    return contact;
  }
  std::vector<ContactObservation> all_fours() const {
    std::vector<ContactObservation> contacts;
    for (const std::string& name : scenario.goal_contacts) {
      const ContactLink& link = model.contacts[static_cast<std::size_t>(*model.find_contact(name))];
      contacts.push_back(on_box(model.geoms[static_cast<std::size_t>(link.geom)].name,
                                weight / static_cast<double>(scenario.goal_contacts.size())));
    }
    return contacts;
  }
  ClimbVerdict judge(const std::vector<ContactObservation>& contacts, double seconds = 3.0) const {
    ClimbJudge judge(model, scenario);
    for (int k = 0; k <= static_cast<int>(seconds * 200); ++k) {
      judge.push(0.005 * k, contacts, rest);
    }
    return judge.verdict();
  }
};

TEST_F(Judge, AllFoursOnTopSucceeds) {
  const ClimbVerdict verdict = judge(all_fours());
  EXPECT_TRUE(verdict.success);
  EXPECT_THAT(verdict.final_contacts,
              UnorderedElementsAre("Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"));
  EXPECT_THAT(verdict.missing_contacts, IsEmpty());
  EXPECT_NEAR(verdict.weight_on_obstacle, 1.0, 1e-9);
  EXPECT_EQ(verdict.rest_speed, 0.0);
  EXPECT_NEAR(verdict.observed, 2.0, 1e-9);
}

TEST_F(Judge, StandingOnTopIsOnSolesAlone) {
  scenario.goal = Goal::kStandOnTop;
  const std::vector<ContactObservation> soles = {on_box("l_sole", 0.5 * weight),
                                                 on_box("r_sole", 0.5 * weight)};
  EXPECT_TRUE(judge(soles).success);
  EXPECT_FALSE(judge(all_fours()).success);
  std::vector<ContactObservation> leaning = soles;
  leaning.push_back(on_box("l_wrist", 5.0));
  EXPECT_THAT(judge(leaning).unwanted_contacts, testing::SizeIs(1));
  EXPECT_FALSE(judge(leaning).success);
  EXPECT_FALSE(judge({soles.front()}).success);
}

TEST_F(Judge, OverAndBackDownAreOnTheirSideAfterHavingBeenOnTop) {
  const auto standing_at = [this](double x) {
    std::vector<ContactObservation> soles = {on_floor("l_sole", 0.5 * weight),
                                             on_floor("r_sole", 0.5 * weight)};
    for (ContactObservation& contact : soles) contact.position.x() = x;
    return soles;
  };
  const auto run = [this](const std::vector<ContactObservation>& first,
                          const std::vector<ContactObservation>& then) {
    ClimbJudge judge(model, scenario);
    for (int k = 0; k < 200; ++k) judge.push(0.005 * k, first, rest);
    for (int k = 200; k < 800; ++k) judge.push(0.005 * k, then, rest);
    return judge.verdict();
  };
  const double far = 2.0 * scenario.obstacles[0].half_extents.x() + 0.2, near = -0.2;
  scenario.goal = Goal::kOver;
  EXPECT_TRUE(run(all_fours(), standing_at(far)).success);
  EXPECT_FALSE(run(all_fours(), standing_at(near)).success);
  EXPECT_FALSE(run(standing_at(near), standing_at(far)).success) << "walked around it";
  EXPECT_FALSE(run(all_fours(), all_fours()).success);
  std::vector<ContactObservation> touching = standing_at(far);
  touching.push_back(on_box("l_wrist", 5.0));
  EXPECT_FALSE(run(all_fours(), touching).success);
  scenario.goal = Goal::kBackDown;
  EXPECT_TRUE(run(all_fours(), standing_at(near)).success);
  EXPECT_FALSE(run(all_fours(), standing_at(far)).success);
}

TEST_F(Judge, BellyFlopFails) {
  const ClimbVerdict verdict =
      judge({on_box("torso", 0.7 * weight), on_box("pelvis", 0.3 * weight)});
  EXPECT_FALSE(verdict.success);
  EXPECT_THAT(verdict.forbidden_contacts, UnorderedElementsAre("DWYTorso", "Waist"));
  EXPECT_THAT(verdict.final_contacts, IsEmpty());
  EXPECT_EQ(verdict.missing_contacts.size(), scenario.goal_contacts.size());
}

TEST_F(Judge, TorsoMayNotHelpAllFours) {
  std::vector<ContactObservation> contacts = all_fours();
  contacts.push_back(on_box("torso", 3.0));
  const ClimbVerdict verdict = judge(contacts);
  EXPECT_FALSE(verdict.success);
  EXPECT_THAT(verdict.forbidden_contacts, ElementsAre("DWYTorso"));
}

TEST_F(Judge, AToeOnTheFloorFails) {
  std::vector<ContactObservation> contacts = all_fours();
  contacts.push_back(on_floor("r_sole", 5.0));
  const ClimbVerdict verdict = judge(contacts);
  EXPECT_FALSE(verdict.success);
  EXPECT_THAT(verdict.floor_contacts, ElementsAre("RFoot"));
}

TEST_F(Judge, AMissingKneeFails) {
  std::vector<ContactObservation> contacts = all_fours();
  contacts.pop_back();
  contacts[0].force.z() *= 2.0;
  const ClimbVerdict verdict = judge(contacts);
  EXPECT_FALSE(verdict.success);
  EXPECT_THAT(verdict.missing_contacts, ElementsAre("Rknee"));
}

TEST_F(Judge, AnUnloadedKneeFails) {
  std::vector<ContactObservation> contacts = all_fours();
  contacts.back().force.z() = 0.5;
  contacts[0].force.z() *= 2.0;
  EXPECT_THAT(judge(contacts).missing_contacts, ElementsAre("Rknee"));
  EXPECT_FALSE(judge(contacts).success);
}

TEST_F(Judge, LeaningOnTheFrontFaceFails) {
  std::vector<ContactObservation> contacts = all_fours();
  ContactObservation side = on_box("l_shank", 10.0);
  side.position = {0.0, 0.1, 0.15};
  side.normal = {-1.0, 0.0, 0.0};
  side.force = {-10.0, 0.0, 0.0};
  contacts.push_back(side);
  const ClimbVerdict verdict = judge(contacts);
  EXPECT_FALSE(verdict.success);
  EXPECT_THAT(verdict.side_contacts, ElementsAre("LLowLeg"));
}

TEST_F(Judge, AnEdgeWithATiltedNormalIsNoTopFace) {
  std::vector<ContactObservation> contacts = all_fours();
  contacts.back().normal = Eigen::Vector3d(-1.0, 0.0, 1.0).normalized();
  contacts.back().force = contacts.back().force.z() * contacts.back().normal;
  const ClimbVerdict verdict = judge(contacts);
  EXPECT_FALSE(verdict.success);
  EXPECT_THAT(verdict.side_contacts, ElementsAre("RLowLeg"));
}

TEST_F(Judge, WeightElsewhereFails) {
  std::vector<ContactObservation> contacts = all_fours();
  for (ContactObservation& contact : contacts) {
    contact.force *= 0.9;
  }
  const ClimbVerdict verdict = judge(contacts);
  EXPECT_FALSE(verdict.success);
  EXPECT_NEAR(verdict.weight_on_obstacle, 0.9, 1e-9);
}

TEST_F(Judge, OneFastMomentInTheWindowFails) {
  ClimbJudge judge(model, scenario);
  for (int k = 0; k <= 1000; ++k) {
    VelocityVector velocity = rest;
    if (k == 700) {  // 1.5 s before the end
      velocity[6 + 3] = -0.3;
    }
    judge.push(0.005 * k, all_fours(), velocity);
  }
  EXPECT_DOUBLE_EQ(judge.verdict().rest_speed, 0.3);
  EXPECT_FALSE(judge.verdict().success);
}

TEST_F(Judge, WhatHappenedBeforeTheWindowDoesNotCount) {
  ClimbJudge judge(model, scenario);
  VelocityVector fast = rest;
  fast[0] = 1.0;
  judge.push(0.0, {}, fast);
  for (int k = 0; k <= 500; ++k) {
    judge.push(1.0 + 0.005 * k, all_fours(), rest);
  }
  EXPECT_TRUE(judge.verdict().success);
}

TEST_F(Judge, TooShortALookIsNoSuccess) {
  const ClimbVerdict verdict = judge(all_fours(), 1.5);
  EXPECT_FALSE(verdict.success);
  EXPECT_NEAR(verdict.observed, 1.5, 1e-9);
  EXPECT_FALSE(ClimbJudge(model, scenario).verdict().success);
}

TEST_F(Judge, AFootOnTopInsteadOfTheKneesFails) {
  std::vector<ContactObservation> contacts = all_fours();
  contacts[4] = on_box("l_sole", weight / 6.0);
  contacts[5] = on_box("r_sole", weight / 6.0);
  const ClimbVerdict verdict = judge(contacts);
  EXPECT_FALSE(verdict.success);
  EXPECT_THAT(verdict.missing_contacts, ElementsAre("Lknee", "Rknee"));
}

TEST_F(Judge, AMomentaryTouchOfTheFloorFails) {
  ClimbJudge judge(model, scenario);
  std::vector<ContactObservation> touching = all_fours();
  touching.push_back(on_floor("r_sole", 20.0));
  for (int k = 0; k <= 500; ++k) {
    judge.push(0.005 * k, k == 400 ? touching : all_fours(), rest);
  }
  EXPECT_FALSE(judge.verdict().success);
}

TEST_F(Judge, UnknownGoalContactIsRefused) {
  Scenario wrong = scenario;
  wrong.goal_contacts.push_back("Ltail");
  EXPECT_THROW(ClimbJudge(model, wrong), InputError);
}

}  // namespace
}  // namespace clamber
