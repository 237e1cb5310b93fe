// C2 cubic spline through keyframes: the reference between the plan's postures.
// build() at load time, evaluate() in the control thread. Allocates: never (the caller lends the
// storage); blocks: never; throws: never.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

namespace clamber {

enum class SplineStatus : std::uint8_t {
  kOk,
  kTooFewKnots,        ///< fewer than two
  kTimeNotIncreasing,  ///< or not finite
  kWorkspaceTooSmall,
};

/// Straight between (t0, x0) and (t1, x1), held outside. For feed-forward torques: they may jump
/// where a contact is made, and a spline through a jump would overshoot what the plan allowed.
[[nodiscard]] inline double interpolate_linear(double t, double t0, double x0, double t1,
                                               double x1) noexcept {
  return x0 + std::clamp((t - t0) / (t1 - t0), 0.0, 1.0) * (x1 - x0);
}

/// What a spline needs to know of its knots: size(), dimensions(), time(i) in s, value(i, d).
template <class T>
concept SplineKnots = requires(const T& knots, std::size_t i) {
  { knots.size() } -> std::convertible_to<std::size_t>;
  { knots.dimensions() } -> std::convertible_to<std::size_t>;
  { knots.time(i) } -> std::convertible_to<double>;
  { knots.value(i, i) } -> std::convertible_to<double>;
};

/// Extremes of one dimension over the whole spline, found from the cubics' own turning points.
struct SplineExtremes {
  double lowest = 0.0;
  double highest = 0.0;
  double fastest = 0.0;    ///< largest |rate|, per s
  double hardest = 0.0;    ///< largest |acceleration|, per s^2
  double jerkiest = 0.0;   ///< largest |jerk|, per s^3; the spline's is a step at every knot
  double overshoot = 0.0;  ///< farthest that a segment leaves the interval between its two knots
};

/// Clamped cubic spline (zero rate at both ends), each dimension independent. Kept in Hermite form
/// with the rates at the knots, so that a knot is reproduced to the last bit and a plan that rests
/// on equal keyframes is seen to rest.
template <SplineKnots Knots>
class ClampedSpline {
 public:
  /// Doubles that build() needs: the rates at the knots and one row of the elimination.
  [[nodiscard]] static constexpr std::size_t workspace_size(std::size_t knots,
                                                            std::size_t dimensions) noexcept {
    return knots * (dimensions + 1);
  }

  /// Solves for the rates at the knots. `knots` is copied (it is a view); what it refers to and the
  /// workspace must outlive the spline.
  [[nodiscard]] SplineStatus build(const Knots& knots, std::span<double> workspace) noexcept {
    count_ = 0;
    const std::size_t n = knots.size();
    if (n < 2) return SplineStatus::kTooFewKnots;
    if (workspace.size() < workspace_size(n, knots.dimensions()))
      return SplineStatus::kWorkspaceTooSmall;
    for (std::size_t i = 0; i < n; ++i)
      if (!std::isfinite(knots.time(i)) || (i > 0 && knots.time(i) <= knots.time(i - 1)))
        return SplineStatus::kTimeNotIncreasing;
    knots_ = knots;
    count_ = n;
    rates_ = workspace.subspan(0, n * knots.dimensions());
    solve_rates(workspace.subspan(rates_.size(), n));
    return SplineStatus::kOk;
  }

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] double start() const noexcept { return knots_.time(0); }
  [[nodiscard]] double end() const noexcept { return knots_.time(count_ - 1); }

  /// Moves `segment` to the one holding t, clamped to the first and last. O(1) while time advances
  /// by less than a segment between calls.
  void locate(double t, std::size_t& segment) const noexcept {
    segment = std::min(segment, count_ - 2);
    while (segment + 2 < count_ && t >= knots_.time(segment + 1)) ++segment;
    while (segment > 0 && t < knots_.time(segment)) --segment;
  }

  struct Sample {
    double value = 0.0;
    double rate = 0.0;          ///< per s
    double acceleration = 0.0;  ///< per s^2
  };

  /// Dimension d at time t, which must lie in `segment` (see locate()). Before the first knot and
  /// from the last one on: that knot, at rest.
  [[nodiscard]] Sample evaluate(double t, std::size_t segment, std::size_t d) const noexcept {
    if (t <= start()) return {knots_.value(0, d), 0.0, 0.0};
    if (t >= end()) return {knots_.value(count_ - 1, d), 0.0, 0.0};
    return cubic(segment, d).at(t - knots_.time(segment));
  }

  [[nodiscard]] SplineExtremes extremes(std::size_t d) const noexcept {
    SplineExtremes e{.lowest = knots_.value(0, d), .highest = knots_.value(0, d)};
    for (std::size_t i = 0; i + 1 < count_; ++i) {
      const Cubic c = cubic(i, d);
      const double low = std::min(knots_.value(i, d), knots_.value(i + 1, d));
      const double high = std::max(knots_.value(i, d), knots_.value(i + 1, d));
      const auto visit = [&](double s) {
        if (!(s >= 0.0 && s <= c.h)) return;
        const Sample x = c.at(s);
        e.lowest = std::min(e.lowest, x.value);
        e.highest = std::max(e.highest, x.value);
        e.fastest = std::max(e.fastest, std::abs(x.rate));
        e.overshoot = std::max({e.overshoot, low - x.value, x.value - high});
      };
      // The acceleration is a line, the jerk constant.
      e.hardest =
          std::max({e.hardest, std::abs(c.at(0.0).acceleration), std::abs(c.at(c.h).acceleration)});
      e.jerkiest = std::max(e.jerkiest, std::abs(6.0 * c.c3));
      // The rate is a parabola in s: its roots turn the value, its apex turns the rate.
      visit(0.0);
      visit(c.h);
      if (c.c3 == 0.0) {
        if (c.c2 != 0.0) visit(-c.c1 / (2.0 * c.c2));
        continue;
      }
      visit(-c.c2 / (3.0 * c.c3));
      const double discriminant = c.c2 * c.c2 - 3.0 * c.c3 * c.c1;
      if (discriminant < 0.0) continue;
      const double root = -(c.c2 + std::copysign(std::sqrt(discriminant), c.c2));
      visit(root / (3.0 * c.c3));
      if (root != 0.0) visit(c.c1 / root);
    }
    return e;
  }

 private:
  struct Cubic {
    double h, c0, c1, c2, c3;
    [[nodiscard]] Sample at(double s) const noexcept {
      return {c0 + s * (c1 + s * (c2 + s * c3)), c1 + s * (2.0 * c2 + s * 3.0 * c3),
              2.0 * c2 + 6.0 * s * c3};
    }
  };

  [[nodiscard]] Cubic cubic(std::size_t i, std::size_t d) const noexcept {
    const double h = knots_.time(i + 1) - knots_.time(i);
    const double chord = (knots_.value(i + 1, d) - knots_.value(i, d)) / h;
    const double v0 = rate(i, d);
    const double v1 = rate(i + 1, d);
    return {h, knots_.value(i, d), v0, (3.0 * chord - 2.0 * v0 - v1) / h,
            (v0 + v1 - 2.0 * chord) / (h * h)};
  }

  [[nodiscard]] double& rate(std::size_t i, std::size_t d) const noexcept {
    return rates_[i * knots_.dimensions() + d];
  }

  /// Continuity of the second derivative at the inner knots gives one tridiagonal system, the same
  /// matrix for every dimension and diagonally dominant: Thomas' elimination needs no pivoting.
  void solve_rates(std::span<double> upper) noexcept {
    const std::size_t n = count_;
    for (std::size_t d = 0; d < knots_.dimensions(); ++d) rate(0, d) = rate(n - 1, d) = 0.0;
    upper[0] = 0.0;
    for (std::size_t i = 1; i + 1 < n; ++i) {
      const double before = 1.0 / (knots_.time(i) - knots_.time(i - 1));
      const double after = 1.0 / (knots_.time(i + 1) - knots_.time(i));
      const double pivot = 2.0 * (before + after) - before * upper[i - 1];
      upper[i] = after / pivot;
      for (std::size_t d = 0; d < knots_.dimensions(); ++d) {
        const double slope =
            3.0 * ((knots_.value(i, d) - knots_.value(i - 1, d)) * before * before +
                   (knots_.value(i + 1, d) - knots_.value(i, d)) * after * after);
        rate(i, d) = (slope - before * rate(i - 1, d)) / pivot;
      }
    }
    for (std::size_t i = n - 1; i-- > 1;)
      for (std::size_t d = 0; d < knots_.dimensions(); ++d) rate(i, d) -= upper[i] * rate(i + 1, d);
  }

  Knots knots_{};
  std::size_t count_ = 0;
  std::span<double> rates_;  ///< row per knot, column per dimension
};

}  // namespace clamber
