// Clearance rows against finite differences, and who is exempt from them.
#include "planner_offline/clearance/clearance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

/// With these every pair is a row whatever its distance, in the same order everywhere, and the
/// row's side tells the distance (see distances()).
constexpr double kFar = 5.0;  // m
ClearanceSettings all_rows() {
  ClearanceSettings settings;
  settings.obstacle = settings.lying = settings.landing = settings.self = -kFar;
  settings.activation = 50.0;
  return settings;
}

Inequalities rows_at(const Clearance& clearance, const Configuration& x,
                     const ContactSet& contacts = {}, const std::vector<int>& landing = {}) {
  Inequalities rows{Eigen::MatrixXd(0, coman().velocity_count()), Eigen::VectorXd(0)};
  clearance.constrain(data_at(x), contacts, landing, true, rows);
  return rows;
}

/// d = -(distance - margin) / 2 wherever the margin holds.
Eigen::VectorXd distances(const Clearance& clearance, const Configuration& x) {
  return -2.0 * rows_at(clearance, x).d.array() - kFar;
}

TEST(Clearance, EveryRowIsTheDerivativeOfItsDistance) {
  const Clearance clearance(coman(), box(), all_rows());
  std::mt19937 generator(1);
  constexpr double kProbe = 1e-5;
  int compared = 0, kinks = 0;
  for (int posture = 0; posture < 30; ++posture) {
    const Configuration x = random_posture(generator);
    const Inequalities rows = rows_at(clearance, x);
    const Eigen::VectorXd here = distances(clearance, x);
    for (int i = 0; i < coman().velocity_count(); ++i) {
      const Eigen::VectorXd forth = distances(clearance, moved(x, unit_step(i, kProbe)));
      const Eigen::VectorXd back = distances(clearance, moved(x, unit_step(i, -kProbe)));
      ASSERT_EQ(forth.size(), here.size());
      for (Eigen::Index r = 0; r < here.size(); ++r) {
        if (here[r] < 1e-4) {
          continue;  // in penetration: the primitives' own test
        }
        const double ahead = (forth[r] - here[r]) / kProbe, behind = (here[r] - back[r]) / kProbe;
        if (std::abs(ahead - behind) > 2e-3) {
          ++kinks;  // the nearest point jumps here
          continue;
        }
        EXPECT_NEAR(rows.C(r, i), 0.5 * (ahead + behind), 2e-3)
            << "posture " << posture << " row " << r << " coordinate " << i;
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 15000);
  EXPECT_LT(kinks, compared / 200);
}

/// Wrists `above` the box, forearms forward.
Configuration hands_above(const Scenario& scenario, double above) {
  Configuration x;
  x.q = on_forearms();
  x.X_WB.R = rotation_exp({0.0, 1.6, 0.0});
  x.X_WB.p.setZero();
  const Eigen::Vector3d wrist = touch_point(coman(), data_at(x), link_of("Lwrist"));
  x.X_WB.p = {0.3 - wrist.x(), 0.0, scenario.obstacles[0].top() + above - wrist.z()};
  return x;
}

double worst_side(const Inequalities& rows) { return rows.d.size() > 0 ? rows.d.maxCoeff() : -1.0; }

TEST(Clearance, SolesThatCarryAreExemptFromTheFloor) {
  const Scenario scenario = box();
  const Clearance clearance(coman(), scenario, {});
  const Configuration x = standing(scenario);
  EXPECT_GT(worst_side(rows_at(clearance, x)), 0.0);  // a sole at 0 m that shall keep its distance
  EXPECT_LE(worst_side(rows_at(clearance, x, feet(scenario, x))), 0.0);
  EXPECT_LT(clearance.report(data_at(x), {}, {}).obstacle_excess, 0.0);
  const ClearanceReport report = clearance.report(data_at(x), feet(scenario, x), {});
  EXPECT_GE(report.obstacle_excess, 0.0) << report.worst_obstacle_pair;
  EXPECT_GT(report.self, 0.0) << report.worst_self_pair;
}

TEST(Clearance, OnlyTheLinkInContactIsExempt) {
  const Scenario scenario = box();
  const Clearance clearance(coman(), scenario, all_rows());
  const Configuration x = hands_above(scenario, 0.0);
  const RobotData data = data_at(x);
  const Contact wrist = make_contact(coman(), scenario, data, link_of("Lwrist"), 0);
  const Contact elbow = make_contact(coman(), scenario, data, link_of("Lelb"), 0);
  const auto none = rows_at(clearance, x).d.size();
  EXPECT_EQ(rows_at(clearance, x, {wrist}).d.size(), none - 1);  // its sphere to the box
  // Elbow and wrist put the forearm where it is: it goes, too.
  EXPECT_LT(rows_at(clearance, x, {wrist, elbow}).d.size(), none - 2);
  // The other surface still counts.
  Contact on_floor = wrist;
  on_floor.surface = kFloor;
  EXPECT_EQ(rows_at(clearance, x, {on_floor}).d.size(), none - 1);
}

TEST(Clearance, ALandingLinkMayComeNear) {
  const Scenario scenario = box();
  const ClearanceSettings settings;
  const Clearance clearance(coman(), scenario, settings);
  const std::vector<int> landing{link_of("Lwrist"), link_of("Rwrist")};
  for (const double above : {0.010, 0.005, 0.001}) {
    ASSERT_LT(above, settings.obstacle);
    const Configuration x = hands_above(scenario, above);
    const RobotData data = data_at(x);
    const int geom = coman().contacts[static_cast<std::size_t>(landing[0])].geom;
    const int body = coman().contacts[static_cast<std::size_t>(landing[0])].body;
    // The wrist's rows: those whose derivative is that of its lowest point's height.
    Jacobian3 J;
    point_jacobian(coman(), data, body, touch_point(coman(), data, landing[0]), J);
    const auto side_of_wrist = [&](const Inequalities& rows) {
      for (Eigen::Index r = 0; r < rows.d.size(); ++r) {
        if ((rows.C.row(r) - J.row(2)).norm() < 1e-6) {
          return rows.d[r];
        }
      }
      ADD_FAILURE() << "no row of " << coman().geoms[static_cast<std::size_t>(geom)].name;
      return 0.0;
    };
    EXPECT_GT(side_of_wrist(rows_at(clearance, x)), 0.0) << above;
    EXPECT_LE(side_of_wrist(rows_at(clearance, x, {}, landing)), 0.0) << above;
  }
  // Far from the surface a landing link keeps the full margin.
  const Configuration high = hands_above(scenario, 0.06);
  EXPECT_EQ(rows_at(clearance, high).d, rows_at(clearance, high, {}, landing).d);
}

TEST(Clearance, ViolatedMarginsAreWonBackOnlyWhereAskedFor) {
  const Scenario scenario = box();
  const Clearance clearance(coman(), scenario, {});
  const RobotData data = data_at(hands_above(scenario, 0.004));
  for (const bool may_recover : {true, false}) {
    Inequalities rows{Eigen::MatrixXd(0, coman().velocity_count()), Eigen::VectorXd(0)};
    clearance.constrain(data, {}, {}, may_recover, rows);
    EXPECT_EQ(worst_side(rows) > 0.0, may_recover);
  }
}

TEST(Clearance, LinksThatOverlapAreReported) {
  Configuration x = standing();
  x.q[joint_of("LHipLat")] = coman().joints[static_cast<std::size_t>(joint_of("LHipLat"))].lower;
  x.q[joint_of("RHipLat")] = coman().joints[static_cast<std::size_t>(joint_of("RHipLat"))].upper;
  const Clearance clearance(coman(), box(), {});
  const ClearanceReport report = clearance.report(data_at(x), {}, {});
  EXPECT_LT(report.self, 0.0);
  EXPECT_NE(report.worst_self_pair.find(" - "), std::string::npos);
}

/// Who stays clear of the grown obstacle hits the obstacle nowhere that it may be.
TEST(Clearance, RoomForAnObstacleThatIsElsewhereIsEnough) {
  ClearanceSettings settings;
  settings.elsewhere = {.position = 0.02, .yaw = 0.035, .height = 0.01};
  settings.spare = 0.0;
  settings.obstacle = -kFar;  // the floor does not matter here
  const Scenario scenario = box();
  ObstacleBox higher = scenario.obstacles[0];
  higher.half_extents.z() += 0.005;
  higher.center.z() += 0.005;
  const Clearance roomy(coman(), scenario, settings);
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int near = 0;
  double least = 1.0;
  for (int trial = 0; trial < 4000 && near < 60; ++trial) {
    Configuration x = random_posture(generator);
    x.X_WB.p += Eigen::Vector3d(0.3 * unit(generator), 0.2 * unit(generator), 0.3);
    const double room = roomy.report(data_at(x), {}, {}).obstacle_excess;
    if (room < 0.0 || room > 0.005) continue;
    ++near;
    for (int start = 0; start < 40; ++start) {
      const double direction = M_PI * unit(generator);
      const Eigen::Vector3d shift(0.02 * std::cos(direction), 0.02 * std::sin(direction), 0.0);
      const Eigen::Matrix3d turn = rotation_exp({0.0, 0.0, std::copysign(0.035, unit(generator))});
      Configuration moved = x;
      moved.X_WB.R = turn * x.X_WB.R;
      moved.X_WB.p = scenario.start_position + turn * (x.X_WB.p - scenario.start_position) + shift;
      const RobotData data = data_at(moved);
      for (const Geom& geom : coman().geoms) {
        const Solid link = place(geom, data.X_WB[static_cast<std::size_t>(geom.body)]);
        const double left = signed_distance(link, solid_of(higher)).value;
        EXPECT_GT(left, 0.0) << geom.name;
        least = std::min(least, left);
      }
    }
  }
  EXPECT_GE(near, 20);
  EXPECT_LT(least, 0.01) << "room that nothing needs";
}

}  // namespace
}  // namespace clamber
