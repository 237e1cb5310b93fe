#include "planner_offline/recording/human_motion.hpp"

#include <algorithm>
#include <cmath>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

std::optional<std::size_t> find_label(const std::vector<std::string>& labels,
                                      std::string_view label) {
  const auto it = std::find(labels.begin(), labels.end(), label);
  if (it == labels.end()) return std::nullopt;
  return static_cast<std::size_t>(it - labels.begin());
}

HumanMotion without_frames(const HumanMotion& motion) {
  HumanMotion out;
  out.source = motion.source;
  out.format = motion.format;
  out.synthetic = motion.synthetic;
  out.rate = motion.rate;
  out.hip_height = motion.hip_height;
  out.floor = motion.floor;
  out.heading = motion.heading;
  out.start_time = motion.start_time;
  out.segments = motion.segments;
  out.points = motion.points;
  out.joints = motion.joints;
  out.warnings = motion.warnings;
  return out;
}

HumanMotion::Frame interpolate(const HumanMotion::Frame& a, const HumanMotion::Frame& b, double s) {
  HumanMotion::Frame out;
  out.orientation.reserve(a.orientation.size());
  for (std::size_t i = 0; i < a.orientation.size(); ++i) {
    out.orientation.push_back(a.orientation[i].slerp(s, b.orientation[i]));
  }
  for (std::size_t i = 0; i < a.origin.size(); ++i) {
    out.origin.emplace_back((1.0 - s) * a.origin[i] + s * b.origin[i]);
  }
  for (std::size_t i = 0; i < a.point.size(); ++i) {
    out.point.emplace_back((1.0 - s) * a.point[i] + s * b.point[i]);
  }
  return out;
}

}  // namespace

std::optional<std::size_t> HumanMotion::find_segment(std::string_view label) const {
  return find_label(segments, label);
}

std::optional<std::size_t> HumanMotion::find_point(std::string_view label) const {
  return find_label(points, label);
}

std::optional<std::size_t> HumanMotion::find_joint(std::string_view label) const {
  return find_label(joints, label);
}

std::size_t HumanMotion::segment(std::string_view label) const {
  if (const auto i = find_segment(label)) return *i;
  throw InputError(source + ": no segment \"" + std::string(label) +
                   "\": expected a full-body recording with that segment");
}

HumanMotion resample(const HumanMotion& motion, double rate) {
  HumanMotion out = without_frames(motion);
  out.rate = rate;
  out.joints.clear();
  if (motion.frames.empty()) return out;
  const double last = static_cast<double>(motion.frames.size() - 1);
  // The small allowance keeps the last sample when the ratio of the rates is not exact in binary.
  const auto count = static_cast<std::size_t>(std::floor(last * rate / motion.rate + 1e-6)) + 1;
  out.frames.reserve(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double at = std::min(static_cast<double>(k) * motion.rate / rate, last);
    const auto i = std::min(static_cast<std::size_t>(at), motion.frames.size() - 1);
    const auto j = std::min(i + 1, motion.frames.size() - 1);
    out.frames.push_back(
        interpolate(motion.frames[i], motion.frames[j], at - static_cast<double>(i)));
  }
  return out;
}

HumanMotion slice(const HumanMotion& motion, std::size_t first, std::size_t last) {
  HumanMotion out = without_frames(motion);
  out.start_time = motion.start_time + static_cast<double>(first) / motion.rate;
  out.frames.assign(motion.frames.begin() + static_cast<std::ptrdiff_t>(first),
                    motion.frames.begin() + static_cast<std::ptrdiff_t>(last) + 1);
  return out;
}

}  // namespace clamber
