// Moves of made-up contact sequences.
#include "planner_offline/search/move.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "planner_offline/planning_failed.hpp"
#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string names(const std::vector<int>& links) {
  std::vector<std::string> list;
  for (const int link : links) {
    list.push_back(coman().contacts[static_cast<std::size_t>(link)].name);
  }
  std::sort(list.begin(), list.end());
  std::string text;
  for (const std::string& name : list) {
    text += (text.empty() ? "" : "+") + name;
  }
  return text;
}

/// "lands" or "lands-lifts" of the moves that a climb cannot do without.
std::vector<std::string> order(const std::vector<Move>& moves) {
  std::vector<std::string> list;
  for (const Move& move : moves) {
    if (!move.optional) {
      list.push_back(names(move.lands) + (move.lifts.empty() ? "" : "-" + names(move.lifts)));
    }
  }
  return list;
}

std::vector<Move> moves_of(const ContactSequence& sequence) {
  std::vector<std::string> notes;
  return plan_moves(coman(), box(), sequence, notes);
}

template <typename Change>
ContactSequence changed(ContactSequence sequence, Change change) {
  for (auto* list : {&sequence.states, &sequence.reduced}) {
    for (ContactState& state : *list) {
      change(state);
    }
  }
  return sequence;
}

ContactSequence without_elbows() {
  return changed(made_climb(), [](ContactState& state) {
    auto& list = state.obstacle;
    list.erase(
        std::remove_if(list.begin(), list.end(),
                       [](const auto& c) { return c.link.find("elb") != std::string::npos; }),
        list.end());
  });
}

template <typename Error>
std::string error_of(const ContactSequence& sequence) {
  try {
    (void)moves_of(sequence);
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(Moves, FollowThePapersOrder) {
  std::vector<std::string> notes;
  const auto moves = plan_moves(coman(), box(), made_climb(), notes);
  EXPECT_THAT(order(moves),
              ElementsAre("Lwrist+Rwrist", "Lelb+Relb", "Lknee-Lfoot", "Rknee-Rfoot"));
  EXPECT_TRUE(notes.empty());
  for (const Move& move : moves) {
    EXPECT_EQ(move.hint.size(), coman().joint_count());
    for (const int link : move.lands) {
      EXPECT_EQ(move.references.count(link), 1U);
    }
  }
}

TEST(Moves, HandsFirstFindSupportNearByAndAreThenSetDownFartherOn) {
  const auto moves = moves_of(made_climb());
  std::vector<std::string> again;
  for (std::size_t i = 0; i < moves.size(); ++i) {
    if (moves[i].optional) {
      EXPECT_GT(i, 0U);
      EXPECT_EQ(moves[i].lands, moves[i].lifts);
      again.push_back(names(moves[i].lands));
    }
  }
  EXPECT_THAT(again, ElementsAre("Lwrist", "Rwrist"));
  EXPECT_EQ(names({moves[0].completes_limb.begin(), moves[0].completes_limb.end()}),
            "Lwrist+Rwrist");
}

TEST(Moves, ReferencesAreTheRecordings) {
  const auto moves = moves_of(made_climb());
  for (const Move& move : moves) {
    for (const auto& [link, reference] : move.references) {
      const std::string name = coman().contacts[static_cast<std::size_t>(link)].name;
      for (const ContactReference& contact : made_climb().reduced.back().obstacle) {
        if (contact.link == name) {
          EXPECT_EQ(reference, contact.position) << name;
        }
      }
    }
  }
}

TEST(Moves, RightKneeFirstStaysFirst) {
  const ContactSequence mirrored = changed(made_climb(), [](ContactState& state) {
    for (ContactReference& contact : state.obstacle) {
      if (contact.link.find("knee") != std::string::npos) {
        contact.link[0] = contact.link[0] == 'L' ? 'R' : 'L';
        contact.position.y() *= -1.0;
      }
    }
  });
  EXPECT_THAT(order(moves_of(mirrored)),
              ElementsAre("Lwrist+Rwrist", "Lelb+Relb", "Rknee-Rfoot", "Lknee-Lfoot"));
}

TEST(Moves, HandsThatTouchOneAfterTheOtherLandOneByOne) {
  ContactSequence sequence = made_climb();
  ContactState early = sequence.states.front();
  early.obstacle = {on_box("Rwrist", 0.52, -0.13)};
  early.start = -2.0;
  early.end = sequence.states.front().start;
  sequence.states.insert(sequence.states.begin(), early);
  const auto list = order(moves_of(sequence));
  ASSERT_GE(list.size(), 2U);
  EXPECT_EQ(list[0], "Rwrist");
  EXPECT_EQ(list[1], "Lwrist");
}

TEST(Moves, ElbowsThatTheRecordingLacksAreAddedAndSaid) {
  std::vector<std::string> notes;
  const auto moves = plan_moves(coman(), box(), without_elbows(), notes);
  EXPECT_THAT(order(moves),
              ElementsAre("Lwrist+Rwrist", "Lelb+Relb", "Lknee-Lfoot", "Rknee-Rfoot"));
  EXPECT_THAT(notes, ElementsAre(HasSubstr("Lelb"), HasSubstr("Relb")));
  for (const Move& move : moves) {
    if (names(move.lands) != "Lelb+Relb") {
      continue;
    }
    for (const std::string side : {"L", "R"}) {
      const int wrist = link_of(side + "wrist"), elbow = link_of(side + "elb");
      const double forearm = coman().contacts[static_cast<std::size_t>(wrist)].support_length -
                             coman().contacts[static_cast<std::size_t>(elbow)].support_length;
      EXPECT_NEAR(moves[0].references.at(wrist).x() - move.references.at(elbow).x(), forearm,
                  1e-12);
      EXPECT_GT(move.references.at(elbow).x(), 0.0);
    }
  }
}

TEST(Moves, FeetOnTheBoxAreLeftOutAndSaid) {
  std::vector<std::string> notes;
  ContactSequence sequence = made_climb();
  sequence.reduced.back().obstacle.push_back(on_box("Lfoot", 0.1, 0.1));
  EXPECT_THAT(order(plan_moves(coman(), box(), sequence, notes)),
              ElementsAre("Lwrist+Rwrist", "Lelb+Relb", "Lknee-Lfoot", "Rknee-Rfoot"));
  EXPECT_THAT(notes, ElementsAre(HasSubstr("Lfoot")));
}

TEST(Moves, AStateThatBringsNoContactAnewAsksForNoMove) {
  ContactSequence sequence = made_climb();
  const auto expected = order(moves_of(sequence));
  ContactState fewer = sequence.reduced[1];
  fewer.obstacle.pop_back();  // given up, and made again in the state after
  sequence.reduced.insert(sequence.reduced.begin() + 2, {fewer, sequence.reduced[1]});
  sequence.reduced.push_back(sequence.reduced.back());
  EXPECT_EQ(order(moves_of(sequence)), expected);
}

TEST(Moves, AStrangersLinkIsAnInputError) {
  ContactSequence stranger = made_climb();
  stranger.reduced[0].obstacle[0].link = "Tail";
  EXPECT_THAT(error_of<InputError>(stranger), HasSubstr("Tail"));
}

TEST(Moves, ADemonstrationThatShowsNoClimbFailsAndSaysWhatItLacks) {
  ContactSequence nothing = made_climb();
  nothing.reduced.clear();
  EXPECT_THAT(error_of<PlanningFailed>(nothing),
              HasSubstr("made up' shows no climb: none of its 4 contact states"));

  const auto only = [](const std::string& part) {
    return changed(made_climb(), [&part](ContactState& state) {
      std::erase_if(state.obstacle,
                    [&part](const auto& c) { return c.link.find(part) == std::string::npos; });
    });
  };
  EXPECT_THAT(error_of<PlanningFailed>(only("knee")),
              testing::AllOf(HasSubstr("the goal asks for Lwrist, Rwrist, Lelb, Relb, and in none"),
                             HasSubstr("(only Lknee, Rknee)")));
  EXPECT_THAT(error_of<PlanningFailed>(only("Rwrist")),
              testing::AllOf(HasSubstr("Lwrist, Lelb, Lknee, Rknee, and in none"),
                             HasSubstr("(only Rwrist)")));
}

TEST(Moves, EdgeFrameAndWorldAreInverse) {
  ObstacleBox turned = box().obstacles.front();
  turned.yaw = 0.4;
  turned.center += Eigen::Vector3d(0.2, -0.1, 0.0);
  const Eigen::Vector3d p(0.1, -0.2, 0.03);
  EXPECT_LT((to_edge_frame(turned, from_edge_frame(turned, p)) - p).norm(), 1e-12);
  // The edge frame's origin: middle of the front top edge.
  const Eigen::Vector3d front(-turned.half_extents.x(), 0.0, 0.0);
  const Eigen::Vector3d expected = turned.center +
                                   Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) * front +
                                   Eigen::Vector3d(0.0, 0.0, turned.half_extents.z());
  EXPECT_LT((from_edge_frame(turned, Eigen::Vector3d::Zero()) - expected).norm(), 1e-12);
}

}  // namespace
}  // namespace clamber
