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

template <class Visit>
void for_each_bit(TouchMask mask, Visit&& visit) {
  for (std::size_t n = 0; mask != 0; mask &= mask - 1, ++n)
    visit(static_cast<std::size_t>(std::countr_zero(mask)), n);
}

/// The box with its top higher by `up` and its sides farther out by `out`, m.
InflatedCore grown(InflatedCore box, double up, const Eigen::Vector2d& out) {
  box.centre.z() += 0.5 * up;
  box.half_extents += Eigen::Vector3d(out.x(), out.y(), 0.5 * up);
  return box;
}

/// Largest distance of a core's points from its centre along the axes (columns), m.
Eigen::Vector2d extent(const InflatedCore& core, const Eigen::Matrix3d& axes) {
  return ((axes.transpose() * core.axes).cwiseAbs() * core.half_extents).head<2>() +
         Eigen::Vector2d::Constant(core.radius);
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

/// Lever of the start's turn: how far points within `extent` of p are at most from the start along
/// the box's two level axes, m.
Eigen::Vector2d Measure::lever(const Eigen::Vector3d& p, const Eigen::Vector2d& extent,
                               const InflatedCore& box) const noexcept {
  return (box.axes.transpose() * (p - scenario_.start_position)).head<2>().cwiseAbs() + extent;
}

/// How far such points move along these axes when the robot starts elsewhere by a share of the
/// start's uncertainty: the whole motion is turned about the start and shifted. A turn by up to a
/// moves along x by at most |sin| y + |cos - 1| x <= a y + a^2/2 x.
Eigen::Vector2d Measure::displaced(double share, const Eigen::Vector2d& lever) const noexcept {
  const double turn = share * uncertainty_.start_yaw;
  return Eigen::Vector2d::Constant(share * uncertainty_.start_position) +
         turn * Eigen::Vector2d(lever.y() + 0.5 * turn * lever.x(),
                                lever.x() + 0.5 * turn * lever.y());
}

/// Largest share of the start's uncertainty at which a contact stays where its link may rest: on
/// its obstacle's top, or on the floor beside all obstacles.
double Measure::place_held(const Eigen::Vector3d& p, double lost, int surface) const noexcept {
  double held = kMostStart;
  for (std::size_t o = 0; o < obstacles_.size(); ++o) {
    const bool on = static_cast<int>(o) == surface;
    if (surface >= 0 && !on) continue;
    const InflatedCore& box = obstacles_[o];
    const Eigen::Vector2d local = (box.axes.transpose() * (p - box.centre)).head<2>().cwiseAbs();
    const Eigen::Vector2d inside =
        (on ? 1.0 : -1.0) * (box.half_extents.head<2>() - local) - Eigen::Vector2d::Constant(lost);
    const Eigen::Vector2d arm = lever(p, Eigen::Vector2d::Constant(lost), box);
    held = std::min(held, largest(kMostStart, [&](double share) {
                      const Eigen::Vector2d left = inside - displaced(share, arm);
                      return (on ? left.minCoeff() : left.maxCoeff()) >= 0.0;
                    }));
  }
  return held;
}

/// Seen from the robot the obstacle is elsewhere: no higher than its top and the height's error,
/// and each side no farther out than the link's points are displaced towards it. A motion that
/// stays clear of the box grown by both hits nothing, wherever in between the obstacle is. Links
/// about to land are held against the faces of the obstacle only. Of links that touch, the places
/// must stay on the surface.
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
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      const Class type = classify(g, static_cast<int>(o));
      if (type == Class::kIgnored || type == Class::kNear) continue;
      const InflatedCore& box = obstacles_[o];
      const Eigen::Vector3d local = box.axes.transpose() * (core.centre - box.centre);
      const double away =
          (local.cwiseAbs() - box.half_extents).cwiseMax(0.0).norm() - core.reach() - lost;
      const Eigen::Vector2d arm =
          lever(core.centre, extent(core, box.axes) + Eigen::Vector2d::Constant(lost), box);
      if (away > kMostHeight + displaced(kMostStart, arm).norm()) continue;
      const auto clear = [&](double up, double share, double distance) {
        return convex_distance(core, grown(box, up, displaced(share, arm))) >= distance;
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
        return largest(kMostStart, [&](double share) { return clear(up, share, distance); });
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
    start.take(place_held(at, 0.0, surface), place_held(at, lost, surface));
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

}  // namespace clamber
