// Time and correctness of one hierarchical inverse-kinematics step on recorded problems.
//   ik [--rounds N] FILE...
// A file holds three-level problems with a reference answer (docs/benchmarks.md gives the form).
// Every problem is solved cold, N times (default 40). "raw" quantiles are over all solves, with
// whatever preempted them; "problem" quantiles are over the problems, each with the least of its N
// times: the solver's own tail. Exit code 1 when an answer is wrong.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <string>
#include <vector>

#include "bench/calibration.hpp"
#include "tests/planner_offline/ik/hqp_problems.hpp"

namespace clamber {
namespace {

enum class Answer {
  kRight,     ///< optimal at every level and no worse than the reference at any
  kStricter,  ///< optimal; the reference is lower at a level and gave up one before it for that
  kWrong
};

constexpr double kResidual = 1e-6;    ///< by which a level may exceed the reference, relative
constexpr double kBound = 1e-8;       ///< by which a bound may be violated
constexpr double kOptimality = 1e-9;  ///< of the optimality check that knows no reference

/// Our residual less the reference's at each level.
std::array<double, 3> excess_of(const testing::RecordedHqp& recorded, const Eigen::VectorXd& x) {
  std::array<double, 3> excess{};
  for (std::size_t k = 0; k < excess.size(); ++k) {
    excess[k] = testing::level_residual(recorded.problem, k, x) -
                testing::level_residual(recorded.problem, k, recorded.reference);
  }
  return excess;
}

/// The reference is not exactly strict: it may lower a level by giving up a little of one before.
/// Whoever is granted the same must do as well.
bool as_good_when_granted_the_same(const testing::RecordedHqp& recorded, std::size_t level,
                                   double tolerance) {
  testing::RecordedHqp granted = recorded;
  for (std::size_t j = 0; j < level; ++j) {
    granted.problem.levels[j].b = granted.problem.levels[j].A * recorded.reference;
  }
  Hqp solver;
  Eigen::VectorXd x;
  return solver.solve(granted.problem, x) == HqpStatus::optimal &&
         testing::level_residual(granted.problem, level, x) <=
             testing::level_residual(recorded.problem, level, recorded.reference) + tolerance;
}

Answer judge(const testing::RecordedHqp& recorded, HqpStatus status, const Eigen::VectorXd& x,
             double last_tolerance) {
  const HqpProblem& p = recorded.problem;
  if (status != HqpStatus::optimal || testing::worst_violation(p, x) > kBound) {
    return Answer::kWrong;
  }
  const std::array<double, 3> excess = excess_of(recorded, x);
  Answer answer = Answer::kRight;
  for (std::size_t k = 0; k < p.levels.size(); ++k) {
    if (testing::level_optimality_error(p, k, x) > kOptimality) {
      return Answer::kWrong;
    }
    const double scale = std::max(1.0, testing::level_residual(p, k, recorded.reference));
    const double tolerance = k + 1 == p.levels.size() ? last_tolerance : kResidual * scale;
    if (excess[k] > tolerance) {
      if (!as_good_when_granted_the_same(recorded, k, tolerance)) {
        return Answer::kWrong;
      }
      answer = Answer::kStricter;
    }
  }
  return answer;
}

void print_times(const char* what, const std::vector<double>& times) {
  std::printf("  %-8s p50 %7.1f   p99 %7.1f   max %7.1f us\n", what, bench::quantile(times, 0.5),
              bench::quantile(times, 0.99), bench::quantile(times, 1.0));
}

/// Numbers, times and active-set steps of the slowest problems.
void print_slowest(const std::vector<double>& least, const std::vector<int>& iterations) {
  std::vector<std::size_t> order(least.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return least[a] > least[b]; });
  std::printf("  slowest ");
  for (std::size_t i = 0; i < std::min<std::size_t>(5, order.size()); ++i) {
    std::printf(" #%zu %.1f us (%d steps)", order[i], least[order[i]], iterations[order[i]]);
  }
  std::printf("\n");
}

/// @returns the number of wrong answers
int measure(const std::string& file, int rounds) {
  const auto problems = testing::read_recorded_hqp(file);
  if (problems.empty()) {
    std::fprintf(stderr, "ik: %s: cannot be read, or is no problem file\n", file.c_str());
    return 1;
  }
  // What the reference gains at the last level by giving up some 1e-7 of those before.
  const bool hard = file.find("hard") != std::string::npos;
  std::array<int, 3> answers{};
  std::array<double, 3> worst{};
  std::vector<double> raw, least(problems.size(), kInfinity);
  std::vector<int> iterations(problems.size());
  Hqp solver;
  Eigen::VectorXd x;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < problems.size(); ++i) {
      HqpStatus status = HqpStatus::optimal;
      const double time =
          bench::microseconds([&] { status = solver.solve(problems[i].problem, x); });
      raw.push_back(time);
      least[i] = std::min(least[i], time);
      if (round == 0) {
        iterations[i] = solver.iterations();
        const Answer answer = judge(problems[i], status, x, hard ? 1e-3 : 1e-5);
        ++answers[static_cast<std::size_t>(answer)];
        const std::array<double, 3> excess = excess_of(problems[i], x);
        for (std::size_t k = 0; k < worst.size(); ++k) {
          worst[k] = std::max(worst[k], excess[k]);
        }
        if (answer != Answer::kRight) {
          std::printf("  problem %zu: %s\n", i,
                      answer == Answer::kWrong ? "WRONG" : "stricter than the reference");
        }
      }
    }
  }
  std::printf("%s: %zu problems, right %d, stricter than the reference %d, wrong %d\n",
              file.c_str(), problems.size(), answers[0], answers[1], answers[2]);
  std::printf("  residual above the reference's, worst of each level: %.1e %.1e %.1e\n", worst[0],
              worst[1], worst[2]);
  print_times("raw", raw);
  print_times("problem", least);
  print_slowest(least, iterations);
  return answers[2];
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  int rounds = 40, wrong = 0;
  std::vector<std::string> files;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--rounds" && i + 1 < argc) {
      rounds = std::max(1, std::atoi(argv[++i]));
    } else {
      files.emplace_back(argv[i]);
    }
  }
  if (files.empty()) {
    std::fprintf(stderr, "usage: ik [--rounds N] FILE...\n");
    return 2;
  }
  clamber::bench::print_calibration();
  for (const std::string& file : files) {
    wrong += clamber::measure(file, rounds);
  }
  return wrong > 0 ? 1 : 0;
}
