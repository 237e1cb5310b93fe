#include "report/peaks.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {

std::vector<TorquePeak> torque_peaks(const RunData& run, double from) {
  std::vector<TorquePeak> peaks;
  bool any = false;
  for (const Joint& joint : run.model.joints) {
    peaks.push_back({joint.name, 0.0, 0.0});
  }
  for (const TelemetryFrame& frame : run.frames) {
    if (frame.time < from) {
      continue;
    }
    any = true;
    const std::size_t count = std::min<std::size_t>(peaks.size(), frame.joint_count);
    for (std::size_t j = 0; j < count; ++j) {
      const double torque = std::abs(frame.tau_meas[j]);
      if (torque > peaks[j].value) {
        peaks[j].value = torque;
        peaks[j].time = frame.time;
      }
    }
  }
  return any ? peaks : std::vector<TorquePeak>{};
}

std::optional<TorquePeak> largest_peak(const std::vector<TorquePeak>& peaks) {
  const auto it =
      std::max_element(peaks.begin(), peaks.end(),
                       [](const TorquePeak& a, const TorquePeak& b) { return a.value < b.value; });
  return it == peaks.end() ? std::nullopt : std::optional(*it);
}

std::optional<double> hands_carry_from(const RunData& run, double threshold) {
  std::vector<std::size_t> wrists;
  for (std::size_t i = 0; i < run.model.contacts.size(); ++i) {
    if (run.model.contacts[i].name.ends_with("wrist")) {
      wrists.push_back(i);
    }
  }
  if (wrists.empty()) {
    return std::nullopt;
  }
  const auto it = std::find_if(
      run.frames.begin(), run.frames.end(), [&wrists, threshold](const TelemetryFrame& frame) {
        return (frame.flags & kFrameHasTruth) != 0 &&
               std::all_of(wrists.begin(), wrists.end(), [&](std::size_t i) {
                 return i < kMaxContacts && frame.force_obstacle[i] > threshold;
               });
      });
  return it == run.frames.end() ? std::nullopt : std::optional(it->time);
}

}  // namespace clamber
