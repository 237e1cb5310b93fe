// Trials as figures: success rate with its interval, by every parameter; Markdown, JSON, SVG.
// Off-line only: allocates.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace clamber {

struct Interval {
  double low = 0.0, high = 1.0;
};
/// Wilson's score interval at 95 % for `successes` of `trials`, shares. Without trials: all of it.
[[nodiscard]] Interval wilson(std::size_t successes, std::size_t trials);

/// The parts of a parameter's range and how the trials in each went.
struct Breakdown {
  struct Bin {
    std::string label;
    std::size_t trials = 0, successes = 0;
  };
  std::string parameter;
  std::vector<Bin> bins;
};
/// By friction, height, start, springs, delay, encoder, step, stepper.
[[nodiscard]] std::vector<Breakdown> break_down(const std::vector<nlohmann::ordered_json>& trials);

/// `command`: what made the trials, for the reader.
[[nodiscard]] std::string robustness_markdown(const std::vector<nlohmann::ordered_json>& trials,
                                              const std::string& command);
[[nodiscard]] nlohmann::ordered_json robustness_json(
    const std::vector<nlohmann::ordered_json>& trials);
[[nodiscard]] std::string robustness_svg(const std::vector<nlohmann::ordered_json>& trials);

}  // namespace clamber
