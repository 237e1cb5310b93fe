// Assertions about a stream of frames: max(|tau|) < 30, for `clamber monitor --check`.
// One thread at a time; allocates; blocks: never.
//
//   check     = statistic "(" quantity ")" comparison number
//   statistic = max | min | mean | rms | last
//   quantity  = name [ "[" joint "]" ] | "|" name [ "[" joint "]" ] "|"
//
// A quantity of joints without a joint is that of every joint: each must pass.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "telemetry/frame.hpp"

namespace clamber {

/// A frame as a check sees it.
struct CheckSample {
  TelemetryFrame frame;
  double lateness = 0.0;   ///< us, of the tick before: start after its grid point
  double tick_time = 0.0;  ///< us, ditto
  double lost = 0.0;       ///< frames that are missing so far
  double drops = 0.0;      ///< of those, in the ring
};

struct CheckResult {
  bool passed = false;
  double value = 0.0;         ///< of the joint that is farthest from passing
  std::string joint;          ///< its name; empty: no quantity of joints
  std::uint64_t samples = 0;  ///< none: not passed
};

class Check {
 public:
  /// @throws InputError naming the column (from 1) and what was expected there
  explicit Check(std::string_view text);

  /// @throws InputError when the check names a joint that is not among them
  void describe(const std::vector<std::string>& joint_names);
  void add(const CheckSample& sample);

  [[nodiscard]] const std::string& text() const noexcept { return text_; }
  [[nodiscard]] CheckResult result() const;

  enum class Statistic : std::uint8_t { kMax, kMin, kMean, kRms, kLast };
  enum class Quantity : std::uint8_t {
    // Of joints.
    kTorque,       ///< N m, measured
    kCommand,      ///< N m
    kMargin,       ///< 1 - |torque| / limit
    kTemperature,  ///< degree Celsius
    kAge,          ///< ticks
    kError,        ///< rad, reference - measured
    kSpeed,        ///< rad/s
    // Of the run.
    kLateness,  ///< us
    kTickTime,  ///< us
    kLost,
    kDrops,
    kFault,  ///< code
  };
  enum class Comparison : std::uint8_t { kLess, kLessEqual, kGreater, kGreaterEqual, kEqual };

 private:
  friend class CheckParser;
  struct Sums {
    std::uint64_t count = 0;
    double max = 0.0, min = 0.0, sum = 0.0, squares = 0.0, last = 0.0;
  };
  [[nodiscard]] double statistic(const Sums& sums) const;
  [[nodiscard]] double quantity(const CheckSample& sample, std::size_t joint) const;
  [[nodiscard]] bool holds(double value) const;
  /// How far on the wrong side; negative where the check holds.
  [[nodiscard]] double excess(double value) const;

  std::string text_;
  Statistic statistic_ = Statistic::kMax;
  Quantity quantity_ = Quantity::kTorque;
  bool magnitude_ = false;
  std::string joint_;  ///< empty: all
  Comparison comparison_ = Comparison::kLess;
  double bound_ = 0.0;

  std::vector<std::string> names_;
  std::vector<Sums> sums_;  ///< per joint, or one
};

}  // namespace clamber
