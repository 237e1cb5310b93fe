// Support region on made-up polygons.
#include "planner_offline/certify/support_region.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace clamber {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// 0.4 m by 0.2 m, corners at three heights, with points inside and on the rim.
std::vector<Vector3d> rectangle() {
  return {{0.0, 0.0, 0.0},  {0.4, 0.0, 0.3},  {0.4, 0.2, 0.3}, {0.0, 0.2, 0.0},
          {0.2, 0.1, 0.15}, {0.2, 0.0, 0.15}, {0.4, 0.1, 0.0}, {0.0, 0.0, 0.0}};
}

TEST(SupportRegion, HullDropsInnerCollinearAndDoublePoints) {
  const SupportRegion region(rectangle());
  ASSERT_EQ(region.corners().size(), 4U);
  ASSERT_EQ(region.half_planes().size(), 4U);
  double area = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector2d &a = region.corners()[i], &b = region.corners()[(i + 1) % 4];
    area += 0.5 * (a.x() * b.y() - a.y() * b.x());
  }
  EXPECT_NEAR(area, 0.08, 1e-12);  // positive: counter-clockwise
}

TEST(SupportRegion, MarginIsTheDistanceToTheNearestEdge) {
  const SupportRegion region(rectangle());
  EXPECT_NEAR(region.margin({0.2, 0.1}), 0.1, 1e-12);
  EXPECT_NEAR(region.margin({0.03, 0.1}), 0.03, 1e-12);
  EXPECT_NEAR(region.margin({0.2, 0.19}), 0.01, 1e-12);
  EXPECT_NEAR(region.margin({0.4, 0.1}), 0.0, 1e-12);
  EXPECT_NEAR(region.margin({0.45, 0.1}), -0.05, 1e-12);
  EXPECT_NEAR(region.margin({0.2, -0.02}), -0.02, 1e-12);
}

TEST(SupportRegion, RandomHullsHoldTheirPointsAndNothingBeyond) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> u(-0.3, 0.3);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<Vector3d> points(3 + static_cast<std::size_t>(trial % 12));
    for (Vector3d& p : points) {
      p = {u(generator), u(generator), u(generator)};
    }
    const SupportRegion region(points);
    for (const Vector3d& p : points) {
      EXPECT_GE(region.margin(p.head<2>()), -1e-9);
    }
    // Every edge touches two of the points: the hull is not larger than it has to be.
    for (const HalfPlane& h : region.half_planes()) {
      EXPECT_NEAR(h.normal.norm(), 1.0, 1e-12);
      const auto on_edge = std::count_if(points.begin(), points.end(), [&h](const Vector3d& p) {
        return std::abs(h.normal.dot(p.head<2>()) - h.offset) < 1e-9;
      });
      EXPECT_GE(on_edge, 2);
    }
  }
}

TEST(SupportRegion, MiddleHasNearlyTheLargestMargin) {
  EXPECT_NEAR(SupportRegion(rectangle()).margin(SupportRegion(rectangle()).middle()), 0.1, 2e-3);
  // Right isosceles triangle with legs of 0.3 m: inscribed circle's radius.
  const SupportRegion triangle({{0.0, 0.0, 0.0}, {0.3, 0.0, 0.0}, {0.0, 0.3, 0.0}});
  const double radius = 0.3 * (1.0 - 1.0 / std::sqrt(2.0));
  EXPECT_GT(triangle.margin(triangle.middle()), 0.9 * radius);
  EXPECT_LE(triangle.margin(triangle.middle()), radius + 1e-12);
}

TEST(SupportRegion, NearestInsideMovesOnlyAsFarAsNeeded) {
  const SupportRegion region(rectangle());
  const Vector2d inside(0.1, 0.08);
  EXPECT_EQ(region.nearest_inside(inside, 0.05), inside);
  const Vector2d outside(-0.1, 0.1);
  const Vector2d there = region.nearest_inside(outside, 0.04);
  EXPECT_NEAR(region.margin(there), 0.04, 1e-6);
  EXPECT_NEAR(there.x(), 0.04, 1e-3);
  // On the straight way to the middle.
  const Vector2d way = region.middle() - outside, gone = there - outside;
  EXPECT_NEAR(way.x() * gone.y() - way.y() * gone.x(), 0.0, 1e-9);
}

TEST(SupportRegion, NearestInsideGoesToTheMiddleWhereTooMuchIsAsked) {
  const SupportRegion region(rectangle());
  const Vector2d there = region.nearest_inside({-0.1, 0.0}, 0.5);
  EXPECT_GT(region.margin(there), 0.95 * region.margin(region.middle()));
}

TEST(SupportRegion, DegenerateContactsSupportNothing) {
  const std::vector<std::vector<Vector3d>> degenerate{
      {},
      {{0.1, 0.1, 0.0}},
      {{0.1, 0.1, 0.0}, {0.3, 0.1, 0.0}},
      {{0.0, 0.0, 0.0}, {0.1, 0.1, 0.0}, {0.2, 0.2, 0.5}},
      {{0.1, 0.1, 0.0}, {0.1, 0.1, 0.2}, {0.1, 0.1, 0.4}},
  };
  for (const auto& points : degenerate) {
    const SupportRegion region(points);
    EXPECT_TRUE(region.corners().empty()) << points.size();
    EXPECT_TRUE(region.half_planes().empty());
    EXPECT_EQ(region.margin({0.1, 0.1}), -std::numeric_limits<double>::infinity());
    EXPECT_TRUE(region.nearest_inside({0.1, 0.1}, 0.05).allFinite());
  }
}

}  // namespace
}  // namespace clamber
