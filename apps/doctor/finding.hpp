// What a preflight check saw, what that means, and how to put it right.
// Plain data; allocates.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace clamber {

enum class Verdict : std::uint8_t {
  kFine,
  kAdvice,   ///< a run works, less well than it could
  kProblem,  ///< a run would be refused, late or unsafe
  kSkipped,  ///< nothing to look at; `seen` says why
};
[[nodiscard]] constexpr const char* to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kFine:
      return "ok";
    case Verdict::kAdvice:
      return "advice";
    case Verdict::kProblem:
      return "problem";
    case Verdict::kSkipped:
      return "skipped";
  }
  return "?";
}

struct Finding {
  std::string check;  ///< "kernel", "can.right_leg"
  Verdict verdict = Verdict::kFine;
  std::string seen;
  std::string remedy;  ///< what to type or change; empty when all is well
};
using Findings = std::vector<Finding>;

}  // namespace clamber
