// Picture sequences of the runs (paper Figs. 4 and 6).
// Off-line only: allocates, renders.
#pragma once

#include <string>
#include <vector>

#include "report/image.hpp"
#include "report/run_data.hpp"

namespace clamber {

struct Picture {
  double time = 0.0;  ///< s on the run's clock
  Image image;
};

struct ReportPictures {
  std::vector<Picture> climb;
  std::vector<Picture> playback;
  std::vector<Picture> final_view;  ///< the climb's last moment from the side, larger
  std::string driver;               ///< what drew them
  std::string problem;              ///< why there are none, or ""
};

/// Draws both runs; `playback` may be null. Never throws for a machine that cannot draw: `problem`
/// then says why, as it does for frames without simulation truth.
[[nodiscard]] ReportPictures draw_pictures(const RunData& climb, const RunData* playback);

}  // namespace clamber
