// The motion is the controller's, the bounds between samples hold, and the margins are what brute
// force finds: programs solved again by ALGLIB, distances by the planner's formulas.
// With CLAMBER_CLIMB set to a folder of `clamber climb`, that plan is checked as well.
#include "certificate/measure.hpp"

#include <gtest/gtest.h>
#include <libalglib/optimization.h>

#include <bit>
#include <cstdlib>
#include <filesystem>

#include "certificate/writer.hpp"
#include "control/plan_image.hpp"
#include "planner_offline/plan_image.hpp"
#include "robot_model/loader.hpp"
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

std::vector<std::unique_ptr<Case>> cases() {
  std::vector<std::unique_ptr<Case>> out;
  const auto& made = test::made_plan();
  out.push_back(std::make_unique<Case>(made.model, made.scenario, test::text_of(made.plan)));
  if (const char* climb = std::getenv("CLAMBER_CLIMB"))
    out.push_back(std::make_unique<Case>(made.model,
                                         load_scenario(std::filesystem::path(CLAMBER_SOURCE_DIR) /
                                                       "configs/scenarios/box_0.275.yaml"),
                                         read_file(std::filesystem::path(climb) / "plan.json")));
  return out;
}

TEST(PlannedMotion, JointsAreTheControllersToTheLastBit) {
  const auto& made = test::made_plan();
  const PlannedMotion motion(test::text_of(made.plan), "plan", made.model, made.scenario);
  const std::vector<std::byte> image = plan_to_image(made.plan, std::string(64, '0'));
  const std::vector<double> low(23, -10.0), high(23, 10.0), torque(23, 100.0);
  PlanImageView view;
  ASSERT_EQ(open_plan_image(image, {made.model.hash, low, high, torque}, view),
            PlanImageStatus::kOk);
  ClampedSpline<PlanImageView> spline;
  std::vector<double> workspace(spline.workspace_size(view.size(), view.dimensions()));
  ASSERT_EQ(spline.build(view, workspace), SplineStatus::kOk);
  std::size_t segment = 0;
  MotionState state;
  for (double t = 0.0; t < motion.duration(); t += 0.0137) {
    spline.locate(t, segment);
    motion.evaluate(t, segment, state);
    for (std::size_t j = 0; j < 23; ++j)
      EXPECT_EQ(state.x.q[static_cast<Eigen::Index>(j)], spline.evaluate(t, segment, j).value);
  }
}

TEST(Measure, BoundsHoldBetweenSamples) {
  for (const auto& c : cases()) {
    Measure measure(c->model, c->scenario, c->motion, {});
    const auto& samples = c->certificate.samples;
    std::array<double, kQuantityCount> tightest{};
    const std::size_t stride = samples.size() > 1000 ? 7 : 1;
    for (std::size_t i = 0; i + 1 < samples.size(); i += stride) {
      if (c->times[i].after == 0.0) continue;
      for (const double u : {0.1, 0.25, 0.5, 0.75, 0.9}) {
        const SampleTime at{c->times[i].time + u * c->times[i].after, c->times[i].segment, 0.0,
                            0.0};
        measure.place(at);
        std::vector<Eigen::Vector3d> forces;
        for (std::size_t p = 0; p < samples[i].forces.size(); ++p)
          forces.emplace_back((1.0 - u) * samples[i].forces[p] + u * samples[i + 1].forces[p]);
        const Measured there = measure.measure(samples[i].touching, forces, 0.0);
        for (std::size_t q = 0; q < kQuantityCount; ++q) {
          const auto quantity = static_cast<Quantity>(q);
          if (kQuantities[q].sense == Sense::kRecord || quantity == Quantity::kSlip ||
              quantity == Quantity::kSupportMarginMoving)
            continue;  // slip is summed from sample to sample; the moving margin has no bound
          const double sign = kQuantities[q].sense == Sense::kError ? -1.0 : 1.0;
          const auto proven = [&](const Measured& m) {
            return m.value.values[q] - sign * m.gap.values[q];
          };
          const double a = proven(samples[i].measured), b = proven(samples[i + 1].measured);
          const double bound = sign > 0.0 ? std::min(a, b) : std::max(a, b);
          EXPECT_GE(sign * (there.value.values[q] - bound), -1e-9)
              << kQuantities[q].name << " at " << at.time;
          tightest[q] = std::max(tightest[q], 0.0);
        }
      }
    }
  }
}

// ---- brute force ----

alglib::real_2d_array to_alglib(const Eigen::MatrixXd& m) {
  alglib::real_2d_array out;
  out.setlength(m.rows(), m.cols());
  for (Eigen::Index r = 0; r < m.rows(); ++r)
    for (Eigen::Index c = 0; c < m.cols(); ++c) out[r][c] = m(r, c);
  return out;
}

alglib::real_1d_array to_alglib(const Eigen::VectorXd& v) {
  alglib::real_1d_array out;
  out.setcontent(v.size(), v.data());
  return out;
}

constexpr double kNone = std::numeric_limits<double>::infinity();

struct Statics {
  Eigen::MatrixXd G, J;  // wrench and joint torque per force
  VelocityVector g;
  Eigen::VectorXd limit;
};

Statics statics_at(const Case& c, const Measure& measure, TouchMask mask) {
  Statics s;
  const Eigen::Index count = std::popcount(mask), n = c.model.joint_count();
  s.G.resize(6, 3 * count);
  s.J.resize(n, 3 * count);
  for (Eigen::Index p = 0; mask != 0; mask &= mask - 1, ++p) {
    const auto i = static_cast<std::size_t>(std::countr_zero(mask));
    Jacobian3 block;
    point_jacobian(c.model, measure.data(), measure.candidates()[i].body, measure.touch_point(i),
                   block);
    s.G.middleCols<3>(3 * p) = block.leftCols<6>().transpose();
    s.J.middleCols<3>(3 * p) = block.rightCols(n).transpose();
  }
  gravity_torque(c.model, measure.data(), s.g);
  s.limit.resize(n);
  for (Eigen::Index j = 0; j < n; ++j)
    s.limit[j] = c.model.joints[static_cast<std::size_t>(j)].torque_limit;
  return s;
}

/// Cone of 16 faces inside the friction cone, as rows C f >= 0.
Eigen::MatrixXd cone_rows(Eigen::Index points, double mu) {
  constexpr int kFaces = 16;
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(kFaces * points, 3 * points);
  for (Eigen::Index p = 0; p < points; ++p)
    for (int k = 0; k < kFaces; ++k) {
      const double angle = 2.0 * M_PI * k / kFaces;
      C(kFaces * p + k, 3 * p) = -std::cos(angle);
      C(kFaces * p + k, 3 * p + 1) = -std::sin(angle);
      C(kFaces * p + k, 3 * p + 2) = mu * std::cos(M_PI / kFaces);
    }
  return C;
}

/// The forces whose torques are nearest to the plan's, by ALGLIB's interior-point method.
double resolved_torque_slack(const Case& c, const Statics& s, const JointVector& tau, double mu) {
  const Eigen::Index n = s.G.cols(), joints = s.limit.size();
  const Eigen::MatrixXd W = s.limit.cwiseInverse().asDiagonal() * s.J;
  const Eigen::MatrixXd H = W.transpose() * W + 1e-8 * Eigen::MatrixXd::Identity(n, n);
  const Eigen::VectorXd linear = -W.transpose() * (s.g.tail(joints) - tau).cwiseQuotient(s.limit);
  const Eigen::MatrixXd C = cone_rows(n / 3, mu);
  Eigen::MatrixXd A(6 + C.rows(), n);
  A << s.G, C;
  Eigen::VectorXd low = Eigen::VectorXd::Zero(A.rows()),
                  high = Eigen::VectorXd::Constant(A.rows(), kNone);
  low.head<6>() = high.head<6>() = s.g.head<6>();
  alglib::minqpstate state;
  alglib::minqpcreate(n, state);
  alglib::minqpsetquadraticterm(state, to_alglib(H));
  alglib::minqpsetlinearterm(state, to_alglib(linear));
  alglib::minqpsetlc2dense(state, to_alglib(A), to_alglib(low), to_alglib(high), A.rows());
  alglib::minqpsetalgodenseipm(state, 1e-10);
  alglib::minqpoptimize(state);
  alglib::real_1d_array x;
  alglib::minqpreport report;
  alglib::minqpresults(state, x, report);
  EXPECT_GT(report.terminationtype, 0);
  Eigen::VectorXd f(n);
  for (Eigen::Index i = 0; i < n; ++i) f[i] = x[i];
  const Eigen::VectorXd torque = s.g.tail(joints) - s.J * f;
  (void)c;
  return (s.limit - torque.cwiseAbs()).minCoeff();
}

/// How far the point can go from `at` along `u` inside the convex hull of `points`: a linear
/// program.
double ray_length(const std::vector<Eigen::Vector2d>& points, const Eigen::Vector2d& at,
                  const Eigen::Vector2d& u) {
  const auto n = static_cast<Eigen::Index>(points.size());
  Eigen::VectorXd cost = Eigen::VectorXd::Zero(n + 1), low = cost,
                  high = Eigen::VectorXd::Constant(n + 1, 10.0);
  cost[n] = -1.0;
  low[n] = -10.0;
  Eigen::MatrixXd A(3, n + 1);
  for (Eigen::Index i = 0; i < n; ++i) A.col(i) << points[static_cast<std::size_t>(i)], 1.0;
  A.col(n) << -u, 0.0;
  const Eigen::Vector3d equal(at.x(), at.y(), 1.0);
  alglib::minlpstate state;
  alglib::minlpcreate(n + 1, state);
  alglib::minlpsetcost(state, to_alglib(cost));
  alglib::minlpsetbc(state, to_alglib(low), to_alglib(high));
  alglib::minlpsetlc2dense(state, to_alglib(A), to_alglib(Eigen::VectorXd(equal)),
                           to_alglib(Eigen::VectorXd(equal)), 3);
  alglib::minlpoptimize(state);
  alglib::real_1d_array x;
  alglib::minlpreport report;
  alglib::minlpresults(state, x, report);
  EXPECT_GT(report.terminationtype, 0);
  return x[n];
}

TEST(Measure, MarginsAgreeWithBruteForceWithinOnePercent) {
  for (const auto& c : cases()) {
    Measure measure(c->model, c->scenario, c->motion, {});
    const auto& samples = c->certificate.samples;
    double worst_torque = 0.0, worst_support = 0.0;
    int checked = 0;
    const std::size_t stride = samples.size() / 60;
    for (std::size_t i = stride / 2; i < samples.size(); i += stride, ++checked) {
      measure.place(c->times[i]);
      const TouchMask mask = samples[i].touching;
      const QuantityValues& value = samples[i].measured.value;

      const Statics s = statics_at(*c, measure, mask);
      JointVector tau;
      c->motion.feed_forward(c->times[i].time, c->times[i].segment, tau);
      const double slack = resolved_torque_slack(*c, s, tau, measure.friction());
      const double torque_error = std::abs(slack / value[Quantity::kTorqueSlack] - 1.0);
      EXPECT_LT(torque_error, 0.01) << "torque slack at " << samples[i].time;
      worst_torque = std::max(worst_torque, torque_error);

      std::vector<Eigen::Vector2d> points;
      for (TouchMask rest = mask; rest != 0; rest &= rest - 1)
        points.emplace_back(
            measure.touch_point(static_cast<std::size_t>(std::countr_zero(rest))).head<2>());
      double least = kNone;
      constexpr int kDirections = 180;
      for (int k = 0; k < kDirections; ++k) {
        const double angle = 2.0 * M_PI * k / kDirections;
        least = std::min(least, ray_length(points, measure.data().com.head<2>(),
                                           {std::cos(angle), std::sin(angle)}));
      }
      const double support_error = std::abs(least / value[Quantity::kSupportMargin] - 1.0);
      EXPECT_LT(support_error, 0.01) << "support margin at " << samples[i].time;
      worst_support = std::max(worst_support, support_error);
    }
    std::printf("%d samples: torque slack within %.3f %%, support margin within %.3f %%\n", checked,
                100.0 * worst_torque, 100.0 * worst_support);
    EXPECT_GE(checked, 50);
  }
}

}  // namespace
}  // namespace clamber
