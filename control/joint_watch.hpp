// Can what a joint reports be believed? Tick by tick, for one joint: freshness, numbers, jumps of
// the encoder, readings that stand still while the joint must be moving.
// Control thread only; allocates: never; blocks: never; throws: never.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "control/joint_types.hpp"

namespace clamber {

enum class JointTrust : std::uint8_t {
  kGood,
  kMissing,      ///< stale, or not a number: the position is where it was, as far as one knows
  kUnbelievable  ///< fresh, but the encoder cannot be right: no loop may be closed over it
};

struct JointWatchLimits {
  double fastest = 0.0;                                   ///< rad/s, what the joint can do
  double jump = std::numeric_limits<double>::infinity();  ///< rad beyond that in no time
  /// rad that the reference may move while position, rate and torque read the very same to the bit
  double frozen = std::numeric_limits<double>::infinity();
};

class JointWatch {
 public:
  void configure(const JointWatchLimits& limits, double dt) noexcept {
    *this = JointWatch();
    limits_ = limits;
    dt_ = dt;
  }

  /// The reference has been set anew, not moved.
  void rebase(double reference) noexcept { reference_ = reference; }

  /// One tick. @param reference rad, where the joint is meant to be
  [[nodiscard]] JointTrust assess(const JointState& state, double reference) noexcept {
    if (!std::isfinite(state.q) || !std::isfinite(state.dq) || (state.flags & kJointStale) != 0) {
      ++missed_;
      return JointTrust::kMissing;
    }
    const double reach = limits_.jump + limits_.fastest * dt_ * (1.0 + missed_);
    // The last believable position stays the measure: an encoder that has lost count does not come
    // to be believed by waiting.
    if (known_ && std::abs(state.q - last_.q) > reach) return JointTrust::kUnbelievable;
    if (std::abs(state.dq) > limits_.fastest + limits_.jump / dt_) return JointTrust::kUnbelievable;
    const bool same =
        known_ && state.q == last_.q && state.dq == last_.dq && state.tau == last_.tau;
    unchanged_ = same;
    if (!same) reference_ = reference;
    known_ = true;
    missed_ = 0;
    last_ = state;
    return std::abs(reference - reference_) > limits_.frozen ? JointTrust::kUnbelievable
                                                             : JointTrust::kGood;
  }

  /// The last state was the one before it, to the bit.
  [[nodiscard]] bool unchanged() const noexcept { return unchanged_; }

 private:
  JointWatchLimits limits_;
  double dt_ = 0.0;
  JointState last_;
  double reference_ = 0.0;  ///< rad, when the reading last changed
  double missed_ = 0.0;     ///< ticks since the last fresh state
  bool known_ = false;
  bool unchanged_ = false;
};

}  // namespace clamber
