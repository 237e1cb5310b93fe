#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>

#include "certificate/measure.hpp"

namespace clamber {
namespace {

/// A point with less left of its cone takes no part in carrying errors of the masses, N.
constexpr double kCarries = 0.1;
/// Least pivot, of the largest, of a matrix that is taken for regular.
constexpr double kRegular = 1e-12;
/// Torques and forces per unit of a mass's share below which nothing changes, N m or N.
constexpr double kNothing = 1e-9;

/// A load's weight and its moments, (1, x, y) times newtons: all that wrong masses change.
Eigen::Vector3d load_at(const Eigen::Vector3d& p, const Eigen::Vector3d& com) {
  return {1.0, p.x() - com.x(), p.y() - com.y()};
}

/// LDLT::rcond() cannot tell: its solve() leaves directions without a pivot out.
template <class Matrix>
bool is_positive(const Eigen::LDLT<Matrix>& factors) {
  const auto& pivots = factors.vectorD();
  return factors.info() == Eigen::Success && pivots.maxCoeff() > 0.0 &&
         pivots.minCoeff() > kRegular * pivots.maxCoeff();
}

template <class Visit>
void for_each_bit(TouchMask mask, Visit&& visit) {
  for (; mask != 0; mask &= mask - 1) visit(static_cast<std::size_t>(std::countr_zero(mask)));
}

}  // namespace

/// Where the robot touches, what each point presses with as long as the masses are right, and by
/// how much that changes per unit of load.
struct Measure::MassAnswer {
  static constexpr std::size_t kMost = 64;
  std::size_t count = 0;
  std::array<std::size_t, kMost> body{};
  std::array<Eigen::Vector3d, kMost> at;
  std::array<Eigen::Vector3d, kMost> force;
  std::array<Eigen::Matrix3d, kMost> change;
};

/// Some forces within cones and limits prove that the changed robot can be held, so the better of
/// two answers counts. Vertical ones ask nothing of friction; those of the witness less of the
/// joints where torques are short.
void Measure::measure_masses(TouchMask mask, PointForces forces, Measured& out) const noexcept {
  MassAnswer answer;
  for_each_bit(mask, [&](std::size_t i) {
    answer.body[answer.count] = static_cast<std::size_t>(candidates_[i].body);
    answer.at[answer.count++] = touch_point(i);
  });
  double held = 0.0;
  if (press_vertically(answer)) held = mass_held(mask, answer);
  if (change_least(forces, answer)) held = std::max(held, mass_held(mask, answer));
  out.value[Quantity::kMassHeld] = held;
}

/// The weight on vertical forces that are as far from zero as they can be, by the largest sum of
/// their logarithms: f_i = 1 / (g_i y), g_i = (1, x_i, y_i), where y minimises
/// W y_0 - sum log(g_i y). Newton's method, damped so that no force leaves the positive side.
/// False: the centre of mass is not inside the points' hull.
bool Measure::press_vertically(MassAnswer& answer) const noexcept {
  constexpr int kMostSteps = 60;
  constexpr double kConverged = 1e-10, kUndamped = 0.25;  // of Newton's decrement
  const double weight = mass_ * kGravity;
  Eigen::Vector3d y(static_cast<double>(answer.count) / weight, 0.0, 0.0);
  for (int step = 0; step < kMostSteps && answer.count > 2; ++step) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d residual(-weight, 0.0, 0.0);
    for (std::size_t n = 0; n < answer.count; ++n) {
      const Eigen::Vector3d g = load_at(answer.at[n], data_.com);
      const double f = 1.0 / g.dot(y);
      answer.force[n] = {0.0, 0.0, f};
      H += f * f * g * g.transpose();
      residual += f * g;
    }
    const Eigen::LDLT<Eigen::Matrix3d> inverse(H);
    if (!is_positive(inverse)) return false;  // all on one line
    const Eigen::Vector3d change = inverse.solve(residual);
    const double decrement = std::sqrt(std::max(0.0, residual.dot(change)));
    if (decrement < kConverged) {
      // How the same solution changes with the load.
      for (std::size_t n = 0; n < answer.count; ++n) {
        const double f = answer.force[n].z();
        answer.change[n].setZero();
        answer.change[n].row(2) =
            f * f * inverse.solve(load_at(answer.at[n], data_.com)).transpose();
      }
      return true;
    }
    y += change / (decrement < kUndamped ? 1.0 : 1.0 + decrement);
  }
  return false;
}

/// The witness, changed by the least that carries the load, weighted by the square of what is left
/// of each cone: a foot that is nearly unloaded is spared.
bool Measure::change_least(PointForces forces, MassAnswer& answer) const noexcept {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  const auto moment_arm = [&](const Eigen::Vector3d& p) {
    Eigen::Matrix<double, 6, 3> G;  // wrench about the centre of mass per unit of force at p
    const Eigen::Vector3d r = p - data_.com;
    G.topRows<3>().setIdentity();
    G.bottomRows<3>() << 0.0, -r.z(), r.y(), r.z(), 0.0, -r.x(), -r.y(), r.x(), 0.0;
    return G;
  };
  std::array<double, MassAnswer::kMost> willing{};
  Matrix6 A = Matrix6::Zero();
  for (std::size_t n = 0; n < answer.count; ++n) {
    const double slack = friction_ * forces[n].z() - forces[n].head<2>().norm();
    if (slack >= kCarries) willing[n] = slack * slack;
    const auto G = moment_arm(answer.at[n]);
    A += willing[n] * G * G.transpose();
    answer.force[n] = forces[n];
  }
  const Eigen::LDLT<Matrix6> inverse(A);
  if (!is_positive(inverse)) return false;
  Eigen::Matrix<double, 6, 3> carried = Eigen::Matrix<double, 6, 3>::Zero();  // per unit of load
  carried(2, 0) = carried(3, 2) = 1.0;
  carried(4, 1) = -1.0;
  const Eigen::Matrix<double, 6, 3> solved = inverse.solve(carried);
  for (std::size_t n = 0; n < answer.count; ++n)
    answer.change[n] = willing[n] * moment_arm(answer.at[n]).transpose() * solved;
  return true;
}

/// Each mass wrong by its own share s_b, |s_b| <= s. Forces and torques answer linearly in every
/// s_b, so the worst of all combinations is the sum of what each does.
double Measure::mass_held(TouchMask mask, const MassAnswer& answer) const noexcept {
  const auto each_joint_to = [&](std::size_t b, auto&& visit) {
    for (; b > 0; b = static_cast<std::size_t>(model_.bodies[b].parent)) visit(b);
  };
  // Torque per unit of load that the points carry.
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxJoints, 3> torque(model_.joint_count(), 3);
  torque.setZero();
  for (std::size_t n = 0; n < answer.count; ++n)
    each_joint_to(answer.body[n], [&](std::size_t b) {
      torque.row(static_cast<Eigen::Index>(b) - 1) -=
          data_.axis_W[b].cross(answer.at[n] - data_.X_WB[b].p).transpose() * answer.change[n];
    });
  JointVector torque_change = JointVector::Zero(model_.joint_count());
  std::array<double, MassAnswer::kMost> cone_change{};
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    const double weight = model_.bodies[b].mass * kGravity;
    const Eigen::Vector3d load = weight * load_at(data_.com_W[b], data_.com);
    JointVector change = torque * load;
    each_joint_to(b, [&](std::size_t a) {
      const Eigen::Vector3d arm = data_.com_W[b] - data_.X_WB[a].p;
      change[static_cast<Eigen::Index>(a) - 1] += weight * data_.axis_W[a].cross(arm).z();
    });
    torque_change += change.cwiseAbs();
    for (std::size_t n = 0; n < answer.count; ++n) {
      const Eigen::Vector3d force = answer.change[n] * load;
      cone_change[n] += friction_ * std::abs(force.z()) + force.head<2>().norm();
    }
  }
  JointVector tau;
  Eigen::Vector3d force, moment;
  statics(mask, PointForces(answer.force).first(answer.count), tau, force, moment);
  double held = kMostMass;
  for (Eigen::Index j = 0; j < tau.size(); ++j)
    held = std::min(held,
                    (model_.joints[static_cast<std::size_t>(j)].torque_limit - std::abs(tau[j])) /
                        std::max(torque_change[j], kNothing));
  for (std::size_t n = 0; n < answer.count; ++n) {
    const Eigen::Vector3d& f = answer.force[n];
    if (cone_change[n] > kNothing)
      held = std::min(held, (friction_ * f.z() - f.head<2>().norm()) / cone_change[n]);
  }
  return std::max(0.0, held);
}

}  // namespace clamber
