// States, reduction and table on made-up samples, the paper's two tables among them.
#include "planner_offline/contacts/contact_states.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "planner_offline/contacts/contact_table.hpp"

namespace clamber {
namespace {

constexpr double kPeriod = 0.05;
const std::vector<std::string> kLinks{"Lwrist", "Rwrist", "Lelb",  "Relb",
                                      "Lknee",  "Rknee",  "Lfoot", "Rfoot"};

using Names = std::vector<std::string>;

/// A stretch of samples: these contacts, at this x, with this s.
struct Stretch {
  double seconds = 0.0;
  Names obstacle{};
  Names floor{};
  double s = 0.0;
  double x = 0.1;
};

std::vector<ContactReference> references(const Names& links, const std::string& surface, double x,
                                         double s) {
  std::vector<ContactReference> references;
  for (const std::string& link : links) {
    references.push_back({link, surface, {x, 0.0, 0.0}, s});
  }
  return references;
}

std::vector<ContactSample> samples_of(const std::vector<Stretch>& stretches) {
  std::vector<ContactSample> samples;
  for (const Stretch& stretch : stretches) {
    for (int i = 0; i < static_cast<int>(std::lround(stretch.seconds / kPeriod)); ++i) {
      ContactSample sample;
      sample.time = kPeriod * static_cast<double>(samples.size());
      sample.obstacle = references(stretch.obstacle, "box", stretch.x, stretch.s);
      sample.floor = references(stretch.floor, "floor", -0.1, 0.0);
      sample.stability = stretch.s;
      sample.posture.q = JointVector::Constant(1, sample.time);
      samples.push_back(sample);
    }
  }
  return samples;
}

std::vector<ContactState> states_of(const std::vector<Stretch>& stretches) {
  return build_states(samples_of(stretches), kLinks, {});
}

Names links_of(const std::vector<ContactReference>& contacts) {
  Names links;
  for (const ContactReference& contact : contacts) {
    links.push_back(contact.link);
  }
  return links;
}

const Names kWrists{"Lwrist", "Rwrist"};
const Names kArms{"Lwrist", "Rwrist", "Lelb", "Relb"};
const Names kArmsKnee{"Lwrist", "Rwrist", "Lelb", "Relb", "Lknee"};
const Names kAll{"Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"};

// The paper's first table (III-C). The columns of its knees are read as its text and its second
// table demand: two duplicated states (2 and 3, 4 and 5: the links stay, their positions do not),
// then both knees.
std::vector<Stretch> paper_climb() {
  return {{1.0, {}, {"Lfoot", "Rfoot"}},   {1.0, kWrists, {"Lfoot", "Rfoot"}, 0.2},
          {1.0, kArms, {}, 0.1, 0.1},      {1.0, kArms, {}, 0.0, 0.2},
          {1.0, kArmsKnee, {}, 0.15, 0.2}, {1.0, kArmsKnee, {}, 0.0, 0.3},
          {1.0, kAll, {}, 0.0, 0.3}};
}

TEST(ContactStates, GiveThePapersFirstTable) {
  EXPECT_EQ(contact_table(states_of(paper_climb())),
            "State1    State2   State3   State4   State5   State6\n"
            "Lwrist    Lwrist   Lwrist   Lwrist   Lwrist   Lwrist\n"
            "Rwrist    Rwrist   Rwrist   Rwrist   Rwrist   Rwrist\n"
            "(Lfoot)   Lelb     Lelb     Lelb     Lelb     Lelb\n"
            "(Rfoot)   Relb     Relb     Relb     Relb     Relb\n"
            "                            Lknee    Lknee    Lknee\n"
            "                                              Rknee\n"
            "s > 0     s > 0    s = 0    s > 0    s = 0    s = 0\n");
}

TEST(ContactStates, ReduceToThePapersSecondTable) {
  EXPECT_EQ(contact_table(reduce(states_of(paper_climb()))),
            "State1   State2   State3\n"
            "Lwrist   Lwrist   Lwrist\n"
            "Rwrist   Rwrist   Rwrist\n"
            "Lelb     Lelb     Lelb\n"
            "Relb     Relb     Relb\n"
            "         Lknee    Lknee\n"
            "                  Rknee\n"
            "s = 0    s = 0    s = 0\n");
}

TEST(ContactStates, BeginOnlyWhenTheSetChanges) {
  const auto states = states_of({{1.0, kWrists}, {1.0, kArms}, {1.0, kArmsKnee}});
  ASSERT_EQ(states.size(), 3u);
  EXPECT_NEAR(states[1].start, 1.0, 1e-9);
  EXPECT_NEAR(states[1].end, 2.0, 1e-9);
  EXPECT_EQ(links_of(states[1].obstacle), kArms);
}

TEST(ContactStates, IgnoreFlicker) {
  EXPECT_EQ(states_of({{1.0, kArms}, {0.15, kWrists}, {1.0, kArms}}).size(), 1u);
  EXPECT_EQ(states_of({{1.0, kWrists}, {0.1, kArms}, {1.0, kWrists}}).size(), 1u);
  EXPECT_EQ(states_of({{1.0, kArms}, {0.2, kWrists}, {1.0, kArms}}).size(), 3u);
}

TEST(ContactStates, IgnoreLinksThatFlickerInTurn) {
  std::vector<Stretch> stretches{{0.2, kArms}};
  for (int i = 0; i < 5; ++i) {
    stretches.push_back({0.1, {"Lwrist", "Rwrist", "Lelb"}});
    stretches.push_back({0.1, {"Lwrist", "Rwrist", "Relb"}});
  }
  stretches.push_back({0.1, kArms});
  const auto states = states_of(stretches);
  ASSERT_EQ(states.size(), 1u);
  EXPECT_NEAR(states[0].start, 0.0, 1e-9);
  EXPECT_NEAR(states[0].end, 1.25, 1e-9);
}

TEST(ContactStates, CountLinksThatLandInShortOrderToTheFullSet) {
  const auto states = states_of({{1.0, {}}, {0.1, {"Lwrist"}}, {1.0, kWrists}});
  ASSERT_EQ(states.size(), 1u);
  EXPECT_EQ(links_of(states[0].obstacle), kWrists);
  EXPECT_NEAR(states[0].start, 1.0, 1e-9);
}

TEST(ContactStates, MakeNoneWithoutTheObstacle) {
  EXPECT_TRUE(states_of({{2.0, {}, {"Lfoot", "Rfoot"}}}).empty());
  EXPECT_TRUE(states_of({}).empty());
}

TEST(ContactStates, TakePostureAndReferencesOfTheBestSupportedSample) {
  const auto states = states_of(
      {{0.5, kArms, {}, 0.3, 0.10}, {0.05, kArms, {}, 0.01, 0.12}, {0.5, kArms, {}, 0.2, 0.14}});
  ASSERT_EQ(states.size(), 1u);
  EXPECT_EQ(states[0].stability, 0.01);
  EXPECT_EQ(states[0].obstacle[0].position.x(), 0.12);
  EXPECT_NEAR(states[0].posture.q[0], 0.5, 1e-9);
}

TEST(ContactStates, KeepTheReferenceOfAClosedBreak) {
  const auto states = states_of({{0.3, kArms, {}, 0.2, 0.1}, {0.1, kWrists, {}, 0.0, 0.1}});
  ASSERT_EQ(states.size(), 1u);
  EXPECT_EQ(links_of(states[0].obstacle), kArms);
  EXPECT_EQ(states[0].stability, 0.2)
      << "a sample that lacks contacts does not speak for the state";
}

TEST(ContactStates, SeeAFootLeaveTheFloor) {
  const auto states = states_of({{1.0, kArms, {"Lfoot", "Rfoot"}}, {1.0, kArms, {"Rfoot"}}});
  ASSERT_EQ(states.size(), 2u);
  EXPECT_EQ(links_of(states[1].floor), Names{"Rfoot"});
  EXPECT_EQ(reduce(states).size(), 1u) << "the paper's lists are the obstacle's contacts";
}

TEST(Reduce, KeepsTheBetterSupportedPostureOfEqualSets) {
  auto states = states_of({{1.0, kArms, {}, 0.0, 0.1}, {1.0, kArms, {}, 0.0, 0.3}});
  ASSERT_EQ(states.size(), 2u);
  states[0].obstacle[0].stability = 0.2;
  const auto reduced = reduce(states);
  ASSERT_EQ(reduced.size(), 1u);
  EXPECT_EQ(reduced[0].obstacle[0].position.x(), 0.3);
  EXPECT_EQ(reduced[0].start, states[0].start);
  EXPECT_EQ(reduced[0].end, states[1].end);
}

TEST(Reduce, MergesOnlyNeighbours) {
  EXPECT_EQ(reduce(states_of({{1.0, kArms}, {1.0, kArmsKnee}, {1.0, kArms}})).size(), 3u);
  EXPECT_EQ(reduce(states_of({{1.0, kArms}, {1.0, kArmsKnee, {}, 0.1}, {1.0, kArms}})).size(), 1u);
}

TEST(ContactTable, OfNothingIsEmpty) { EXPECT_EQ(contact_table({}), ""); }

}  // namespace
}  // namespace clamber
