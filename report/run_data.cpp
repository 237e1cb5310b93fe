#include "report/run_data.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {

namespace {

// 1 m of base travel counts as much as 4 rad on one joint.
constexpr double kBaseWeight = 4.0;
// Frames are compared this far apart, so that 1 kHz jitter does not add up to a way.
constexpr double kStride = 0.1;  // s

double moved(const TelemetryFrame& a, const TelemetryFrame& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double d = kBaseWeight * (b.base_position[i] - a.base_position[i]);
    sum += d * d;
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(a.joint_count, kMaxJoints); ++i) {
    const double d = b.q[i] - a.q[i];
    sum += d * d;
  }
  return std::sqrt(sum);
}

}  // namespace

std::vector<std::size_t> pick_moments(const std::vector<TelemetryFrame>& frames, int count) {
  if (frames.empty() || count < 1) {
    return {};
  }
  const std::size_t last = frames.size() - 1;
  // Way covered up to every frame; a frame between two strides shares the earlier one's.
  std::vector<double> way(frames.size(), 0.0);
  std::size_t from = 0;
  for (std::size_t i = 1; i <= last; ++i) {
    way[i] = way[i - 1];
    if (frames[i].time - frames[from].time >= kStride || i == last) {
      way[i] += moved(frames[from], frames[i]);
      from = i;
    }
  }
  std::vector<std::size_t> picked;
  for (int k = 0; k < count; ++k) {
    const double share = count == 1 ? 1.0 : static_cast<double>(k) / (count - 1);
    const auto it = std::lower_bound(way.begin(), way.end(), share * way[last]);
    const auto index = k + 1 == count ? last : static_cast<std::size_t>(it - way.begin());
    if (picked.empty() || index > picked.back()) {
      picked.push_back(std::min(index, last));
    }
  }
  return picked;
}

}  // namespace clamber
