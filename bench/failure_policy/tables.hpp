// Kills as figures: falls by policy, by phase, as Markdown, CSV and SVG. Off-line only: allocates.
#pragma once

#include <string>
#include <vector>

#include "bench/failure_policy/kills.hpp"

namespace clamber {

/// Falls and load under one policy, or under the plan's own.
struct Tally {
  std::size_t kills = 0, falls = 0;
  double torque =
      0.0;  ///< N m, root mean square of what the joints give at the end, falls left out
  double fastest = 0.0;  ///< m/s of the centre of mass, falls left out
};
/// @param policy nothing: what the plan states for each instant
[[nodiscard]] Tally tally(const std::vector<Kill>& kills, std::optional<FailurePolicy> policy);

/// `command`: what made the kills, for the reader.
[[nodiscard]] std::string kills_markdown(const std::vector<Kill>& kills, const Plan& plan,
                                         const KillOptions& options, const std::string& command);
[[nodiscard]] std::string kills_csv(const std::vector<Kill>& kills, const Plan& plan);
[[nodiscard]] std::string kills_svg(const std::vector<Kill>& kills, const Plan& plan);

}  // namespace clamber
