// Frames as the page draws them: a row of numbers for every 20 ms, with the lowest and highest
// torque in it, so that no peak is lost. One thread; allocates; blocks: never.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "telemetry/frame.hpp"

namespace clamber {

/// Makes rows of frames. The page's JavaScript knows the parts by the names in layout().
class ViewRows {
 public:
  ViewRows(std::size_t joints, std::size_t contacts);

  /// JSON: [["time", 1], ...], names and lengths of a row's parts in order.
  [[nodiscard]] std::string layout() const;
  [[nodiscard]] std::size_t width() const { return row_.size(); }

  /// @return the row that the frame completes, valid until the next call; empty: none yet. Counts
  /// of
  ///         joints and contacts beyond the layout are cut.
  [[nodiscard]] std::span<const float> add(const TelemetryFrame& frame);
  /// The row that is not complete; empty: there is none.
  [[nodiscard]] std::span<const float> rest();

 private:
  void fill(const TelemetryFrame& frame, bool first);

  std::size_t joints_;
  std::size_t contacts_;
  std::vector<float> row_;
  std::vector<float> complete_;
  std::optional<double> period_;  ///< number of the 20 ms that row_ is of
};

/// RFC 4648, for what JSON and event streams carry.
[[nodiscard]] std::string base64_of(std::span<const float> numbers);

}  // namespace clamber
