// What a certificate holds for in an uncertain world, against brute force: the robot put elsewhere,
// the obstacle at another height, every combination of wrong masses, tilted ground.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <random>

#include "certificate/support_polygon.hpp"
#include "certificate/writer.hpp"
#include "planner_offline/ik/dense_qp.hpp"
#include "robot_model/kinematics.hpp"
#include "robot_model/read_file.hpp"
#include "tests/certificate/made_plan.hpp"

namespace clamber {
namespace {

struct Case {
  Case(const RobotModel& robot, const Scenario& world, std::string plan)
      : model(robot),
        scenario(world),
        text(std::move(plan)),
        motion(text, "plan", model, scenario),
        certificate(certify(motion, model, scenario, {})),
        times(sample_times(motion, certificate.header.spacing)) {}
  RobotModel model;
  Scenario scenario;
  std::string text;
  PlannedMotion motion;
  Certificate certificate;
  std::vector<SampleTime> times;
};

/// The made plan, and with CLAMBER_CLIMB=<folder of a climb> that one.
const std::vector<std::unique_ptr<Case>>& cases() {
  static const std::vector<std::unique_ptr<Case>> all = [] {
    std::vector<std::unique_ptr<Case>> out;
    const auto& made = test::made_plan();
    out.push_back(std::make_unique<Case>(made.model, made.scenario, test::text_of(made.plan)));
    if (const char* climb = std::getenv("CLAMBER_CLIMB"))
      out.push_back(std::make_unique<Case>(made.model,
                                           load_scenario(std::filesystem::path(CLAMBER_SOURCE_DIR) /
                                                         "configs/scenarios/box_0.275.yaml"),
                                           read_file(std::filesystem::path(climb) / "plan.json")));
    return out;
  }();
  return all;
}

std::size_t stride(const Case& c) { return c.times.size() > 1000 ? 83 : 19; }

/// Seen from the robot, the obstacle after the robot started elsewhere.
Scenario seen_from(const Scenario& scenario, const Eigen::Vector2d& shift, double yaw,
                   double height) {
  Scenario out = scenario;
  const Eigen::Matrix3d back = Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  for (ObstacleBox& box : out.obstacles) {
    Eigen::Vector3d p = box.center - scenario.start_position;
    p.head<2>() -= shift;
    box.center = scenario.start_position + back * p;
    box.yaw -= yaw;
    box.half_extents.z() += 0.5 * height;
    box.center.z() += 0.5 * height;
  }
  return out;
}

TEST(Uncertainty, NothingIsHitFromAnyStartThatIsHeld) {
  const Uncertainty u;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (const auto& c : cases()) {
    double least = 1.0;
    for (const CertificateSample& s : c->certificate.samples)
      least = std::min(least, s.measured.value[Quantity::kStartHeld]);
    const double share = std::max(0.0, least);
    std::printf("start held: %.3f\n", share);
    for (int draw = 0; draw < 12; ++draw) {
      const double direction = M_PI * unit(random);
      const Eigen::Vector2d shift =
          share * u.start_position * Eigen::Vector2d(std::cos(direction), std::sin(direction));
      // Turning less than all and shifting as far: the share bounds their sum.
      const double yaw = (draw % 2 == 0 ? 1.0 : -1.0) * share * u.start_yaw;
      const Scenario there = seen_from(c->scenario, shift, yaw, u.height * (draw % 3 - 1));
      Measure measure(c->model, there, c->motion, u);
      for (std::size_t i = 0; i < c->times.size(); i += stride(*c)) {
        measure.place(c->times[i]);
        const Measured m = measure.measure(c->certificate.samples[i].touching,
                                           c->certificate.samples[i].forces, 0);
        EXPECT_GE(m.value[Quantity::kObstacleClearance], -1e-6) << c->times[i].time;
        EXPECT_GE(m.value[Quantity::kEdgeDistance], -1e-6) << c->times[i].time;
      }
    }
  }
}

TEST(Uncertainty, AHigherObstacleIsHitWhereItIsNoLongerHeld) {
  for (const auto& c : cases()) {
    Measure measure(c->model, c->scenario, c->motion, {});
    int found = 0;
    for (std::size_t i = 0; i < c->times.size(); i += stride(*c)) {
      const CertificateSample& s = c->certificate.samples[i];
      const double held = s.measured.value[Quantity::kHeightHeld];
      if (held <= 0.0 || held >= Measure::kMostHeight - 1e-9) continue;
      ++found;
      for (const auto& [height, free] : {std::pair{held - 1e-5, true}, {held + 1e-4, false}}) {
        const Scenario higher = seen_from(c->scenario, {0, 0}, 0.0, height);
        Measure there(c->model, higher, c->motion, {});
        there.place(c->times[i]);
        const double clearance =
            there.measure(s.touching, s.forces, 0).value[Quantity::kObstacleClearance];
        EXPECT_EQ(clearance >= 0.0, free) << c->times[i].time << ' ' << height;
      }
    }
    std::printf("heights compared: %d\n", found);
  }
}

/// Whether some forces within cones and torque limits carry another model in the sample's posture:
/// a program of its own, with sixteen faces inside each cone.
bool can_be_carried(const Case& c, const RobotModel& model, std::size_t i, TouchMask mask) {
  constexpr Eigen::Index kFaces = 16;
  Measure measure(model, c.scenario, c.motion, {});
  measure.place(c.times[i]);
  const RobotData& data = measure.data();
  const auto points = static_cast<Eigen::Index>(std::popcount(mask));
  const Eigen::Index n = model.joint_count();
  Eigen::MatrixXd J(3 * points, model.velocity_count());
  for (std::size_t p = 0, at = 0; p < measure.candidates().size(); ++p) {
    if ((mask >> p & 1) == 0) continue;
    Jacobian3 block;
    point_jacobian(model, data, measure.candidates()[p].body, measure.touch_point(p), block);
    J.middleRows<3>(3 * static_cast<Eigen::Index>(at++)) = block;
  }
  VelocityVector g;
  gravity_torque(model, data, g);
  QpProblem qp;
  qp.H = Eigen::MatrixXd::Identity(3 * points, 3 * points);
  qp.g = Eigen::VectorXd::Zero(3 * points);
  qp.A_eq = J.leftCols<6>().transpose();
  qp.b_eq = g.head<6>();
  qp.C = Eigen::MatrixXd::Zero(kFaces * points + 2 * n, 3 * points);
  qp.d = Eigen::VectorXd::Zero(qp.C.rows());
  for (Eigen::Index p = 0; p < points; ++p)
    for (Eigen::Index k = 0; k < kFaces; ++k) {
      const double angle = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(kFaces);
      qp.C.block<1, 3>(kFaces * p + k, 3 * p) << std::cos(angle), std::sin(angle),
          measure.friction() * std::cos(M_PI / static_cast<double>(kFaces));
    }
  qp.C.middleRows(kFaces * points, n) = J.rightCols(n).transpose();
  qp.C.bottomRows(n) = -qp.C.middleRows(kFaces * points, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double limit = model.joints[static_cast<std::size_t>(j)].torque_limit;
    qp.d[kFaces * points + j] = g[6 + j] - limit;
    qp.d[kFaces * points + n + j] = -g[6 + j] - limit;
  }
  DenseQp solver;
  return solver.solve(qp) == QpStatus::optimal;
}

RobotModel with_masses(RobotModel model, double share,
                       const std::function<bool(std::size_t)>& more) {
  for (std::size_t b = 0; b < model.bodies.size(); ++b)
    model.bodies[b].mass *= 1.0 + (more(b) ? share : -share);
  return model;
}

TEST(Uncertainty, EveryCombinationOfMassesThatIsHeldCanBeCarried) {
  std::mt19937 random(5);
  for (const auto& c : cases()) {
    double least = 1.0;
    int compared = 0;
    for (std::size_t i = 0; i < c->times.size(); i += stride(*c)) {
      const double held = c->certificate.samples[i].measured.value[Quantity::kMassHeld];
      least = std::min(least, held);
      if (held <= 0.0) continue;
      ++compared;
      for (int draw = 0; draw < 6; ++draw) {
        const RobotModel other =
            with_masses(c->model, held, [&](std::size_t) { return random() % 2 == 0; });
        EXPECT_TRUE(can_be_carried(*c, other, i, c->certificate.samples[i].touching))
            << c->times[i].time;
      }
    }
    std::printf("masses held: %.4f, %d samples compared\n", least, compared);
    EXPECT_GT(compared, 10);
  }
}

/// Share of wrong masses at which the robot tips over an edge of its support: there every mass
/// beyond the edge is too heavy and every one on this side too light.
double tips_at(const Case& c, const Measure& measure, TouchMask mask) {
  std::vector<Eigen::Vector2d> corners;
  for (std::size_t p = 0; p < measure.candidates().size(); ++p)
    if ((mask >> p & 1) != 0) corners.push_back(measure.touch_point(p).head<2>());
  double least = 1.0;
  for (const Eigen::Vector2d& a : corners)
    for (const Eigen::Vector2d& b : corners) {
      const Eigen::Vector2d inwards(a.y() - b.y(), b.x() - a.x());
      const bool is_edge = inwards.norm() > 1e-6 &&
                           std::none_of(corners.begin(), corners.end(),
                                        [&](const auto& p) { return inwards.dot(p - a) < -1e-9; });
      if (!is_edge) continue;
      double sum = 0.0, sizes = 0.0;
      for (std::size_t k = 0; k < c.model.bodies.size(); ++k) {
        const double moment =
            c.model.bodies[k].mass * inwards.dot(measure.data().com_W[k].head<2>() - a);
        sum += moment;
        sizes += std::abs(moment);
      }
      least = std::min(least, sum / sizes);
    }
  return least;
}

/// Three points leave no choice of vertical forces: held is all that does not tip the robot. Of
/// more points the forces are chosen, and most of it is held.
TEST(Uncertainty, MassesAreHeldUntilTheRobotTips) {
  const Case& c = *cases().front();
  std::mt19937 random(9);
  Measure measure(c.model, c.scenario, c.motion, {});
  int three = 0, exact = 0, more = 0;
  for (std::size_t i = 0; i < c.times.size(); i += 4 * stride(c)) {
    measure.place(c.times[i]);
    const TouchMask touching = c.certificate.samples[i].touching;
    for (TouchMask mask = touching; mask != 0; mask = (mask - 1) & touching) {
      const int points = std::popcount(mask);
      if (points < 3) continue;
      // No witness: what touches here is made up.
      const std::vector<Eigen::Vector3d> none(static_cast<std::size_t>(points),
                                              Eigen::Vector3d::Zero());
      const double held = measure.measure(mask, none, 0.0).value[Quantity::kMassHeld];
      const double tips = tips_at(c, measure, mask);
      if (tips < 0.01) {
        EXPECT_LE(held, std::max(0.0, tips) + 1e-9) << mask;
        continue;
      }
      if (tips > 0.4) continue;
      EXPECT_LE(held, tips + 1e-9);
      (points == 3 ? three : more) += 1;
      if (points == 3 && held > (1.0 - 1e-6) * tips) ++exact;
      EXPECT_GE(held, 0.7 * tips) << c.times[i].time << ' ' << mask;
      if (random() % 8 != 0) continue;
      const RobotModel other =
          with_masses(c.model, held, [&](std::size_t) { return random() % 2 == 0; });
      EXPECT_TRUE(can_be_carried(c, other, i, mask)) << c.times[i].time << ' ' << mask;
    }
  }
  std::printf("three points: %d, exactly: %d, more points: %d\n", three, exact, more);
  EXPECT_GT(three, 20);
  EXPECT_EQ(exact, three);
  EXPECT_GT(more, 20);
}

TEST(Uncertainty, TiltedGroundKeepsTheCentreOfMassSupported) {
  for (const auto& c : cases()) {
    Measure measure(c->model, c->scenario, c->motion, {});
    for (std::size_t i = 0; i < c->times.size(); i += stride(*c)) {
      const CertificateSample& s = c->certificate.samples[i];
      const double held = s.measured.value[Quantity::kTiltHeld];
      if (held <= 0.0) continue;
      measure.place(c->times[i]);
      for (int k = 0; k < 16; ++k) {
        const Eigen::Vector3d axis(std::cos(k * M_PI / 8), std::sin(k * M_PI / 8), 0.0);
        const Eigen::Matrix3d tilt = Eigen::AngleAxisd(held - 1e-9, axis).toRotationMatrix();
        std::vector<Eigen::Vector2d> corners;
        for (std::size_t p = 0; p < measure.candidates().size(); ++p)
          if ((s.touching >> p & 1) != 0)
            corners.push_back((tilt * measure.touch_point(p)).head<2>());
        EXPECT_GE(SupportPolygon(corners).margin((tilt * measure.data().com).head<2>()), -1e-7);
      }
    }
  }
}

}  // namespace
}  // namespace clamber
