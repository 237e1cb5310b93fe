// Our programs against ALGLIB's dense interior-point method. ALGLIB is GPL: it is linked into this
// program only, which is built where the library is found and never shipped.
#include <gtest/gtest.h>
#include <libalglib/optimization.h>

#include "planner_offline/ik/hqp.hpp"
#include "tests/planner_offline/ik/hqp_problems.hpp"

namespace clamber {
namespace {

using testing::level_residual;
using testing::Random;

alglib::real_2d_array to_alglib(const Eigen::MatrixXd& M) {
  alglib::real_2d_array a;
  a.setlength(M.rows(), M.cols());
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    for (Eigen::Index j = 0; j < M.cols(); ++j) a(i, j) = M(i, j);
  }
  return a;
}

alglib::real_1d_array to_alglib(const Eigen::VectorXd& v) {
  alglib::real_1d_array a;
  a.setcontent(v.size(), v.data());
  return a;
}

/// @returns false when the oracle finds no solution
bool oracle(const QpProblem& p, Eigen::VectorXd& x) {
  const Eigen::Index n = p.g.size();
  alglib::minqpstate state;
  alglib::minqpcreate(n, state);
  alglib::minqpsetquadraticterm(state, to_alglib(p.H));
  alglib::minqpsetlinearterm(state, to_alglib(p.g));
  const Eigen::VectorXd none = Eigen::VectorXd::Constant(n, kInfinity);
  alglib::minqpsetbc(state, to_alglib(p.lower.size() > 0 ? p.lower : Eigen::VectorXd(-none)),
                     to_alglib(p.upper.size() > 0 ? p.upper : none));
  const Eigen::Index rows = p.b_eq.size() + p.d.size();
  if (rows > 0) {
    Eigen::MatrixXd A(rows, n);
    Eigen::VectorXd low(rows);
    Eigen::VectorXd high(rows);
    if (p.b_eq.size() > 0) A.topRows(p.b_eq.size()) = p.A_eq;
    if (p.d.size() > 0) A.bottomRows(p.d.size()) = p.C;
    low << p.b_eq, p.d;
    high << p.b_eq, Eigen::VectorXd::Constant(p.d.size(), kInfinity);
    alglib::minqpsetlc2dense(state, to_alglib(A), to_alglib(low), to_alglib(high), rows);
  }
  alglib::minqpsetalgodenseipm(state, 1e-12);
  alglib::minqpoptimize(state);
  alglib::real_1d_array solution;
  alglib::minqpreport report;
  alglib::minqpresults(state, solution, report);
  x = Eigen::Map<const Eigen::VectorXd>(solution.getcontent(), n);
  return report.terminationtype > 0;
}

double objective(const QpProblem& p, const Eigen::VectorXd& x) {
  return 0.5 * x.dot(p.H * x) + p.g.dot(x);
}

TEST(DenseQpOracle, AgreesOnRandomPrograms) {
  Random random(101);
  DenseQp qp;
  double worst = 0.0;
  for (const testing::QpSize& size :
       {testing::QpSize{10, 3, 20, true}, testing::QpSize{29, 6, 100, true},
        testing::QpSize{38, 20, 150, true}, testing::QpSize{60, 6, 200, false}}) {
    for (int trial = 0; trial < 15; ++trial) {
      const QpProblem p = testing::feasible_qp(size, random);
      Eigen::VectorXd x;
      ASSERT_TRUE(oracle(p, x));
      ASSERT_EQ(qp.solve(p), QpStatus::optimal);
      worst = std::max(worst, std::abs(objective(p, qp.x()) - objective(p, x)) /
                                  (1.0 + std::abs(objective(p, x))));
      EXPECT_LT((qp.x() - x).norm(), 1e-4 * (1.0 + x.norm()));
    }
  }
  EXPECT_LT(worst, 1e-6);
  RecordProperty("worst_relative_objective_difference", std::to_string(worst));
}

/// The hierarchy as a cascade of oracle calls: each level a program with the levels before it as
/// equalities (their reached values, so that contradictions are not inherited).
Eigen::VectorXd oracle_cascade(const HqpProblem& p) {
  Eigen::VectorXd x;
  QpProblem qp;
  qp.lower = p.lower;
  qp.upper = p.upper;
  qp.C = p.C;
  qp.d = p.d;
  qp.A_eq.resize(0, p.n);
  for (const TaskLevel& level : p.levels) {
    qp.H = level.A.transpose() * level.A + 1e-10 * Eigen::MatrixXd::Identity(p.n, p.n);
    qp.g = -level.A.transpose() * level.b;
    EXPECT_TRUE(oracle(qp, x));
    const Eigen::Index before = qp.b_eq.size();
    qp.A_eq.conservativeResize(before + level.b.size(), p.n);
    qp.A_eq.bottomRows(level.b.size()) = level.A;
    qp.b_eq.conservativeResize(before + level.b.size());
    qp.b_eq.tail(level.b.size()) = level.A * x;
  }
  return x;
}

TEST(HqpOracle, AgreesWithACascadeOfOracleCalls) {
  Random random(103);
  Hqp solver;
  for (int trial = 0; trial < 30; ++trial) {
    const HqpProblem p = testing::random_hqp({14, 12, 23}, trial % 2 == 0 ? 0 : 20, 1.0, random);
    Eigen::VectorXd ours;
    ASSERT_EQ(solver.solve(p, ours), HqpStatus::optimal);
    const Eigen::VectorXd theirs = oracle_cascade(p);
    // The oracle's levels leak into each other by its accuracy; a lower level may gain from that.
    for (std::size_t k = 0; k < p.levels.size(); ++k) {
      const double reference = level_residual(p, k, theirs);
      EXPECT_NEAR(level_residual(p, k, ours), reference, 1e-3 * (1.0 + reference))
          << "trial " << trial << " level " << k;
    }
  }
}

}  // namespace
}  // namespace clamber
