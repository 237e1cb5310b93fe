// The cases of a sweep: every combination of heights, frictions, depths, distances and ballasts.
// Start-up only: allocates, throws InputError.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace clamber {

/// What one case sets. Nothing: as the scenario has it.
struct SweepPoint {
  double height = 0.0;             ///< m, of the first obstacle
  double friction = 0.0;           ///< of every surface
  std::optional<double> depth;     ///< m, of the first obstacle; its front face stays
  std::optional<double> distance;  ///< m, from the mid-point between the soles to the front face
  double ballast = 0.0;            ///< share of the robot file's ballast

  /// Name of the case and of its files: the same parameters give the same one, others another.
  [[nodiscard]] std::string key() const;
};

struct SweepGrid {
  std::vector<double> heights, frictions, depths, distances, ballasts;

  /// Every combination, height fastest. Empty depths or distances: as the scenario has it.
  [[nodiscard]] std::vector<SweepPoint> points() const;
};

/// What an axis takes.
enum class SweepRange { kPositive, kNotNegative };

/// Numbers and low:high:step ranges (both ends included), separated by commas: "0.2,0.3:0.5:0.05".
/// Rounded to 0.0001, sorted, each once. @throws InputError naming `option`
[[nodiscard]] std::vector<double> parse_axis(const std::string& text, const std::string& option,
                                             SweepRange range);

/// Every count-th case, from the index-th on.
struct Shard {
  std::size_t index = 0;
  std::size_t count = 1;
};
/// "3/16": 0 <= index < count. @throws InputError
[[nodiscard]] Shard parse_shard(const std::string& text);

/// The scenario file's text with the point's obstacle, friction and start. Whatever else the file
/// says stays. @throws InputError
[[nodiscard]] std::string scenario_text(const std::string& base, const std::string& file,
                                        const SweepPoint& point);

}  // namespace clamber
