#include "planner_offline/contacts/stability.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace clamber {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

/// A support mass at distance l from the origin, theta off the vertical.
Eigen::Vector3d mass_at(double l, double theta) {
  return {l * std::sin(theta), 0.0, l * std::cos(theta)};
}

const std::vector<Eigen::Vector3d> kSquare{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
const Eigen::Vector3d kInside(0.5, 0.4, 2.0);

StabilityConfig exact() {
  StabilityConfig config;
  config.tolerance = 0.0;
  return config;
}

TEST(Stability, IsLengthTimesSineOfTheAngle) {
  for (const double theta : {0.0, 10.0, 35.0, 60.0, 89.0}) {
    const Eigen::Vector3d mass = mass_at(0.4, theta * kDegree);
    EXPECT_NEAR(support_angle({0, 0, 0}, mass), theta * kDegree, 1e-12);
    EXPECT_NEAR(contact_stability({0, 0, 0}, mass), 0.4 * std::sin(theta * kDegree), 1e-12);
  }
}

TEST(Stability, DoesNotFallAgainForAMassBelowItsContact) {
  EXPECT_NEAR(contact_stability({0, 0, 0}, mass_at(0.4, 150.0 * kDegree)), 0.4, 1e-12);
  EXPECT_NEAR(contact_stability({0, 0, 0}, {0, 0, -0.3}), 0.3, 1e-12);
}

TEST(Stability, IsZeroInsideTheConeAndTheProjectionDifferenceOutside) {
  const auto s = [](double theta) {
    const LimbContact wrist{"left_arm", {0, 0, 0}, mass_at(0.4, theta * kDegree)};
    return state_stability(std::span(&wrist, 1), kSquare, kInside, exact());
  };
  EXPECT_EQ(s(0.0), 0.0);
  EXPECT_EQ(s(34.9), 0.0);
  EXPECT_NEAR(s(35.1), 0.4 * std::sin(35.1 * kDegree), 1e-12);
}

TEST(Stability, CountsAsAbsoluteWithinTheTolerance) {
  StabilityConfig config;
  config.tolerance = 0.02;
  const double cone = 0.4 * std::sin(config.max_theta);
  const auto s = [&](double projection) {
    const double theta = std::asin(projection / 0.4);
    const LimbContact wrist{"left_arm", {0, 0, 0}, mass_at(0.4, theta)};
    return state_stability(std::span(&wrist, 1), kSquare, kInside, config);
  };
  EXPECT_EQ(s(cone + 0.019), 0.0);
  EXPECT_NEAR(s(cone + 0.021), cone + 0.021, 1e-12);
  EXPECT_EQ(state_stability({}, kSquare, {0.5, -0.019, 1.0}, config), 0.0);
  EXPECT_NEAR(state_stability({}, kSquare, {0.5, -0.021, 1.0}, config), 0.021, 1e-12);
}

TEST(Stability, TakesTheBetterContactOfALimbAndTheWorstLimb) {
  const Eigen::Vector3d shoulder = mass_at(0.2, 10.0 * kDegree);
  const LimbContact elbow{"left_arm", {0, 0, 0}, shoulder};
  const LimbContact wrist{"left_arm", {0.25, 0, 0}, shoulder};
  const LimbContact knee{"left_leg", {0, 0, 0}, mass_at(0.3, 50.0 * kDegree)};
  EXPECT_EQ(state_stability(std::vector{elbow, wrist}, kSquare, kInside, {}), 0.0);
  EXPECT_GT(state_stability(std::vector{wrist}, kSquare, kInside, {}), 0.0);
  EXPECT_NEAR(state_stability(std::vector{elbow, wrist, knee}, kSquare, kInside, {}),
              0.3 * std::sin(50.0 * kDegree), 1e-12);
}

TEST(Stability, CountsACentreOfMassOutsideTheContacts) {
  const LimbContact knee{"left_leg", {0.5, 0.5, 0}, {0.5, 0.5, 0.3}};
  const std::vector loaded{knee};
  EXPECT_NEAR(state_stability(loaded, kSquare, {0.5, -0.2, 1.0}, {}), 0.2, 1e-12);
  EXPECT_NEAR(state_stability(loaded, kSquare, {1.3, 1.4, 1.0}, {}), 0.5, 1e-12);
  StabilityConfig strict;
  strict.com_margin = 0.45;
  EXPECT_NEAR(state_stability(loaded, kSquare, kInside, strict), 0.05, 1e-12);
}

TEST(Stability, HullMarginOfFewAndCollinearPoints) {
  EXPECT_EQ(hull_margin({}, {0, 0, 0}), -std::numeric_limits<double>::infinity());
  const std::vector<Eigen::Vector3d> one{{1, 0, 0}, {1, 0, 5}};
  EXPECT_NEAR(hull_margin(one, {0, 0, 0}), -1.0, 1e-12);
  const std::vector<Eigen::Vector3d> line{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  EXPECT_NEAR(hull_margin(line, {1.5, 0.3, 0}), -0.3, 1e-12);
  EXPECT_NEAR(hull_margin(kSquare, kInside), 0.4, 1e-12);
}

}  // namespace
}  // namespace clamber
