// Properties of the clamped spline on random plans: it passes through its knots to the last bit, is
// C2 across them, rests at both ends, and its reported extremes are the true ones.
#include "control/spline.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace clamber {
namespace {

struct Table {
  const std::vector<double>* times = nullptr;
  const std::vector<double>* values = nullptr;  ///< row per knot
  std::size_t columns = 1;
  [[nodiscard]] std::size_t size() const { return times->size(); }
  [[nodiscard]] std::size_t dimensions() const { return columns; }
  [[nodiscard]] double time(std::size_t i) const { return (*times)[i]; }
  [[nodiscard]] double value(std::size_t i, std::size_t d) const {
    return (*values)[i * columns + d];
  }
};

struct RandomPlan {
  std::vector<double> times, values, workspace;
  Table table;
  ClampedSpline<Table> spline;

  RandomPlan(unsigned seed, std::size_t knots, std::size_t columns) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> step(0.05, 0.2), move(-0.1, 0.1);
    double t = 0.0;
    for (std::size_t i = 0; i < knots; ++i, t += step(random)) {
      times.push_back(t);
      for (std::size_t d = 0; d < columns; ++d)
        values.push_back((i == 0 ? 0.0 : values[(i - 1) * columns + d]) + move(random));
    }
    table = {&times, &values, columns};
    workspace.resize(ClampedSpline<Table>::workspace_size(knots, columns));
    EXPECT_EQ(spline.build(table, workspace), SplineStatus::kOk);
  }
};

class SplineProperties : public testing::TestWithParam<unsigned> {
 protected:
  const std::size_t columns_ = 5;
  RandomPlan plan_{GetParam(), 2 + GetParam() * 7, columns_};
};

TEST_P(SplineProperties, ReproducesEveryKnotExactly) {
  std::size_t segment = 0;
  for (std::size_t i = 0; i < plan_.times.size(); ++i) {
    plan_.spline.locate(plan_.times[i], segment);
    for (std::size_t d = 0; d < columns_; ++d)
      EXPECT_EQ(plan_.spline.evaluate(plan_.times[i], segment, d).value, plan_.table.value(i, d));
  }
}

TEST_P(SplineProperties, IsTwiceContinuouslyDifferentiableAtInnerKnots) {
  for (std::size_t i = 1; i + 1 < plan_.times.size(); ++i)
    for (std::size_t d = 0; d < columns_; ++d) {
      const double t = plan_.times[i];
      // Just inside the last knot evaluate() is the segment's own cubic on both sides.
      const auto left = plan_.spline.evaluate(t, i - 1, d);
      const auto right = plan_.spline.evaluate(t, i, d);
      EXPECT_NEAR(left.value, right.value, 1e-12);
      EXPECT_NEAR(left.rate, right.rate, 1e-10);
      EXPECT_NEAR(left.acceleration, right.acceleration, 1e-7);
    }
}

TEST_P(SplineProperties, RestsAtBothEnds) {
  const double end = plan_.times.back();
  for (std::size_t d = 0; d < columns_; ++d) {
    EXPECT_NEAR(plan_.spline.evaluate(1e-9, 0, d).rate, 0.0, 1e-6);
    EXPECT_NEAR(plan_.spline.evaluate(end - 1e-9, plan_.times.size() - 2, d).rate, 0.0, 1e-6);
    EXPECT_EQ(plan_.spline.evaluate(-1.0, 0, d).value, plan_.table.value(0, d));
    EXPECT_EQ(plan_.spline.evaluate(end + 1.0, plan_.times.size() - 2, d).value,
              plan_.table.value(plan_.times.size() - 1, d));
  }
}

TEST_P(SplineProperties, RateIsTheDerivativeOfTheValue) {
  std::size_t segment = 0;
  const double step = 1e-6;
  for (double t = 0.013; t < plan_.times.back() - 0.01; t += 0.0317) {
    plan_.spline.locate(t, segment);
    for (std::size_t d = 0; d < columns_; ++d) {
      const auto before = plan_.spline.evaluate(t - step, segment, d);
      const auto here = plan_.spline.evaluate(t, segment, d);
      const auto after = plan_.spline.evaluate(t + step, segment, d);
      EXPECT_NEAR((after.value - before.value) / (2 * step), here.rate, 1e-4);
      EXPECT_NEAR((after.rate - before.rate) / (2 * step), here.acceleration, 1e-2);
    }
  }
}

TEST_P(SplineProperties, ExtremesAgreeWithASweep) {
  for (std::size_t d = 0; d < columns_; ++d) {
    const SplineExtremes e = plan_.spline.extremes(d);
    double low = 1e9, high = -1e9, fastest = 0.0, overshoot = 0.0;
    std::size_t segment = 0;
    for (double t = 0.0; t <= plan_.times.back(); t += 1e-3) {
      plan_.spline.locate(t, segment);
      const auto x = plan_.spline.evaluate(t, segment, d);
      const double a = plan_.table.value(segment, d), b = plan_.table.value(segment + 1, d);
      low = std::min(low, x.value);
      high = std::max(high, x.value);
      fastest = std::max(fastest, std::abs(x.rate));
      overshoot = std::max({overshoot, std::min(a, b) - x.value, x.value - std::max(a, b)});
    }
    EXPECT_LE(e.lowest, low + 1e-12);
    EXPECT_GE(e.highest, high - 1e-12);
    EXPECT_NEAR(e.lowest, low, 1e-4);
    EXPECT_NEAR(e.highest, high, 1e-4);
    EXPECT_GE(e.fastest, fastest - 1e-12);
    EXPECT_NEAR(e.fastest, fastest, 1e-2);
    EXPECT_NEAR(e.overshoot, overshoot, 1e-4);
  }
}

INSTANTIATE_TEST_SUITE_P(RandomPlans, SplineProperties, testing::Values(0u, 1u, 2u, 3u, 20u, 60u));

TEST(Spline, ReproducesASpanThatIsACubicItself) {
  // 3 s^2 - 2 s^3 rests at 0 and 1: the clamped spline through its samples is the cubic itself.
  const auto cubic = [](double s) { return s * s * (3.0 - 2.0 * s); };
  std::vector<double> times, values;
  for (const double t : {0.0, 0.1, 0.35, 0.5, 0.72, 1.0}) {
    times.push_back(t);
    values.push_back(cubic(t));
  }
  const Table table{&times, &values, 1};
  std::vector<double> workspace(ClampedSpline<Table>::workspace_size(times.size(), 1));
  ClampedSpline<Table> spline;
  ASSERT_EQ(spline.build(table, workspace), SplineStatus::kOk);
  std::size_t segment = 0;
  for (double t = 0.0; t <= 1.0; t += 0.01) {
    spline.locate(t, segment);
    EXPECT_NEAR(spline.evaluate(t, segment, 0).value, cubic(t), 1e-14);
  }
}

TEST(Spline, CursorFindsTheSegmentFromAnywhere) {
  RandomPlan plan(7, 50, 1);
  for (std::size_t guess = 0; guess < 60; guess += 7)
    for (std::size_t i = 0; i + 1 < 50; ++i) {
      std::size_t segment = guess;
      plan.spline.locate(0.5 * (plan.times[i] + plan.times[i + 1]), segment);
      EXPECT_EQ(segment, i);
    }
}

TEST(Spline, RefusesUnusableKnots) {
  std::vector<double> times{0.0, 0.1, 0.1}, values{0.0, 1.0, 2.0}, workspace(6);
  ClampedSpline<Table> spline;
  EXPECT_EQ(spline.build(Table{&times, &values, 1}, workspace), SplineStatus::kTimeNotIncreasing);
  times = {0.0, std::nan(""), 0.2};
  EXPECT_EQ(spline.build(Table{&times, &values, 1}, workspace), SplineStatus::kTimeNotIncreasing);
  times = {0.0};
  EXPECT_EQ(spline.build(Table{&times, &values, 1}, workspace), SplineStatus::kTooFewKnots);
  times = {0.0, 0.1, 0.2};
  EXPECT_EQ(spline.build(Table{&times, &values, 1}, std::span(workspace).first(5)),
            SplineStatus::kWorkspaceTooSmall);
  EXPECT_EQ(spline.build(Table{&times, &values, 1}, workspace), SplineStatus::kOk);
}

}  // namespace
}  // namespace clamber
