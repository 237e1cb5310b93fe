// Quintic between two states of motion: how a plan is joined from wherever the robot is.
// Any thread; allocates: never; blocks: never; throws: never.
#pragma once

namespace clamber {

struct MotionPoint {
  double q = 0.0;    ///< rad
  double dq = 0.0;   ///< rad/s
  double ddq = 0.0;  ///< rad/s^2
};

/// The quintic from 0 to 1 that rests at both ends, and its derivatives.
struct RestingQuintic {
  double s = 0.0;  ///< 0 to 1
  double value = 0.0;
  double rate = 0.0;          ///< per s
  double acceleration = 0.0;  ///< per s^2

  /// @param duration s
  [[nodiscard]] static RestingQuintic at(double s, double duration) noexcept {
    return {s, s * s * s * (10.0 + s * (-15.0 + 6.0 * s)),
            30.0 * s * s * (1.0 - s) * (1.0 - s) / duration,
            60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (duration * duration)};
  }
  /// Peak rate over mean rate.
  static constexpr double kPeak = 1.875;
};

/// The polynomial of degree 5 that meets position, rate and acceleration at both ends: the resting
/// quintic and, where an end moves, what that adds.
class QuinticBlend {
 public:
  QuinticBlend() = default;
  QuinticBlend(const MotionPoint& from, const MotionPoint& to, double duration) noexcept
      : from_(from.q), distance_(to.q - from.q), t_(duration) {
    moves_ = from.dq != 0.0 || from.ddq != 0.0 || to.dq != 0.0 || to.ddq != 0.0;
    c1_ = from.dq * t_;
    c2_ = 0.5 * from.ddq * t_ * t_;
    const double d = -(c1_ + c2_);
    const double e = to.dq * t_ - c1_ - 2.0 * c2_;
    const double f = to.ddq * t_ * t_ - 2.0 * c2_;
    c3_ = 10.0 * d - 4.0 * e + 0.5 * f;
    c4_ = -15.0 * d + 7.0 * e - f;
    c5_ = 6.0 * d - 3.0 * e + 0.5 * f;
  }

  [[nodiscard]] MotionPoint at(const RestingQuintic& base) const noexcept {
    MotionPoint x{from_ + base.value * distance_, base.rate * distance_,
                  base.acceleration * distance_};
    if (!moves_) return x;
    const double s = base.s;
    x.q += s * (c1_ + s * (c2_ + s * (c3_ + s * (c4_ + s * c5_))));
    x.dq += (c1_ + s * (2.0 * c2_ + s * (3.0 * c3_ + s * (4.0 * c4_ + s * 5.0 * c5_)))) / t_;
    x.ddq += (2.0 * c2_ + s * (6.0 * c3_ + s * (12.0 * c4_ + s * 20.0 * c5_))) / (t_ * t_);
    return x;
  }

 private:
  double from_ = 0.0;
  double distance_ = 0.0;
  double t_ = 1.0;
  double c1_ = 0.0, c2_ = 0.0, c3_ = 0.0, c4_ = 0.0, c5_ = 0.0;
  bool moves_ = false;
};

}  // namespace clamber
