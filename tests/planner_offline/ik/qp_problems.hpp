// Random quadratic programs and a check of optimality that shares nothing with the solver.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <ostream>
#include <random>

#include "planner_offline/ik/dense_qp.hpp"

namespace clamber::testing {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double normal() { return normal_(engine_); }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  Eigen::VectorXd vector(Eigen::Index n) {
    return Eigen::VectorXd::NullaryExpr(n, [this](Eigen::Index) { return normal(); });
  }
  Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd::NullaryExpr(rows, cols,
                                        [this](Eigen::Index, Eigen::Index) { return normal(); });
  }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

struct QpSize {
  int n = 0;
  int equalities = 0;
  int inequalities = 0;
  bool bounded = false;
};

/// Names the size in test names; otherwise GoogleTest prints its bytes, padding included.
inline void PrintTo(const QpSize& size, std::ostream* out) {
  *out << size.n << " variables, " << size.equalities << " equalities, " << size.inequalities
       << " rows" << (size.bounded ? ", bounds" : "");
}

/// A feasible program (a known interior point exists) with many constraints active at the optimum.
inline QpProblem feasible_qp(const QpSize& size, Random& random) {
  QpProblem p;
  const Eigen::MatrixXd root = random.matrix(size.n, size.n);
  p.H = root * root.transpose() + 0.01 * Eigen::MatrixXd::Identity(size.n, size.n);
  p.g = 10.0 * random.vector(size.n);
  const Eigen::VectorXd inside = 0.3 * random.vector(size.n);
  p.A_eq = random.matrix(size.equalities, size.n);
  p.b_eq = p.A_eq * inside;
  p.C = random.matrix(size.inequalities, size.n);
  p.d = p.C * inside - random.vector(size.inequalities).cwiseAbs();
  if (size.bounded) {
    p.lower = inside - random.vector(size.n).cwiseAbs();
    p.upper = inside + random.vector(size.n).cwiseAbs();
  }
  return p;
}

/// Contact points on a plane, each pushing with 0..60 N inside a friction pyramid of four faces
/// (mu = 0.5), together make `wrench` (force, moment) with the least squared force.
inline QpProblem contact_force_qp(int points, const Eigen::Matrix<double, 6, 1>& wrench,
                                  Random& random) {
  QpProblem p;
  p.H = Eigen::MatrixXd::Identity(3 * points, 3 * points);
  p.g.setZero(3 * points);
  p.A_eq.setZero(6, 3 * points);
  p.C.setZero(6 * points, 3 * points);
  p.d.setZero(6 * points);
  Eigen::Matrix<double, 6, 3> faces;
  faces << 1, 0, 0.5, -1, 0, 0.5, 0, 1, 0.5, 0, -1, 0.5, 0, 0, 1, 0, 0, -1;
  for (int i = 0; i < points; ++i) {
    const double x = random.uniform(-0.3, 0.3);
    const double y = random.uniform(-0.2, 0.2);
    p.A_eq.block<3, 3>(0, 3 * i).setIdentity();
    p.A_eq.block<3, 3>(3, 3 * i) << 0, 0, y, 0, 0, -x, -y, x, 0;
    p.C.block<6, 3>(6 * i, 3 * i) = faces;
    p.d[6 * i + 5] = -60.0;
  }
  p.b_eq = wrench;
  return p;
}

/// Largest violation of the Karush-Kuhn-Tucker conditions by the solver's x and multipliers:
/// stationarity relative to the gradient, feasibility and signs absolute, complementarity.
inline double kkt_error(const QpProblem& p, const DenseQp& qp) {
  const Eigen::VectorXd& x = qp.x();
  const Eigen::VectorXd& y = qp.equality_multipliers();
  const Eigen::VectorXd& u = qp.inequality_multipliers();
  const Eigen::VectorXd& v = qp.bound_multipliers();
  Eigen::VectorXd stationarity = p.H * x + p.g - v;
  double error = 0.0;
  const auto at_least = [&](double value) { error = std::max(error, value); };
  if (p.b_eq.size() > 0) {
    stationarity -= p.A_eq.transpose() * y;
    at_least((p.A_eq * x - p.b_eq).cwiseAbs().maxCoeff());
  }
  if (p.d.size() > 0) {
    stationarity -= p.C.transpose() * u;
    const Eigen::VectorXd slack = p.C * x - p.d;
    at_least(-slack.minCoeff());
    at_least(-u.minCoeff());
    for (Eigen::Index i = 0; i < u.size(); ++i) {
      if (u[i] != 0.0) at_least(std::abs(slack[i]));
    }
  }
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double low = p.lower.size() > 0 ? p.lower[i] : -kInfinity;
    const double high = p.upper.size() > 0 ? p.upper[i] : kInfinity;
    at_least(low - x[i]);
    at_least(x[i] - high);
    if (v[i] > 0.0) at_least(std::abs(x[i] - low));
    if (v[i] < 0.0) at_least(std::abs(x[i] - high));
  }
  at_least(stationarity.norm() / (1.0 + p.g.norm()));
  return error;
}

}  // namespace clamber::testing
