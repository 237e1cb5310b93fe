// The clock of what is being followed: it can slow down, stand and go on at any instant, and what
// follows it stays smooth.
// Control thread only; allocates: never; blocks: never; throws: never.
//
// The rate changes along cubics, so that rate and acceleration are continuous and the jerk bounded:
// with q(t(s)), dq/ds = q' t' and d2q/ds2 = q'' t'^2 + q' t'' have no steps. A ramp that a new aim
// interrupts first lets the acceleration run out, which stays between the ramp's two rates, and
// starts the next ramp from there: the rate never leaves [0, top].
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>

namespace clamber {

class PlanClock {
 public:
  /// @param ramp_time s from full rate to a stand; smaller changes take the square root's share
  /// @param dt tick, s
  void configure(double ramp_time, double dt) noexcept {
    *this = PlanClock();
    ramp_time_ = ramp_time;
    dt_ = dt;
  }

  /// At `time`, running at `share` of `top` (clock seconds per second).
  void start(double time, double top, double share) noexcept {
    top_ = top;
    aim_ = share * top;
    steady(time, aim_);
  }

  /// Goes on as it runs, but at `time` and with another top; shares of top stay what they are.
  void transfer(double time, double top) noexcept {
    const double scale = top / top_;
    top_ = top;
    aim_ *= scale;
    if (duration_ < 0.0) return steady(time, rate_ * scale);
    const double gone = (at(elapsed()).time - anchor_) * scale;
    anchor_ = time - gone;
    for (double* x : {&rate_, &accel_, &c2_, &c3_}) *x *= scale;
  }

  /// From now on toward this share (0 to 1) of top.
  void aim(double share) noexcept {
    const double target = std::clamp(share, 0.0, 1.0) * top_;
    if (target == aim_) return;
    aim_ = target;
    begin(at(elapsed()));
  }

  /// Stands at once, whatever that does to what follows.
  void halt() noexcept {
    aim_ = 0.0;
    steady(time(), 0.0);
  }

  /// One tick further.
  void advance() noexcept {
    ++ticks_;
    while (duration_ >= 0.0 && elapsed() >= duration_) {
      const double beyond = elapsed() - duration_;
      begin(at(duration_));
      offset_ = beyond;
    }
  }

  [[nodiscard]] double time() const noexcept { return at(elapsed()).time; }
  [[nodiscard]] double rate() const noexcept { return at(elapsed()).rate; }
  [[nodiscard]] double acceleration() const noexcept { return at(elapsed()).accel; }
  [[nodiscard]] bool stands() const noexcept { return duration_ < 0.0 && rate_ == 0.0; }

  /// `end` has been reached. At a steady rate decided by counting ticks, not by rounded sums.
  [[nodiscard]] bool reached(double end) const noexcept {
    if (duration_ >= 0.0 || rate_ == 0.0) return time() >= end;
    const double left = std::ceil(((end - anchor_) / rate_ - offset_) / dt_);
    return static_cast<double>(ticks_) >= left;
  }

 private:
  struct Point {
    double time, rate, accel;
  };

  [[nodiscard]] double elapsed() const noexcept {
    return offset_ + static_cast<double>(ticks_) * dt_;
  }

  [[nodiscard]] Point at(double s) const noexcept {
    return {anchor_ + s * (rate_ + s * (accel_ / 2.0 + s * (c2_ / 3.0 + s * (c3_ / 4.0)))),
            rate_ + s * (accel_ + s * (c2_ + s * c3_)), accel_ + s * (2.0 * c2_ + s * (3.0 * c3_))};
  }

  void steady(double time, double rate) noexcept {
    anchor_ = time;
    rate_ = rate;
    accel_ = c2_ = c3_ = offset_ = 0.0;
    duration_ = -1.0;
    ticks_ = 0;
  }

  /// The next piece, from here: the acceleration runs out, or a ramp to the aim, or a steady rate.
  void begin(const Point& from) noexcept {
    constexpr double kAtRest = 1e-12;
    steady(from.time, std::clamp(from.rate, 0.0, top_));
    const double jerk = 6.0 * top_ / (ramp_time_ * ramp_time_);
    if (std::abs(from.accel) > kAtRest * jerk * ramp_time_) {
      duration_ = std::abs(from.accel) / jerk;
      accel_ = from.accel;
      c2_ = -from.accel / (2.0 * duration_);
      return;
    }
    const double change = aim_ - rate_;
    if (std::abs(change) <= kAtRest * top_) {
      rate_ = aim_;
      return;
    }
    duration_ = ramp_time_ * std::sqrt(std::abs(change) / top_);
    c2_ = 3.0 * change / (duration_ * duration_);
    c3_ = -2.0 * change / (duration_ * duration_ * duration_);
  }

  double anchor_ = 0.0;  ///< clock s at the start of the piece
  double rate_ = 0.0;    ///< there
  double accel_ = 0.0;
  double c2_ = 0.0, c3_ = 0.0;  ///< rate = rate_ + accel_ s + c2_ s^2 + c3_ s^3
  double offset_ = 0.0;         ///< s of the piece that were over before its first tick
  double duration_ = -1.0;      ///< s of the piece; negative: without end
  double aim_ = 0.0;
  double top_ = 1.0;
  double ramp_time_ = 1.0;
  double dt_ = 0.0;
  std::uint64_t ticks_ = 0;  ///< since the piece began
};

}  // namespace clamber
