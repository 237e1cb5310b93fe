// What a certificate holds for in an uncertain world, against brute force: the robot put elsewhere,
// the obstacle at another height, every combination of wrong masses, tilted ground.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <random>

#include "certificate/support_polygon.hpp"
#include "certificate/writer.hpp"
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

/// Joint torques and residual of a robot with other masses under the forces.
struct Held {
  double moment, force, torque_slack, cone_slack;
};
Held statics_of(const Case& c, const RobotModel& model, std::size_t i,
                const std::vector<Eigen::Vector3d>& forces) {
  const Uncertainty u;
  Measure measure(model, c.scenario, c.motion, u);
  measure.place(c.times[i]);
  JointVector tau;
  Eigen::Vector3d force, moment;
  measure.statics(c.certificate.samples[i].touching, forces, tau, force, moment);
  Held out{moment.norm(), force.norm(), 1e9, 1e9};
  for (Eigen::Index j = 0; j < tau.size(); ++j)
    out.torque_slack =
        std::min(out.torque_slack,
                 c.model.joints[static_cast<std::size_t>(j)].torque_limit - std::abs(tau[j]));
  for (const Eigen::Vector3d& f : forces)
    out.cone_slack = std::min(out.cone_slack, measure.friction() * f.z() - f.head<2>().norm());
  return out;
}

/// The sample's forces, changed by the least that balances another model, weighted by cone slack.
std::vector<Eigen::Vector3d> carried(const Case& c, const RobotModel& model, std::size_t i) {
  const CertificateSample& s = c.certificate.samples[i];
  Measure measure(c.model, c.scenario, c.motion, {});
  measure.place(c.times[i]);
  RobotData data;
  forward_kinematics(model, measure.state().x, data);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t p = 0; p < measure.candidates().size(); ++p)
    if ((s.touching >> p & 1) != 0) points.push_back(measure.touch_point(p));
  Eigen::MatrixXd G(6, 3 * static_cast<Eigen::Index>(points.size()));
  Eigen::VectorXd root(G.cols()), f(G.cols());
  Eigen::Matrix<double, 6, 1> load = Eigen::Matrix<double, 6, 1>::Zero();
  for (std::size_t p = 0; p < points.size(); ++p) {
    const auto at = 3 * static_cast<Eigen::Index>(p);
    f.segment<3>(at) = s.forces[p];
    const double slack = measure.friction() * s.forces[p].z() - s.forces[p].head<2>().norm();
    root.segment<3>(at).setConstant(slack < 0.1 ? 0.0 : std::sqrt(slack));
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Eigen::Vector3d e = Eigen::Vector3d::Unit(k);
      G.col(at + k) << e, points[p].cross(e);
    }
  }
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Eigen::Vector3d weight(0, 0, model.bodies[b].mass * kGravity);
    load.head<3>() += weight;
    load.tail<3>() += data.com_W[b].cross(weight);
  }
  const Eigen::MatrixXd scaled = G * root.asDiagonal();
  f += root.cwiseProduct(
      scaled.completeOrthogonalDecomposition().solve(Eigen::VectorXd(load - G * f)));
  std::vector<Eigen::Vector3d> out;
  for (std::size_t p = 0; p < points.size(); ++p)
    out.push_back(f.segment<3>(3 * static_cast<Eigen::Index>(p)));
  return out;
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
        RobotModel other = c->model;
        for (Body& body : other.bodies) body.mass *= 1.0 + (random() % 2 == 0 ? held : -held);
        const Held now = statics_of(*c, other, i, carried(*c, other, i));
        EXPECT_LT(now.force, 1e-6);
        EXPECT_LT(now.moment, 1e-6);
        EXPECT_GE(now.torque_slack, -1e-6) << c->times[i].time;
        EXPECT_GE(now.cone_slack, -2e-6) << c->times[i].time;
      }
    }
    std::printf("masses held: %.4f, %d samples compared\n", least, compared);
    EXPECT_GT(compared, 10);
  }
}

/// The bound is not loose: some combination of signs reaches a limit.
TEST(Uncertainty, SomeCombinationOfMassesReachesTheLimit) {
  for (const auto& c : cases()) {
    for (std::size_t i = 0; i < c->times.size(); i += 4 * stride(*c)) {
      const double held = c->certificate.samples[i].measured.value[Quantity::kMassHeld];
      if (held <= 1e-3 || held >= Measure::kMostMass - 1e-9) continue;
      const Held nominal = statics_of(*c, c->model, i, carried(*c, c->model, i));
      // What each mass alone takes from every slack, found by differences.
      std::vector<Eigen::Vector3d> base = carried(*c, c->model, i);
      double worst = 0.0;
      for (std::size_t p = 0; p < base.size(); ++p) {
        double change = 0.0;
        for (std::size_t b = 0; b < c->model.bodies.size(); ++b) {
          RobotModel other = c->model;
          other.bodies[b].mass *= 1.5;
          const Eigen::Vector3d d = (carried(*c, other, i)[p] - base[p]) / 0.5;
          change += 0.5 * std::abs(d.z()) + d.head<2>().norm();
        }
        // At the certified friction, 0.625 of the scenario's 0.8.
        const double slack = 0.625 * c->scenario.friction * base[p].z() - base[p].head<2>().norm();
        if (slack >= 0.1) worst = std::max(worst, change * held / std::max(slack, 1e-12));
      }
      EXPECT_LE(worst, 1.0 + 1e-3);
      EXPECT_GE(nominal.torque_slack, 0.0);
    }
  }
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
