// Two decompositions of Eigen's that tell one machine, or one minute, from another.
// Benchmarks only.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <cstdio>
#include <random>

#include "bench/stopwatch.hpp"

namespace clamber::bench {

inline Eigen::MatrixXd random_square(Eigen::Index n, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  return Eigen::MatrixXd::NullaryExpr(n, n, [&] { return u(generator); });
}

/// Prints median and minimum of a 29x29 LLT and a 29x29 HouseholderQR, us.
inline void print_calibration() {
  const Eigen::MatrixXd root = random_square(29, 7);
  const Eigen::MatrixXd M = root * root.transpose();
  Eigen::LLT<Eigen::MatrixXd> llt(29);
  Eigen::HouseholderQR<Eigen::MatrixXd> qr(29, 29);
  std::vector<double> llt_times, qr_times;
  for (int i = 0; i < 2000; ++i) {
    llt_times.push_back(microseconds([&] { llt.compute(M); }));
    qr_times.push_back(microseconds([&] { qr.compute(root); }));
  }
  std::printf("calibration, us: 29x29 LLT %.2f (minimum %.2f), 29x29 HouseholderQR %.2f (%.2f)\n",
              quantile(llt_times, 0.5), quantile(llt_times, 0.0), quantile(qr_times, 0.5),
              quantile(qr_times, 0.0));
}

}  // namespace clamber::bench
