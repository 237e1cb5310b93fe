// `clamber sweep`: its axes and scenarios, and sharded sweeps that give what an unsharded one does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "apps/sweep_grid.hpp"
#include "apps/sweep_table.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "sim_backend/scenario.hpp"
#include "tests/apps/command_line.hpp"

namespace clamber {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

std::vector<double> axis(const std::string& text) {
  return parse_axis(text, "--heights", SweepRange::kPositive);
}

TEST(SweepAxis, TakesNumbersAndRangesWithBothEnds) {
  EXPECT_THAT(axis("0.3:1:0.1"), ElementsAre(0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0));
  EXPECT_THAT(axis("0.275,0.2,0.2:0.3:0.05"), ElementsAre(0.2, 0.25, 0.275, 0.3));
  EXPECT_THAT(parse_axis("0,1", "--ballast", SweepRange::kNotNegative), ElementsAre(0.0, 1.0));
}

TEST(SweepAxis, RefusesWhatIsNoGrid) {
  for (const char* text : {"", "a", "0.2,", "0.2;0.3", "0.3:0.2:0.1", "0.2:0.3", "0.2:0.3:0",
                           "0.2:0.3:-0.1", "0", "-0.2", "nan", "inf", "1e300", "0.1:9:0.0001"})
    EXPECT_THROW(static_cast<void>(axis(text)), InputError) << text;
  for (const char* text : {"", "1", "2/2", "-1/2", "a/2", "0/0", "0/2/3"})
    EXPECT_THROW(static_cast<void>(parse_shard(text)), InputError) << text;
}

TEST(SweepGrid, EveryPointHasItsOwnKey) {
  const SweepGrid grid{.heights = axis("0.1:0.5:0.05"),
                       .frictions = {0.5, 0.8},
                       .depths = {0.6, 0.9},
                       .distances = {},
                       .ballasts = {0.0, 1.0}};
  std::set<std::string> keys;
  for (const SweepPoint& point : grid.points()) keys.insert(point.key());
  EXPECT_EQ(keys.size(), 9u * 2u * 2u * 2u);
  EXPECT_TRUE(keys.contains("h0.15_f0.8_d0.6_b1"));
}

/// A turned box, so that "in front of" is not along x.
TEST(SweepScenario, SetsTheObstacleAndKeepsTheRest) {
  const std::string base =
      "name: turned\nfriction: 0.8\n"
      "obstacles:\n  - {name: box, position: [1, 2], size: [0.8, 1, 0.3], yaw: 0.5}\n"
      "  - {name: wall, position: [5, 5], size: [1, 1, 1]}\n"
      "start: {position: [0.5, 1.7], yaw: 0.5}\n"
      "goal: {posture: all_fours, contacts: [Lwrist]}\n";
  const SweepPoint point{.height = 0.4, .friction = 0.5, .depth = 0.6, .distance = 0.2};
  const Scenario before = parse_scenario(base, "base");
  const Scenario after = parse_scenario(scenario_text(base, "base", point), "point");
  EXPECT_EQ(after.friction, 0.5);
  ASSERT_EQ(after.obstacles.size(), 2u);
  EXPECT_EQ(after.obstacles[1].center, before.obstacles[1].center);
  EXPECT_EQ(after.goal_contacts, before.goal_contacts);
  const ObstacleBox& box = after.obstacles[0];
  EXPECT_DOUBLE_EQ(box.top(), 0.4);
  EXPECT_DOUBLE_EQ(box.half_extents.x(), 0.3);
  EXPECT_EQ(box.half_extents.y(), before.obstacles[0].half_extents.y());
  const Eigen::Vector2d inwards(std::cos(0.5), std::sin(0.5));
  const Eigen::Vector2d front = before.obstacles[0].center.head<2>() - 0.4 * inwards;
  EXPECT_LT((box.center.head<2>() - 0.3 * inwards - front).norm(), 1e-8);
  EXPECT_NEAR(inwards.dot(front - after.start_position.head<2>()), 0.2, 1e-8);
  // Sideways the robot stays where it was.
  const Eigen::Vector2d moved = (after.start_position - before.start_position).head<2>();
  EXPECT_NEAR(inwards.x() * moved.y() - inwards.y() * moved.x(), 0.0, 1e-8);
  EXPECT_NE(after.hash, before.hash);
}

/// One height with a plan and one without, few attempts at each.
class Sweep : public testing::Test {
 protected:
  test::CommandResult sweep(const std::string& arguments) const {
    return test::clamber("sweep " + arguments, folder_.path());
  }
  std::string text(const std::string& file) const { return test::text_of(folder_.path() / file); }

  void SetUp() override {
    std::ofstream(folder_.path() / "quick.yaml") << "search: {most_attempts: 1}\n";
  }

  const std::string cases_ = "--plan-only --heights 0.2,1.5 --friction 0.8 --planner quick.yaml ";
  const test::TemporaryFolder folder_{"sweep"};
};

TEST_F(Sweep, ShardsMergeToWhatTheWholeGivesAndAreNotRepeated) {
  const test::CommandResult whole = sweep(cases_ + "--out whole");
  ASSERT_EQ(whole.exit_code, 0) << whole.error;
  EXPECT_THAT(whole.out, HasSubstr("h0.2_f0.8: plan certified"));
  EXPECT_THAT(whole.out, HasSubstr("h1.5_f0.8: no, planning: "));
  EXPECT_THAT(whole.out, HasSubstr("1 of 2 cases have a certified plan."));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "whole/plans/h0.2_f0.8.json"));

  for (const std::string shard : {"0", "1"}) {
    const test::CommandResult part = sweep(cases_ + "--shard " + shard + "/2 --out part" + shard);
    ASSERT_EQ(part.exit_code, 0) << part.error;
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / ("part" + shard) / "table.csv"));
  }
  const test::CommandResult merged = sweep("--merge part0 part1 --out merged");
  ASSERT_EQ(merged.exit_code, 0) << merged.error;
  EXPECT_EQ(text("merged/table.csv"), text("whole/table.csv"));
  EXPECT_THAT(text("merged/table.csv"), HasSubstr("\n1.5,0.8,0.9,0.13,0.0,0.0,no,planning,"));
  EXPECT_THAT(text("merged/table.md"), HasSubstr("| 0.200 | 0.80 | yes |"));
  EXPECT_THAT(text("merged/sweep.svg"), HasSubstr("worst support margin"));
  for (const std::string key : {"h0.2_f0.8", "h1.5_f0.8"}) {
    const std::string part = key == "h0.2_f0.8" ? "part0" : "part1";
    EXPECT_EQ(text(part + "/cases/" + key + ".json"), text("whole/cases/" + key + ".json"));
  }
  EXPECT_THAT(sweep("--merge part1 --out merged").out, HasSubstr("0 of 1 cases"));

  const test::CommandResult again = sweep(cases_ + "--out whole");
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_THAT(again.error, HasSubstr("1 of 2: h0.2_f0.8 is there already"));
  EXPECT_THAT(again.error, HasSubstr("2 of 2: h1.5_f0.8 is there already"));
  EXPECT_THAT(again.out, Not(HasSubstr("plan certified,")));

  // A record of other inputs is neither mixed into a table nor taken for the case.
  const std::string record = text("part1/cases/h1.5_f0.8.json");
  const std::string key = "\"inputs\":\"";
  std::string other = record;
  other.replace(other.find(key) + key.size(), 4, "abcd");
  std::ofstream(folder_.path() / "part1/cases/h1.5_f0.8.json") << other;
  const test::CommandResult mixed = sweep("--merge part0 part1 --out merged");
  EXPECT_EQ(mixed.exit_code, 2);
  EXPECT_THAT(mixed.error, HasSubstr("made from other inputs"));
  EXPECT_EQ(sweep(cases_ + "--shard 1/2 --out part1").exit_code, 0);
  EXPECT_EQ(text("part1/cases/h1.5_f0.8.json"), record);
}

TEST_F(Sweep, UnusableInputIsExitCode2) {
  std::filesystem::create_directories(folder_.path() / "damaged/cases");
  std::ofstream(folder_.path() / "damaged/cases/h1.json") << "{\"key\": \"h1\"}\n";
  const std::pair<const char*, const char*> table[] = {
      {"--heights 0.2:x", "--heights: '0.2:x': expected a number"},
      {"--friction 0", "--friction: '0': expected numbers > 0"},
      {"--depth -1", "--depth"},
      {"--ballast -1", "--ballast"},
      {"--shard 2/2", "--shard: '2/2'"},
      {"--shard 0/2 --merge damaged", "excludes"},
      {"--merge nothing", "nothing: holds no cases"},
      {"--merge damaged", "h1.json: not the record of a case"},
      {"--planner nothing.yaml", "nothing.yaml"},
      {"--scenario nothing.yaml", "nothing.yaml"},
      {"nothing.mvnx", "nothing.mvnx"},
  };
  for (const auto& [arguments, message] : table) {
    const test::CommandResult result = sweep(std::string(arguments) + " --out bad");
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_THAT(result.error, HasSubstr(message)) << arguments;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "bad"));
}

}  // namespace
}  // namespace clamber
