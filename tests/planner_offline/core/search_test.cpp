// The back-tracking search, on a climb whose first choice leads nowhere.
#include "planner_offline/search/motion_search.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

/// Too narrow to lay a forearm across.
Scenario narrow_box() {
  Scenario scenario = box();
  scenario.obstacles.front().half_extents.y() = 0.2;
  return scenario;
}

/// Wrists so near to the edge that the elbows behind them would hang in the air: the wrists can be
/// set down there, and the elbows only once the wrists have been set down farther in.
std::vector<Move> wrists_near_the_edge(double x) {
  std::vector<std::string> notes;
  std::vector<Move> moves;
  for (Move& move : plan_moves(coman(), narrow_box(), made_climb(), notes)) {
    if (move.optional || !move.lifts.empty()) {
      continue;
    }
    for (auto& [link, reference] : move.references) {
      reference.x() = link == link_of("Lwrist") || link == link_of("Rwrist") ? x : 0.05;
    }
    move.completes_limb.clear();  // the places stay where they are asked for
    moves.push_back(move);
  }
  return moves;
}

SearchResult search(std::size_t most_candidates, const std::vector<Move>& moves) {
  const Scenario scenario = narrow_box();
  PlannerSettings settings;
  settings.search.steady_margin = -1.0;
  settings.search.most_candidates = most_candidates;
  settings.references.relief_iterations = 5;  // standing on both feet is easy
  settings.references.most_iterations = 40;
  const Clearance clearance(coman(), scenario, settings.clearance);
  ReferenceOptimiser references(coman(), scenario, clearance, settings);
  MotionSearch motion_search(coman(), scenario, clearance, settings, references);
  return motion_search.run(standing(scenario), moves, [](int, int, const std::string&) {});
}

TEST(Search, GoesBackOnAChoiceThatLeadsNowhere) {
  const std::vector<Move> moves = wrists_near_the_edge(0.2);
  ASSERT_EQ(moves.size(), 2U);
  const SearchResult result = search(200, moves);
  ASSERT_TRUE(result.success) << result.failure;
  EXPECT_GE(result.backtracks, 1U);
  EXPECT_THAT(result.rejected, testing::Contains(testing::HasSubstr("Lelb+Relb")));
  // Nothing of what was undone is left: one keyframe a move, and every stretch begins where the
  // one before it ended.
  ASSERT_EQ(result.keyframes.size(), 2U);
  for (std::size_t i = 1; i < result.stretches.size(); ++i) {
    const Configuration& end = result.stretches[i - 1].path.back();
    const Configuration& begin = result.stretches[i].path.front();
    EXPECT_EQ(end.q, begin.q) << result.stretches[i].name;
    EXPECT_EQ(end.X_WB.p, begin.X_WB.p) << result.stretches[i].name;
  }
  const double wanted = moves[0].references.at(link_of("Lwrist")).x();
  const Eigen::Vector3d wrist = to_edge_frame(narrow_box().obstacles.front(),
                                              result.keyframes[0].positions.at(link_of("Lwrist")));
  EXPECT_GT(wrist.x(), wanted + 0.02);
}

TEST(Search, SaysWhichMoveWasTheFurthestWhenItGivesUp) {
  const std::vector<Move> moves = wrists_near_the_edge(0.05);
  const SearchResult result = search(4, moves);
  EXPECT_FALSE(result.success);
  EXPECT_TRUE(result.stretches.empty());
  EXPECT_TRUE(result.keyframes.empty());
  EXPECT_FALSE(result.rejected.empty());
  EXPECT_THAT(result.failure, testing::HasSubstr("Lelb+Relb"));
}

}  // namespace
}  // namespace clamber
