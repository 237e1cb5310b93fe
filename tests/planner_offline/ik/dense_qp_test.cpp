#include "planner_offline/ik/dense_qp.hpp"

#include <gtest/gtest.h>

#include "tests/planner_offline/ik/qp_problems.hpp"

namespace clamber {
namespace {

using testing::feasible_qp;
using testing::kkt_error;
using testing::QpSize;
using testing::Random;

constexpr double kKktTolerance = 1e-9;

class RandomPrograms : public ::testing::TestWithParam<QpSize> {};

TEST_P(RandomPrograms, SatisfyTheKktConditions) {
  Random random(7);
  DenseQp qp;
  int active = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const QpProblem p = feasible_qp(GetParam(), random);
    ASSERT_EQ(qp.solve(p), QpStatus::optimal) << "trial " << trial;
    EXPECT_LT(kkt_error(p, qp), kKktTolerance) << "trial " << trial;
    active += static_cast<int>(qp.active_set().size());
  }
  EXPECT_GE(active, 60 * GetParam().equalities);
}

INSTANTIATE_TEST_SUITE_P(Sizes, RandomPrograms,
                         ::testing::Values(QpSize{1, 0, 3, true}, QpSize{5, 2, 0, false},
                                           QpSize{8, 0, 30, false}, QpSize{29, 6, 100, true},
                                           QpSize{38, 30, 150, true}, QpSize{60, 6, 200, true},
                                           QpSize{12, 12, 20, false}));

TEST(DenseQp, WithoutConstraintsIsTheNewtonStep) {
  QpProblem p;
  p.H = Eigen::Vector2d(2.0, 4.0).asDiagonal();
  p.g = Eigen::Vector2d(-2.0, 8.0);
  DenseQp qp;
  ASSERT_EQ(qp.solve(p), QpStatus::optimal);
  EXPECT_NEAR(qp.x()[0], 1.0, 1e-15);
  EXPECT_NEAR(qp.x()[1], -2.0, 1e-15);
}

TEST(DenseQp, ReportsActiveSetAndMultipliers) {
  QpProblem p;  // project (3, -2) onto x0 + x1 >= 2, x0 <= 1.5
  p.H.setIdentity(2, 2);
  p.g = Eigen::Vector2d(-3.0, 2.0);
  p.C = Eigen::RowVector2d(1.0, 1.0);
  p.d = Eigen::VectorXd::Constant(1, 2.0);
  p.lower = Eigen::Vector2d::Constant(-kInfinity);
  p.upper = Eigen::Vector2d(1.5, kInfinity);
  DenseQp qp;
  ASSERT_EQ(qp.solve(p), QpStatus::optimal);
  EXPECT_NEAR(qp.x()[0], 1.5, 1e-14);
  EXPECT_NEAR(qp.x()[1], 0.5, 1e-14);
  EXPECT_NEAR(qp.inequality_multipliers()[0], 2.5, 1e-13);
  EXPECT_NEAR(qp.bound_multipliers()[0], -4.0, 1e-13);
  EXPECT_EQ(qp.active_set().size(), 2U);
}

TEST(DenseQp, ToleratesDependentRows) {
  Random random(11);
  DenseQp qp;
  for (int trial = 0; trial < 40; ++trial) {
    QpProblem p = feasible_qp({20, 8, 30, true}, random);
    DenseQp plain;
    ASSERT_EQ(plain.solve(p), QpStatus::optimal);
    // Equalities: repeated, scaled and summed. Inequalities: every row twice, one of them scaled.
    const Eigen::MatrixXd mix = random.matrix(24, 8);
    p.A_eq = (mix * p.A_eq).eval();
    p.b_eq = (mix * p.b_eq).eval();
    p.C = (Eigen::MatrixXd(60, 20) << p.C, 3.0 * p.C).finished();
    p.d = (Eigen::VectorXd(60) << p.d, 3.0 * p.d).finished();
    ASSERT_EQ(qp.solve(p), QpStatus::optimal) << "trial " << trial;
    EXPECT_LT(kkt_error(p, qp), 1e-8) << "trial " << trial;
    EXPECT_LT((qp.x() - plain.x()).norm(), 1e-8) << "trial " << trial;
  }
}

TEST(DenseQp, SolvesDegenerateVertices) {
  // 80 half spaces through one point that is the optimum: far more active than dimensions.
  Random random(13);
  DenseQp qp;
  for (int trial = 0; trial < 40; ++trial) {
    QpProblem p;
    const Eigen::VectorXd vertex = random.vector(10);
    p.H.setIdentity(10, 10);
    p.C = random.matrix(80, 10);
    p.d = p.C * vertex;
    // The target lies in the polar cone, so that the projection is the vertex itself.
    p.g = -(vertex - p.C.transpose() * random.vector(80).cwiseAbs());
    ASSERT_EQ(qp.solve(p), QpStatus::optimal);
    EXPECT_LT((qp.x() - vertex).norm(), 1e-9);
    EXPECT_LT(kkt_error(p, qp), kKktTolerance);
  }
}

TEST(DenseQp, FixedVariablesAndPairsOfOppositeRows) {
  Random random(17);
  QpProblem p = feasible_qp({10, 2, 10, true}, random);
  p.lower.head(4) = p.upper.head(4) = 0.5 * (p.lower.head(4) + p.upper.head(4)).eval();
  p.A_eq.resize(0, 10);
  p.b_eq.resize(0);
  p.C = (Eigen::MatrixXd(2, 10) << p.C.row(0), -p.C.row(0)).finished();
  const Eigen::VectorXd middle = 0.5 * (p.lower + p.upper);
  p.d = p.C * middle;
  DenseQp qp;
  ASSERT_EQ(qp.solve(p), QpStatus::optimal);
  EXPECT_EQ(qp.x().head(4), p.lower.head(4));
  EXPECT_LT(kkt_error(p, qp), kKktTolerance);
}

TEST(DenseQp, FrictionPyramidsUnderAWrench) {
  Random random(19);
  Eigen::Matrix<double, 6, 1> wrench;
  wrench << 60.0, 0.0, 290.0, 10.0, -20.0, 0.0;
  QpProblem p = testing::contact_force_qp(20, wrench, random);
  DenseQp qp;
  ASSERT_EQ(qp.solve(p), QpStatus::optimal);
  EXPECT_LT(kkt_error(p, qp), 1e-8);
  p.b_eq[0] = 146.0;  // more than friction holds: 0.5 * 290
  EXPECT_EQ(qp.solve(p), QpStatus::infeasible);
  p.b_eq[0] = 0.0;
  p.b_eq[2] = 1201.0;  // more than 20 * 60
  EXPECT_EQ(qp.solve(p), QpStatus::infeasible);
}

TEST(DenseQp, FindsInfeasibilityEveryTime) {
  // Farkas: rows C with y'C = 0 and y'd > 0 for some y > 0 have no solution. The contradiction is
  // spread over many rows, by a margin between large and small.
  Random random(23);
  DenseQp qp;
  for (int trial = 0; trial < 200; ++trial) {
    QpProblem p = feasible_qp({15, 3, 40, trial % 2 == 0}, random);
    const int rows = random.integer(2, 16);
    const Eigen::VectorXd y = random.vector(rows).cwiseAbs().array() + 0.1;
    Eigen::MatrixXd contradiction = random.matrix(rows, 15);
    contradiction.row(0) =
        -(y.tail(rows - 1).transpose() * contradiction.bottomRows(rows - 1)) / y[0];
    Eigen::VectorXd sides = random.vector(rows);
    sides[0] =
        (std::pow(10.0, random.uniform(-5.0, 1.0)) - y.tail(rows - 1).dot(sides.tail(rows - 1))) /
        y[0];
    p.C = (Eigen::MatrixXd(40 + rows, 15) << p.C, contradiction).finished();
    p.d = (Eigen::VectorXd(40 + rows) << p.d, sides).finished();
    EXPECT_EQ(qp.solve(p), QpStatus::infeasible) << "trial " << trial;
  }
}

TEST(DenseQp, ContradictingEqualitiesAndBounds) {
  Random random(29);
  DenseQp qp;
  QpProblem p = feasible_qp({6, 3, 0, true}, random);
  p.A_eq.row(2) = p.A_eq.row(0) + p.A_eq.row(1);
  p.b_eq[2] = p.b_eq[0] + p.b_eq[1] + 1e-3;
  EXPECT_EQ(qp.solve(p), QpStatus::infeasible);
  p = feasible_qp({6, 0, 0, true}, random);
  std::swap(p.lower[3], p.upper[3]);
  EXPECT_EQ(qp.solve(p), QpStatus::infeasible);
  p = feasible_qp({6, 0, 1, false}, random);
  p.C.setZero();
  p.d[0] = 1.0;
  EXPECT_EQ(qp.solve(p), QpStatus::infeasible);
  p.d[0] = 0.0;
  EXPECT_EQ(qp.solve(p), QpStatus::optimal);
}

TEST(DenseQp, RefusesWhatItCannotSolve) {
  Random random(31);
  DenseQp qp;
  QpProblem p = feasible_qp({4, 1, 3, true}, random);
  p.H(2, 2) = -1.0;
  EXPECT_EQ(qp.solve(p), QpStatus::not_convex);
  p = feasible_qp({4, 1, 3, true}, random);
  p.d[1] = std::nan("");
  EXPECT_EQ(qp.solve(p), QpStatus::invalid_problem);
  p = feasible_qp({4, 1, 3, true}, random);
  p.lower.resize(3);
  p.lower.setZero();
  EXPECT_EQ(qp.solve(p), QpStatus::invalid_problem);
}

TEST(DenseQp, RegulariseMakesSemidefiniteDefinite) {
  Random random(37);
  QpProblem p = feasible_qp({12, 0, 20, true}, random);
  const Eigen::MatrixXd root = random.matrix(12, 4);
  p.H = root * root.transpose();
  regularise(p.H);
  DenseQp qp;
  ASSERT_EQ(qp.solve(p), QpStatus::optimal);
  EXPECT_LT(kkt_error(p, qp), 1e-6);  // the Hessian's condition is 1e10
}

TEST(DenseQp, SameInputSameBytes) {
  Random random(41);
  const QpProblem p = feasible_qp({30, 6, 80, true}, random);
  const QpProblem other = feasible_qp({40, 3, 20, false}, random);
  DenseQp qp;
  ASSERT_EQ(qp.solve(p), QpStatus::optimal);
  const Eigen::VectorXd first = qp.x();
  ASSERT_EQ(qp.solve(other), QpStatus::optimal);
  ASSERT_EQ(qp.solve(p), QpStatus::optimal);
  EXPECT_EQ(first, qp.x());
}

}  // namespace
}  // namespace clamber
