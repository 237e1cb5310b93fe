#include "report/plots.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <pugixml.hpp>

#include "report/svg_plot.hpp"
#include "tests/report/made_robot.hpp"

namespace clamber {
namespace {

pugi::xml_document parsed(const std::string& svg) {
  pugi::xml_document document;
  const auto result = document.load_string(svg.c_str());
  EXPECT_TRUE(result) << result.description() << " at " << result.offset;
  EXPECT_STREQ(document.document_element().name(), "svg");
  return document;
}

Plan made_plan() {
  Plan plan;
  for (int i = 0; i <= 40; ++i) {
    Keyframe keyframe;
    keyframe.time = 0.1 * i;
    keyframe.support_margin = 0.04 - 0.001 * i;
    plan.keyframes.push_back(keyframe);
  }
  plan.phases = {{"State1 <&>", 0.0}, {"swing Lknee", 2.0}};
  return plan;
}

// Lowest and highest y of a path of M and L commands.
std::pair<double, double> extent(const std::string& d) {
  double low = 1e9;
  double high = -1e9;
  for (std::size_t i = d.find(','); i != std::string::npos; i = d.find(',', i + 1)) {
    const double y = std::stod(d.substr(i + 1));
    low = std::min(low, y);
    high = std::max(high, y);
  }
  return {low, high};
}

TEST(Plots, AreWellFormedWithAndWithoutPlayback) {
  const RunData run = test::made_climb();
  const auto both = parsed(plot_torques(&run, run));
  EXPECT_EQ(both.select_nodes("//path[contains(@class,'limit')]").size(), 5u);  // 2 x 2 + legend
  EXPECT_EQ(both.select_nodes("//path[starts-with(@class,'curve c')]").size(), 12u);
  const auto alone = parsed(plot_torques(nullptr, run));
  EXPECT_EQ(alone.select_nodes("//path[starts-with(@class,'curve c')]").size(), 8u);
  EXPECT_EQ(parsed(plot_peaks(&run, run)).select_nodes("//rect[@class='b1']").size(),
            1 + run.model.joints.size());
  (void)parsed(plot_peaks(nullptr, run));
  (void)parsed(plot_contacts(run));
  (void)parsed(plot_support_margin(made_plan()));
}

TEST(Plots, TakeEmptyInput) {
  RunData run = test::made_climb();
  run.frames.clear();
  (void)parsed(plot_torques(&run, run));
  (void)parsed(plot_peaks(&run, run));
  (void)parsed(plot_contacts(run));
  (void)parsed(plot_support_margin(Plan{}));
}

TEST(Curve, KeepsAOneSampleSpikeAndStaysSmall) {
  std::vector<double> x;
  std::vector<double> y;
  for (int i = 0; i < 60000; ++i) {
    x.push_back(0.001 * i);
    y.push_back(std::sin(0.01 * i));
  }
  y[31234] = -41.5;
  const SvgAxes axes({0, 0, 400, 300}, {0, 60}, {-50, 50});
  const std::string path = axes.curve(x, y, "c0");
  EXPECT_LT(path.size(), 25000u);
  const auto document = parsed("<svg>" + path + "</svg>");
  const auto [low, high] = extent(document.select_node("//path").node().attribute("d").value());
  EXPECT_NEAR(high, axes.py(-41.5), 0.1);
  EXPECT_NEAR(low, axes.py(1.0), 0.1);
}

TEST(Curve, KeepsAHumpThatGrowsSlowly) {
  std::vector<double> x;
  std::vector<double> y;
  for (int i = 0; i <= 20000; ++i) {
    x.push_back(0.001 * i);
    y.push_back(0.05 * (1.0 - std::abs(i - 10000) / 10000.0));  // 5 px high, 0.0125 px a column
  }
  const SvgAxes axes({0, 0, 800, 100}, {0, 20}, {0, 1});
  const auto document = parsed("<svg>" + axes.curve(x, y, "c0") + "</svg>");
  const auto [low, high] = extent(document.select_node("//path").node().attribute("d").value());
  EXPECT_NEAR(low, axes.py(0.05), 0.11);
  EXPECT_NEAR(high, axes.py(0.0), 0.11);
}

TEST(Curve, SkipsWhatIsNotANumber) {
  const SvgAxes axes({0, 0, 100, 100}, {0, 2}, {0, 1});
  const std::string path = axes.curve({0, 1, 2}, {0.5, std::nan(""), 0.25}, "c0");
  EXPECT_EQ(path.find("nan"), std::string::npos);
  EXPECT_TRUE(axes.curve({}, {}, "c0").empty());
}

TEST(RoundTicks, AreRoundAndInside) {
  EXPECT_EQ(round_ticks({0.0, 10.0}, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  EXPECT_EQ(round_ticks({-30.0, 30.0}, 6), (std::vector<double>{-30, -20, -10, 0, 10, 20, 30}));
  EXPECT_EQ(round_ticks({1.0, 1.0}, 6).size(), 1u);
}

TEST(ContactPlot, ShowsFloorThenObstacle) {
  const auto document = parsed(plot_contacts(test::made_climb()));
  // Hands and knees: 6 rows on the obstacle; feet: 2 rows on the floor; nothing forbidden.
  double first_hold = 1e9;
  for (const auto& node : document.select_nodes("//rect[starts-with(@class,'hold o')]")) {
    first_hold = std::min(first_hold, node.node().attribute("x").as_double());
  }
  EXPECT_GT(first_hold, 500.0);  // half of the 4 s
  EXPECT_FALSE(document.select_nodes("//rect[starts-with(@class,'floor o')]").empty());
  EXPECT_TRUE(document.select_nodes("//rect[starts-with(@class,'bad o')]").empty());
}

}  // namespace
}  // namespace clamber
