// A value that moves from key to key with continuous velocity and acceleration.
// Any thread; add() allocates, at() does not; never blocks.
#pragma once

#include <algorithm>
#include <vector>

namespace clamber::tools {

/// Share of a rest-to-rest move done at share s of its time: quintic, C2 at both ends.
[[nodiscard]] inline double smooth_step(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * s * (10.0 + s * (-15.0 + 6.0 * s));
}

/// 0 at both ends and 1 in the middle, C2 at both ends.
[[nodiscard]] inline double smooth_bump(double s) {
  s = std::clamp(s, 0.0, 1.0);
  const double u = 4.0 * s * (1.0 - s);
  return u * u * u;
}

template <typename Value>
class Track {
 public:
  explicit Track(Value start) : start_(start) {}

  /// Moves to `value` between t0 and t1 (not before the end of the move added last).
  void add(double t0, double t1, const Value& value) { moves_.push_back({t0, t1, value}); }

  [[nodiscard]] Value at(double t) const {
    Value value = start_;
    for (const auto& move : moves_) {
      if (t <= move.t0) break;
      value =
          Value(value + smooth_step((t - move.t0) / (move.t1 - move.t0)) * (move.value - value));
    }
    return value;
  }

 private:
  struct Move {
    double t0, t1;
    Value value;
  };
  Value start_;
  std::vector<Move> moves_;
};

}  // namespace clamber::tools
