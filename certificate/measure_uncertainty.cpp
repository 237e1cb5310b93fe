#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "certificate/measure.hpp"

namespace clamber {
namespace {

constexpr int kBisections = 12;
/// A link that is about to land may touch the obstacle this far below its top and higher, m.
constexpr double kLandingEdge = 0.010;
/// A point with less left of its cone takes no part in carrying errors of the masses, N.
constexpr double kCarries = 0.1;
/// Torques and forces per unit of a mass's share below which nothing changes, N m or N.
constexpr double kNothing = 1e-9;

template <class Visit>
void for_each_bit(TouchMask mask, Visit&& visit) {
  for (std::size_t n = 0; mask != 0; mask &= mask - 1, ++n)
    visit(static_cast<std::size_t>(std::countr_zero(mask)), n);
}

/// The box with its top higher by `up` and its sides farther out by `out`, m.
InflatedCore grown(InflatedCore box, double up, double out) {
  box.centre.z() += 0.5 * up;
  box.half_extents += Eigen::Vector3d(out, out, 0.5 * up);
  return box;
}

/// Largest x up to `most` with holds(x), which holds up to some x and then no more; negative: not
/// even at 0.
template <class Holds>
double largest(double most, Holds&& holds) {
  if (holds(most)) return most;
  if (!holds(0.0)) return -1.0;
  double low = 0.0, high = most;
  for (int i = 0; i < kBisections; ++i) {
    const double middle = 0.5 * (low + high);
    (holds(middle) ? low : high) = middle;
  }
  return low;
}

}  // namespace

/// How far a point within `reach` of p moves in the plane when the robot starts elsewhere by all of
/// the start's uncertainty: then the whole motion is turned about the start and shifted.
double Measure::start_displacement(const Eigen::Vector3d& p, double reach) const noexcept {
  const double radius = (p - scenario_.start_position).head<2>().norm() + reach;
  return uncertainty_.start_position + 2.0 * std::sin(0.5 * uncertainty_.start_yaw) * radius;
}

/// Seen from the robot the obstacle is elsewhere: no higher than its top and the height's error,
/// and its sides no farther out than the robot's points are displaced. A motion that stays clear of
/// the box grown by both hits nothing, wherever in between the obstacle is. Links about to land are
/// held against the faces of the obstacle only. Of links that touch, the places must stay on the
/// surface.
void Measure::measure_height_and_start(TouchMask mask, Measured& out) const noexcept {
  struct Held {
    double value, proven;
    void take(double v, double p) {
      value = std::min(value, v);
      proven = std::min(proven, p);
    }
  } height{kMostHeight, kMostHeight}, start{kMostStart, kMostStart};
  for (std::size_t g = 0; g < geoms_.size(); ++g) {
    const InflatedCore& core = geoms_[g].core;
    const BodyBounds& bounds = bounds_[static_cast<std::size_t>(model_.geoms[g].body)];
    const double lost = travel(geoms_[g].speed, bounds.at(geoms_[g].reach));
    const double displacement = start_displacement(core.centre, core.reach() + lost);
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      const Class type = classify(g, static_cast<int>(o));
      if (type == Class::kIgnored || type == Class::kNear) continue;
      const InflatedCore& box = obstacles_[o];
      const Eigen::Vector3d local = box.axes.transpose() * (core.centre - box.centre);
      const double away =
          (local.cwiseAbs() - box.half_extents).cwiseMax(0.0).norm() - core.reach() - lost;
      if (away > kMostHeight + std::sqrt(2.0) * kMostStart * displacement) continue;
      const auto clear = [&](double up, double sides, double distance) {
        return convex_distance(core, grown(box, up, sides)) >= distance;
      };
      if (type == Class::kFree) {
        const auto held = [&](double distance) {
          return largest(kMostHeight, [&](double up) { return clear(up, 0.0, distance); });
        };
        const double value = held(0.0);
        height.take(value, value < 0.0 ? value : held(lost));
      }
      const double up = type == Class::kFree ? uncertainty_.height : -kLandingEdge;
      const auto held = [&](double distance) {
        return largest(kMostStart,
                       [&](double share) { return clear(up, share * displacement, distance); });
      };
      const double value = held(0.0);
      start.take(value, value < 0.0 ? value : held(lost));
    }
  }
  for_each_bit(mask, [&](std::size_t i, std::size_t) {
    const TouchCandidate& c = candidates_[i];
    const auto body = static_cast<std::size_t>(c.body);
    const Eigen::Vector3d at = touch_point(i), centre = data_.X_WB[body] * c.p_B;
    const double lost = travel(twists_[body].at(centre).head<2>().norm(),
                               bounds_[body].at(c.p_B.norm() + c.radius));
    const int surface = motion_.segments[sample_.segment].surface[static_cast<std::size_t>(c.link)];
    const double inside = edge_distance(at, surface), displacement = start_displacement(at, lost);
    start.take(inside / displacement, (inside - lost) / displacement);
  });
  const auto put = [&out](Quantity q, const Held& held) {
    out.value[q] = held.value;
    out.gap[q] = held.value - held.proven;
  };
  put(Quantity::kHeightHeld, height);
  put(Quantity::kStartHeld, start);
}

/// Ground tilted by an angle shifts the centre of mass against a support below it by at most its
/// height times the tangent.
void Measure::measure_tilt(Measured& out) const noexcept {
  const double margin = out.value[Quantity::kSupportMargin];
  const double lost = out.gap[Quantity::kSupportMargin];
  const double height = std::max(data_.com.z(), 1e-3);
  out.value[Quantity::kTiltHeld] = std::atan(margin / height);
  out.gap[Quantity::kTiltHeld] =
      out.value[Quantity::kTiltHeld] - std::atan((margin - lost) / (height + lost));
}

/// One answer of the contacts within cones and limits proves that the changed robot can be held, so
/// the better of two counts. Weighting by the square spares a foot that is nearly unloaded.
void Measure::measure_masses(TouchMask mask, PointForces forces, Measured& out) const noexcept {
  out.value[Quantity::kMassHeld] =
      std::max(mass_held(mask, forces, [](double slack) { return slack; }),
               mass_held(mask, forces, [](double slack) { return slack * slack; }));
}

/// Each mass wrong by its own share s_b, |s_b| <= s. The contacts take the changed weight up by the
/// least change weighted by a function of what is left of their cones; this is linear in every s_b,
/// so the worst of all combinations is the sum of what each does.
double Measure::mass_held(TouchMask mask, PointForces forces,
                          double (*weighting)(double slack)) const noexcept {
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Columns = Eigen::Matrix<double, 3, 6>;
  constexpr std::size_t kMostPoints = 64;
  std::array<Eigen::Vector3d, kMostPoints> at;
  std::array<double, kMostPoints> slack{}, willing{};
  std::array<std::size_t, kMostPoints> body{};
  std::size_t count = 0;
  Matrix6 A = Matrix6::Zero();
  const auto moment_arm = [&](const Eigen::Vector3d& p) {
    Eigen::Matrix<double, 6, 3> G;  // wrench about the centre of mass per unit of force at p
    const Eigen::Vector3d r = p - data_.com;
    G.topRows<3>().setIdentity();
    G.bottomRows<3>() << 0.0, -r.z(), r.y(), r.z(), 0.0, -r.x(), -r.y(), r.x(), 0.0;
    return G;
  };
  for_each_bit(mask, [&](std::size_t i, std::size_t n) {
    at[n] = touch_point(i);
    body[n] = static_cast<std::size_t>(candidates_[i].body);
    slack[n] = friction_ * forces[n].z() - forces[n].head<2>().norm();
    if (slack[n] < kCarries) slack[n] = 0.0;
    const auto G = moment_arm(at[n]);
    willing[n] = weighting(slack[n]);
    A += willing[n] * G * G.transpose();
    count = n + 1;
  });
  const Eigen::LDLT<Matrix6> inverse(A);
  if (count == 0 || inverse.info() != Eigen::Success || inverse.rcond() < 1e-12) return 0.0;
  // Change of every force per unit of wrench that is to be carried, and of the joints' torques.
  std::array<Columns, kMostPoints> answer;
  Eigen::Matrix<double, Eigen::Dynamic, 6, 0, kMaxJoints, 6> torque(model_.joint_count(), 6);
  torque.setZero();
  const auto each_joint_to = [&](std::size_t b, auto&& visit) {
    for (; b > 0; b = static_cast<std::size_t>(model_.bodies[b].parent)) visit(b);
  };
  const Matrix6 solved = inverse.solve(Matrix6::Identity());
  for (std::size_t n = 0; n < count; ++n) {
    answer[n] = -willing[n] * moment_arm(at[n]).transpose() * solved;
    each_joint_to(body[n], [&](std::size_t b) {
      torque.row(static_cast<Eigen::Index>(b) - 1) -=
          data_.axis_W[b].cross(at[n] - data_.X_WB[b].p).transpose() * answer[n];
    });
  }
  JointVector torque_change = JointVector::Zero(model_.joint_count());
  std::array<double, kMostPoints> cone_change{};
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    const Eigen::Vector3d weight(0.0, 0.0, -model_.bodies[b].mass * kGravity);
    Eigen::Matrix<double, 6, 1> wrench;
    wrench << weight, (data_.com_W[b] - data_.com).cross(weight);
    JointVector change = torque * wrench;
    each_joint_to(b, [&](std::size_t a) {
      change[static_cast<Eigen::Index>(a) - 1] -=
          data_.axis_W[a].cross(data_.com_W[b] - data_.X_WB[a].p).dot(weight);
    });
    torque_change += change.cwiseAbs();
    for (std::size_t n = 0; n < count; ++n) {
      const Eigen::Vector3d force = answer[n] * wrench;
      cone_change[n] += friction_ * std::abs(force.z()) + force.head<2>().norm();
    }
  }
  double held = kMostMass;
  for (Eigen::Index j = 0; j < tau_.size(); ++j)
    held = std::min(held,
                    (model_.joints[static_cast<std::size_t>(j)].torque_limit - std::abs(tau_[j])) /
                        std::max(torque_change[j], kNothing));
  for (std::size_t n = 0; n < count; ++n)
    if (slack[n] > 0.0) held = std::min(held, slack[n] / std::max(cone_change[n], kNothing));
  return held;
}

}  // namespace clamber
