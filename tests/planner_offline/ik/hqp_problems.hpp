// Strict-hierarchy problems: recorded sets and random ones, and a certificate of optimality that
// shares nothing with the solver.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "planner_offline/ik/hqp.hpp"
#include "tests/planner_offline/ik/qp_problems.hpp"

namespace clamber::testing {

struct RecordedHqp {
  HqpProblem problem;
  Eigen::VectorXd reference;  ///< another solver's answer
};

inline std::filesystem::path recorded_hqp_file(const std::string& name) {
  const char* folder = std::getenv("CLAMBER_BENCH_DATA");
  const std::filesystem::path root =
      folder ? folder : std::filesystem::path(CLAMBER_SOURCE_DIR) / ".." / "shared" / "bench";
  return root / name;
}

/// Format: int32 n, rows of three levels, count; then per problem row-major A and b of each level,
/// lower, upper, reference. Empty when the file is missing or short.
inline std::vector<RecordedHqp> read_recorded_hqp(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<std::int32_t, 5> header{};
  in.read(reinterpret_cast<char*>(header.data()), sizeof(header));
  if (!in) return {};
  const auto read = [&in](auto& values) {
    in.read(reinterpret_cast<char*>(values.data()),
            static_cast<std::streamsize>(sizeof(double)) * values.size());
  };
  std::vector<RecordedHqp> problems(static_cast<std::size_t>(header[4]));
  for (RecordedHqp& recorded : problems) {
    HqpProblem& p = recorded.problem;
    p.n = header[0];
    for (const int rows : {header[1], header[2], header[3]}) {
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> A(rows, p.n);
      Eigen::VectorXd b(rows);
      read(A);
      read(b);
      p.levels.push_back({A, b});
    }
    p.lower.resize(p.n);
    p.upper.resize(p.n);
    recorded.reference.resize(p.n);
    read(p.lower);
    read(p.upper);
    read(recorded.reference);
  }
  if (!in) return {};
  return problems;
}

/// The shape of a humanoid's inverse kinematics, six free base variables and bounded joints, with
/// targets far enough away that many bounds are active.
inline HqpProblem random_hqp(const std::vector<int>& rows, int inequality_rows, double reach,
                             Random& random) {
  HqpProblem p;
  p.n = 29;
  for (const int m : rows) {
    p.levels.push_back({random.matrix(m, p.n), reach * random.vector(m)});
  }
  p.lower.setConstant(p.n, -kInfinity);
  p.upper.setConstant(p.n, kInfinity);
  for (int i = 6; i < p.n; ++i) {
    p.lower[i] = -random.uniform(0.0, 0.6);
    p.upper[i] = random.uniform(0.0, 0.6);
  }
  p.C = random.matrix(inequality_rows, p.n);
  p.d = -random.vector(inequality_rows).cwiseAbs();
  return p;
}

inline double level_residual(const HqpProblem& p, std::size_t level, const Eigen::VectorXd& x) {
  return (p.levels[level].A * x - p.levels[level].b).norm();
}

inline double worst_violation(const HqpProblem& p, const Eigen::VectorXd& x) {
  double worst = 0.0;
  if (p.lower.size() > 0) worst = std::max(worst, (p.lower - x).maxCoeff());
  if (p.upper.size() > 0) worst = std::max(worst, (x - p.upper).maxCoeff());
  if (p.d.size() > 0) worst = std::max(worst, (p.d - p.C * x).maxCoeff());
  return worst;
}

/// Distance of v from the cone spanned by non-negative combinations of the columns of G.
/// Source: C. Lawson, R. Hanson, "Solving least squares problems", chapter 23.
inline double distance_from_cone(const Eigen::MatrixXd& G, const Eigen::VectorXd& v) {
  const Eigen::Index m = G.cols();
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(m);
  std::vector<bool> passive(static_cast<std::size_t>(m), false);
  const auto solve_passive = [&]() {
    std::vector<Eigen::Index> columns;
    for (Eigen::Index j = 0; j < m; ++j) {
      if (passive[static_cast<std::size_t>(j)]) columns.push_back(j);
    }
    Eigen::VectorXd full = Eigen::VectorXd::Zero(m);
    if (!columns.empty()) full(columns) = G(Eigen::all, columns).colPivHouseholderQr().solve(v);
    return full;
  };
  for (int outer = 0; outer < 10 * m + 10; ++outer) {
    const Eigen::VectorXd gradient = G.transpose() * (v - G * weights);
    Eigen::Index best = -1;
    double steepest = 1e-13 * (1.0 + v.norm());
    for (Eigen::Index j = 0; j < m; ++j) {
      if (!passive[static_cast<std::size_t>(j)] && gradient[j] > steepest) {
        steepest = gradient[j];
        best = j;
      }
    }
    if (best < 0) break;
    passive[static_cast<std::size_t>(best)] = true;
    Eigen::VectorXd wanted = solve_passive();
    for (int inner = 0; inner < m; ++inner) {
      double t = 1.0;
      for (Eigen::Index j = 0; j < m; ++j) {
        if (passive[static_cast<std::size_t>(j)] && wanted[j] <= 0.0 && weights[j] > wanted[j]) {
          t = std::min(t, weights[j] / (weights[j] - wanted[j]));
        }
      }
      weights += t * (wanted - weights);
      if (t == 1.0) break;
      for (Eigen::Index j = 0; j < m; ++j) {
        if (passive[static_cast<std::size_t>(j)] && weights[j] <= 1e-15) {
          passive[static_cast<std::size_t>(j)] = false;
          weights[j] = 0.0;
        }
      }
      wanted = solve_passive();
    }
  }
  return (v - G * weights).norm();
}

/// How far x is from being optimal at `level` given what the levels before it fix: the distance of
/// the level's gradient from {A_j' mu (j < level) + active inequality normals times lambda >= 0},
/// relative to the level's scale. Zero if and only if optimal (convex problem).
inline double level_optimality_error(const HqpProblem& p, std::size_t level,
                                     const Eigen::VectorXd& x, double active_slack = 1e-9) {
  const TaskLevel& task = p.levels[level];
  Eigen::VectorXd gradient = task.A.transpose() * (task.A * x - task.b);
  std::vector<Eigen::VectorXd> normals;
  for (Eigen::Index i = 0; i < p.n; ++i) {
    const Eigen::VectorXd axis = Eigen::VectorXd::Unit(p.n, i);
    if (p.lower.size() > 0 && x[i] - p.lower[i] < active_slack) normals.push_back(axis);
    if (p.upper.size() > 0 && p.upper[i] - x[i] < active_slack) normals.push_back(-axis);
  }
  for (Eigen::Index i = 0; i < p.d.size(); ++i) {
    if (p.C.row(i).dot(x) - p.d[i] < active_slack) normals.emplace_back(p.C.row(i).transpose());
  }
  Eigen::MatrixXd G(p.n, static_cast<Eigen::Index>(normals.size()));
  for (std::size_t j = 0; j < normals.size(); ++j) G.col(static_cast<Eigen::Index>(j)) = normals[j];
  Eigen::Index rows = 0;
  for (std::size_t j = 0; j < level; ++j) rows += p.levels[j].A.rows();
  if (rows > 0) {
    Eigen::MatrixXd before(rows, p.n);
    rows = 0;
    for (std::size_t j = 0; j < level; ++j) {
      before.middleRows(rows, p.levels[j].A.rows()) = p.levels[j].A;
      rows += p.levels[j].A.rows();
    }
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
    qr.setThreshold(1e-10);
    qr.compute(before.transpose());
    const Eigen::MatrixXd Q = qr.householderQ();
    const Eigen::MatrixXd N = Q.rightCols(p.n - qr.rank());
    gradient = (N.transpose() * gradient).eval();
    G = (N.transpose() * G).eval();
  }
  return distance_from_cone(G, gradient) / (1.0 + task.A.norm() * task.b.norm());
}

}  // namespace clamber::testing
