// The search over contact places: asks before it takes a climb, goes on when told no, and comes to
// the same result every time although attempts run side by side.
#include "planner_offline/search/placement_search.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

ClimbSearch search(const ClimbCheck& check, std::size_t most_attempts,
                   std::size_t most_candidates = 6000) {
  const Scenario scenario = box();
  PlannerSettings settings;
  settings.search.steady_margin = -1.0;  // the first climb is steady enough
  settings.search.most_attempts = most_attempts;
  settings.search.most_candidates_in_all = most_candidates;
  std::vector<std::string> notes;
  const std::vector<Move> moves = plan_moves(coman(), scenario, made_climb(), notes);
  const Clearance clearance(coman(), scenario, settings.clearance);
  return search_climb(coman(), scenario, clearance, settings, standing(scenario), moves, check,
                      [](int, int, const std::string&) {});
}

TEST(PlacementSearch, TakesTheFirstClimbThatIsSteadyAndApproved) {
  int asked = 0;
  const ClimbSearch found = search(
      [&](const SearchResult& result) {
        ++asked;
        EXPECT_TRUE(result.success);
        EXPECT_FALSE(result.stretches.empty());
        return std::string();
      },
      9);
  ASSERT_TRUE(found.best.success) << found.best.failure;
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(found.attempts, 1U);
}

TEST(PlacementSearch, GoesOnWhenAClimbIsNotApproved) {
  int asked = 0;
  const ClimbSearch found =
      search([&](const SearchResult&) { return ++asked == 1 ? "not that one" : ""; }, 9);
  ASSERT_TRUE(found.best.success) << found.best.failure;
  EXPECT_GE(asked, 2);
  EXPECT_GT(found.attempts, 1U);
  EXPECT_THAT(found.rejected, testing::Contains("not that one"));
}

TEST(PlacementSearch, GivesTheReasonWhenNoneIsApproved) {
  const ClimbSearch found = search([](const SearchResult&) { return "none will do"; }, 5);
  EXPECT_FALSE(found.best.success);
  EXPECT_EQ(found.best.failure, "none will do");
  EXPECT_GE(found.attempts, 5U);
  EXPECT_THAT(found.given_up, testing::HasSubstr("search.most_attempts"));
}

TEST(PlacementSearch, EndsWhenTheCandidatesAreUsedUp) {
  const ClimbSearch found = search([](const SearchResult&) { return "none will do"; }, 99, 1);
  EXPECT_FALSE(found.best.success);
  EXPECT_EQ(found.attempts, 1U);
  EXPECT_THAT(found.given_up, testing::HasSubstr("share of search.most_candidates_in_all"));
}

/// m between the places of the links that land first, a hand on each side.
double width(const SearchResult& climb) {
  double least = 0.0, most = 0.0;
  for (const auto& [link, position] : climb.keyframes.front().positions) {
    least = std::min(least, position.y());
    most = std::max(most, position.y());
  }
  return most - least;
}

TEST(PlacementSearch, TriesHandsFartherApartAndNearerTogether) {
  std::vector<double> widths;
  (void)search([&](const SearchResult& climb) { return widths.push_back(width(climb)), "go on"; },
               11);
  ASSERT_FALSE(widths.empty());
  EXPECT_THAT(widths, testing::Contains(testing::Lt(widths.front() - 0.02)));
  EXPECT_THAT(widths, testing::Contains(testing::Gt(widths.front() + 0.02)));
}

TEST(PlacementSearch, ComesToTheSameResultEveryTime) {
  const auto run = [] {
    int asked = 0;
    return search([&](const SearchResult&) { return ++asked < 3 ? "no" : ""; }, 9);
  };
  const ClimbSearch a = run(), b = run();
  EXPECT_EQ(a.attempts, b.attempts);
  EXPECT_EQ(a.candidates, b.candidates);
  EXPECT_EQ(a.rejected, b.rejected);
  ASSERT_EQ(a.best.stretches.size(), b.best.stretches.size());
  for (std::size_t i = 0; i < a.best.stretches.size(); ++i) {
    EXPECT_EQ(a.best.stretches[i].path.back().q, b.best.stretches[i].path.back().q);
  }
}

}  // namespace
}  // namespace clamber
