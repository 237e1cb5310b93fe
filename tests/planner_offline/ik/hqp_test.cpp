#include "planner_offline/ik/hqp.hpp"

#include <gtest/gtest.h>

#include "tests/planner_offline/ik/hqp_problems.hpp"

namespace clamber {
namespace {

using testing::level_optimality_error;
using testing::level_residual;
using testing::Random;
using testing::random_hqp;
using testing::read_recorded_hqp;
using testing::recorded_hqp_file;
using testing::RecordedHqp;
using testing::worst_violation;

constexpr double kOptimality = 1e-9;

void expect_optimal(const HqpProblem& p, const std::string& what) {
  Hqp solver;
  Eigen::VectorXd x;
  ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal) << what;
  EXPECT_LE(worst_violation(p, x), 1e-8) << what;
  for (std::size_t k = 0; k < p.levels.size(); ++k) {
    EXPECT_LT(level_optimality_error(p, k, x), kOptimality) << what << ", level " << k;
    EXPECT_NEAR(solver.residual_norms()[static_cast<Eigen::Index>(k)], level_residual(p, k, x),
                1e-12);
  }
}

/// Whether, once the levels before `level` are held where the reference left them, our answer at
/// `level` is as good as the reference's.
bool matches_given_the_references_higher_levels(const RecordedHqp& recorded, std::size_t level,
                                                double tolerance) {
  HqpProblem relaxed = recorded.problem;
  for (std::size_t j = 0; j < level; ++j) {
    relaxed.levels[j].b = relaxed.levels[j].A * recorded.reference;
  }
  Hqp solver;
  Eigen::VectorXd x;
  return solver.solve(relaxed, x) == HqpStatus::optimal &&
         level_residual(relaxed, level, x) <=
             level_residual(recorded.problem, level, recorded.reference) + tolerance;
}

/// Solves a recorded set. The reference answers are not exactly strict: some buy a lower residual
/// at one level by giving up a little at a level before it. Such a case counts as `bought` only if
/// our answer is better before that level, is certified optimal, and is as good as the reference
/// when granted the same.
void check_recorded_set(const std::string& name, const std::array<double, 3>& tolerance,
                        int most_bought) {
  const auto problems = read_recorded_hqp(recorded_hqp_file(name));
  if (problems.empty()) GTEST_SKIP() << "skipped: no benchmark data " << name;
  Hqp solver;
  Eigen::VectorXd x;
  int bought = 0;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const HqpProblem& p = problems[i].problem;
    ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal) << name << " " << i;
    EXPECT_LE(worst_violation(p, x), 1e-8) << name << " " << i;
    double given_up_before = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_LT(level_optimality_error(p, k, x), kOptimality) << name << " " << i << " level " << k;
      const double reference = level_residual(p, k, problems[i].reference);
      const double excess = level_residual(p, k, x) - reference;
      if (excess > tolerance[k]) {
        ++bought;
        EXPECT_GT(given_up_before, 1e-6) << name << " " << i << " level " << k << " by " << excess;
        EXPECT_TRUE(matches_given_the_references_higher_levels(problems[i], k, tolerance[k]))
            << name << " " << i << " level " << k;
      }
      given_up_before = std::max(given_up_before, -excess);
    }
  }
  EXPECT_LE(bought, most_bought) << name;
}

TEST(RecordedHqp, WalkIsSolvedToTheReference) {
  check_recorded_set("hqp_walkA.bin", {1e-6, 1e-6, 1e-5}, 0);
}
TEST(RecordedHqp, HardIsSolvedToTheReference) {
  check_recorded_set("hqp_hardA.bin", {1e-6, 1e-6, 1e-3}, 2);
}

TEST(Hqp, RandomHierarchiesAreOptimalAtEveryLevel) {
  Random random(3);
  for (int trial = 0; trial < 60; ++trial) {
    const double reach = trial % 3 == 0 ? 0.3 : 3.0;
    expect_optimal(random_hqp({14, 12, 23}, 0, reach, random), "14/12/23 " + std::to_string(trial));
    expect_optimal(random_hqp({14, 6, 23}, 20, reach, random),
                   "with rows " + std::to_string(trial));
    expect_optimal(random_hqp({6, 6, 3, 8, 23}, 60, reach, random),
                   "five levels " + std::to_string(trial));
  }
}

TEST(Hqp, RankDeficientAndContradictingLevels) {
  Random random(5);
  for (int trial = 0; trial < 60; ++trial) {
    HqpProblem p = random_hqp({10, 10, 23}, 15, 2.0, random);
    // Level 0: rank 4, rows that cannot all be met. Level 1 repeats half of level 0.
    p.levels[0].A = random.matrix(10, 4) * random.matrix(4, p.n);
    p.levels[1].A.topRows(5) = p.levels[0].A.topRows(5);
    p.levels[2].A = p.levels[2].A * random.matrix(29, 5) * random.matrix(5, 29);
    expect_optimal(p, "trial " + std::to_string(trial));
    Hqp solver;
    Eigen::VectorXd x;
    ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal);
    EXPECT_EQ(solver.level_ranks()[0], 4);
    EXPECT_LE(solver.level_ranks()[1], 5);
  }
}

TEST(Hqp, LowerLevelsDoNotChangeHigherOnes) {
  Random random(7);
  for (int trial = 0; trial < 40; ++trial) {
    const HqpProblem all = random_hqp({14, 12, 23}, 30, 2.0, random);
    Hqp solver;
    Eigen::VectorXd x;
    std::vector<double> alone;
    for (std::size_t levels = 1; levels <= 3; ++levels) {
      HqpProblem some = all;
      some.levels.resize(levels);
      ASSERT_EQ(solver.solve(some, x), HqpStatus::optimal);
      for (std::size_t k = 0; k + 1 < levels; ++k) {
        EXPECT_NEAR(level_residual(all, k, x), alone[k], 1e-9 * (1.0 + alone[k]));
      }
      alone.push_back(level_residual(all, levels - 1, x));
    }
  }
}

TEST(Hqp, RedundantInequalityRowsChangeNothing) {
  Random random(9);
  for (int trial = 0; trial < 40; ++trial) {
    HqpProblem p = random_hqp({14, 6, 23}, 20, 2.0, random);
    Hqp solver;
    Eigen::VectorXd once;
    Eigen::VectorXd twice;
    ASSERT_EQ(solver.solve(p, once), HqpStatus::optimal);
    p.C = (Eigen::MatrixXd(60, p.n) << p.C, 100.0 * p.C, p.C).finished();
    p.d = (Eigen::VectorXd(60) << p.d, 100.0 * p.d, p.d).finished();
    ASSERT_EQ(solver.solve(p, twice), HqpStatus::optimal);
    EXPECT_LT((once - twice).norm(), 1e-7);
  }
}

TEST(Hqp, WhatIsFreeGoesTowardsZero) {
  HqpProblem p;  // x0 + x1 = 2 and nothing else: the shortest is (1, 1, 0)
  p.n = 3;
  p.levels.push_back({Eigen::RowVector3d(1.0, 1.0, 0.0), Eigen::VectorXd::Constant(1, 2.0)});
  Hqp solver;
  Eigen::VectorXd x;
  ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal);
  EXPECT_LT((x - Eigen::Vector3d(1.0, 1.0, 0.0)).norm(), 1e-12);
  p.lower = Eigen::Vector3d(-1.0, -1.0, 0.25);
  p.upper = Eigen::Vector3d(0.5, 9.0, 1.0);
  ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal);
  EXPECT_LT((x - Eigen::Vector3d(0.5, 1.5, 0.25)).norm(), 1e-12);
}

TEST(Hqp, ConflictGoesToTheHigherLevel) {
  HqpProblem p;  // x0 = 1 before x0 = 5; x1 is bounded below what level 1 asks for
  p.n = 2;
  p.levels.push_back({Eigen::RowVector2d(1.0, 0.0), Eigen::VectorXd::Constant(1, 1.0)});
  p.levels.push_back({Eigen::Matrix2d::Identity(), Eigen::Vector2d(5.0, 3.0)});
  p.lower = Eigen::Vector2d::Constant(-kInfinity);
  p.upper = Eigen::Vector2d(kInfinity, 2.0);
  Hqp solver;
  Eigen::VectorXd x;
  ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal);
  EXPECT_LT((x - Eigen::Vector2d(1.0, 2.0)).norm(), 1e-12);
  EXPECT_NEAR(solver.residual_norms()[0], 0.0, 1e-12);
  EXPECT_NEAR(solver.residual_norms()[1], std::sqrt(17.0), 1e-12);
}

TEST(Hqp, EdgesOfTheInput) {
  Hqp solver;
  Eigen::VectorXd x;
  HqpProblem p;
  EXPECT_EQ(solver.solve(p, x), HqpStatus::optimal);  // nothing at all
  p.n = 2;
  p.lower = Eigen::Vector2d(1.0, -1.0);
  p.upper = Eigen::Vector2d(2.0, 1.0);
  ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal);  // no level: the box point nearest to zero
  EXPECT_EQ(x, Eigen::Vector2d(1.0, 0.0));
  p.levels.push_back({Eigen::MatrixXd(0, 2), Eigen::VectorXd(0)});
  p.levels.push_back({Eigen::MatrixXd::Zero(3, 2), Eigen::Vector3d::Ones()});
  ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal);
  EXPECT_EQ(x, Eigen::Vector2d(1.0, 0.0));
  p.lower = p.upper;  // all variables fixed
  ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal);
  EXPECT_EQ(x, p.upper);
}

TEST(Hqp, SaysWhatIsWrong) {
  Hqp solver;
  Eigen::VectorXd x;
  Random random(15);
  HqpProblem p = random_hqp({14, 6, 23}, 4, 1.0, random);
  p.C.row(1) = -p.C.row(0);
  p.d[0] = 0.5;
  p.d[1] = 0.5;
  EXPECT_EQ(solver.solve(p, x), HqpStatus::infeasible);
  p = random_hqp({14, 6, 23}, 0, 1.0, random);
  std::swap(p.lower[10], p.upper[10]);
  EXPECT_EQ(solver.solve(p, x), HqpStatus::infeasible);
  p = random_hqp({14, 6, 23}, 0, 1.0, random);
  p.levels[1].A(2, 2) = std::nan("");
  EXPECT_EQ(solver.solve(p, x), HqpStatus::invalid_problem);
  p = random_hqp({14, 6, 23}, 0, 1.0, random);
  p.levels[1].b.resize(3);
  EXPECT_EQ(solver.solve(p, x), HqpStatus::invalid_problem);
}

}  // namespace
}  // namespace clamber
