// Time of three-level hierarchies with inequality rows and of the contact-force-sized programs,
// beside a calibration with Eigen's own decompositions that tells one machine (or minute) from
// another. bench/ik measures recorded problems.
#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <chrono>
#include <vector>

#include "tests/planner_offline/ik/hqp_problems.hpp"

namespace clamber {
namespace {

using Clock = std::chrono::steady_clock;

double microseconds(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double, std::micro>(to - from).count();
}

double quantile(std::vector<double>& values, double share) {
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// Runs `solve(i)` over the set again and again; reports quantiles over single solves.
template <typename Solve>
void measure_set(benchmark::State& state, std::size_t count, const Solve& solve) {
  std::vector<double> times;
  std::size_t next = 0;
  for (auto _ : state) {
    const auto start = Clock::now();
    solve(next);
    const auto end = Clock::now();
    times.push_back(microseconds(start, end));
    state.SetIterationTime(times.back() * 1e-6);
    next = (next + 1) % count;
  }
  state.counters["median_us"] = quantile(times, 0.5);
  state.counters["p99_us"] = quantile(times, 0.99);
  state.counters["min_us"] = quantile(times, 0.0);
}

void measure_hierarchies(benchmark::State& state, const std::vector<HqpProblem>& problems) {
  Hqp solver;
  Eigen::VectorXd x;
  int failures = 0;
  measure_set(state, problems.size(), [&](std::size_t i) {
    failures += solver.solve(problems[i], x) != HqpStatus::optimal;
  });
  if (failures > 0) state.SkipWithError("a problem was not solved");
}

/// 14/12/23 rows, targets out of reach of the bounds: `rows` more inequalities on top.
void random_hierarchies(benchmark::State& state) {
  testing::Random random(5);
  std::vector<HqpProblem> problems;
  for (int i = 0; i < 200; ++i) {
    problems.push_back(
        testing::random_hqp({14, 12, 23}, static_cast<int>(state.range(0)), 0.3, random));
  }
  measure_hierarchies(state, problems);
}

void measure_programs(benchmark::State& state, const std::vector<QpProblem>& problems) {
  DenseQp qp;
  int failures = 0;
  int iterations = 0;
  measure_set(state, problems.size(), [&](std::size_t i) {
    failures += qp.solve(problems[i]) != QpStatus::optimal;
    iterations += qp.iterations();
  });
  state.counters["iterations"] =
      static_cast<double>(iterations) / static_cast<double>(state.iterations());
  if (failures > 0) state.SkipWithError("a problem was not solved");
}

/// 20 contact points: 60 forces, 6 equalities, 120 rows.
void contact_forces(benchmark::State& state) {
  testing::Random random(9);
  std::vector<QpProblem> problems;
  for (int i = 0; i < 50; ++i) {
    Eigen::Matrix<double, 6, 1> wrench;
    wrench << random.uniform(-70.0, 70.0), random.uniform(-70.0, 70.0), 290.0,
        random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0), 0.0;
    problems.push_back(testing::contact_force_qp(20, wrench, random));
  }
  measure_programs(state, problems);
}

void random_programs(benchmark::State& state) {
  testing::Random random(6);
  std::vector<QpProblem> problems;
  const testing::QpSize size{static_cast<int>(state.range(0)), static_cast<int>(state.range(1)),
                             static_cast<int>(state.range(2)), true};
  for (int i = 0; i < 50; ++i) problems.push_back(testing::feasible_qp(size, random));
  measure_programs(state, problems);
}

void calibration_llt(benchmark::State& state) {
  testing::Random random(7);
  const Eigen::MatrixXd root = random.matrix(29, 29);
  const Eigen::MatrixXd M = root * root.transpose();
  Eigen::LLT<Eigen::MatrixXd> factor(29);
  measure_set(state, 1, [&](std::size_t) { factor.compute(M); });
}

void calibration_qr(benchmark::State& state) {
  testing::Random random(8);
  const Eigen::MatrixXd M = random.matrix(29, 29);
  Eigen::HouseholderQR<Eigen::MatrixXd> factor(29, 29);
  measure_set(state, 1, [&](std::size_t) { factor.compute(M); });
}

BENCHMARK(calibration_llt)->UseManualTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(calibration_qr)->UseManualTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(random_hierarchies)
    ->ArgName("rows")
    ->Arg(0)
    ->Arg(20)
    ->Arg(100)
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(contact_forces)->UseManualTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(random_programs)
    ->ArgNames({"n", "equalities", "inequalities"})
    ->Args({29, 6, 100})
    ->Args({38, 30, 150})
    ->Args({60, 6, 200})
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace clamber

BENCHMARK_MAIN();
