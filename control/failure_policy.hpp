// What the drives do by themselves when their host falls silent.
// Any thread; allocates: never; blocks: never.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace clamber {

/// Each drive acts alone, on what it last knew: no joint knows of another, or of the robot's pose.
enum class FailurePolicy : std::uint8_t {
  kHold,   ///< stay: the torque it gave last, and a position loop about where it stands
  kLower,  ///< sink: the same, fading to damping alone within a few seconds, see DrivesAlone
  kLimp,   ///< no torque
};
inline constexpr std::uint32_t kFailurePolicies = 3;

/// How drives carry it out. Their position loop has the joint's default gains.
struct DrivesAlone {
  double watchdog = 0.02;       ///< s without a command until they act; till then the last one does
  double lower_time = 3.0;      ///< s in which kLower gives up torque and position loop
  double lower_damping = 40.0;  ///< N m s/rad while it does, and after
};

[[nodiscard]] constexpr const char* to_string(FailurePolicy policy) noexcept {
  switch (policy) {
    case FailurePolicy::kHold:
      return "hold";
    case FailurePolicy::kLower:
      return "lower";
    case FailurePolicy::kLimp:
      return "limp";
  }
  return "?";
}

/// The policy that to_string() gives this word for.
[[nodiscard]] constexpr std::optional<FailurePolicy> failure_policy_named(
    std::string_view word) noexcept {
  for (const auto policy : {FailurePolicy::kHold, FailurePolicy::kLower, FailurePolicy::kLimp})
    if (word == to_string(policy)) return policy;
  return std::nullopt;
}

}  // namespace clamber
