#include "planner_offline/recording/climb_window.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using Eigen::Vector3d;

constexpr double kDeg = std::numbers::pi / 180.0;
constexpr double kRestTime = 0.3;     // s that a support must last
constexpr double kHandStill = 0.25;   // m/s
constexpr double kKneeStill = 0.15;   // m/s
constexpr double kFootStill = 0.10;   // m/s
constexpr double kSpeedWindow = 0.1;  // s over which speeds are taken
constexpr double kHandsAway = 0.3;    // of the hip height, horizontally from the hips
constexpr double kTrunkBent = 25.0 * kDeg;
constexpr double kBendOnset = 2.0 * kDeg;
constexpr double kFeetLevel = 0.06;       // m
constexpr double kStandingTime = 0.5;     // s kept before the climb starts
constexpr double kShankLevel = 0.5;       // knee above ankle by less than this share of the shank
constexpr double kKneesGap = 0.2;         // s of noise tolerated within the kneeling stretch
constexpr double kKneesMargin = 0.1;      // s before a knee leaves again
constexpr double kToeJointHeight = 0.02;  // m above the sole
// Hip height over thigh plus shank, and ankle height over the same (Drillis and Contini 1966).
constexpr double kHipOverLeg = 0.530 / 0.491;
constexpr double kUpright = 0.93;  // of the bones' hip height: the person stands

class ClimbFinder {
 public:
  ClimbFinder(const HumanMotion& motion, const WindowOptions& options)
      : motion_(motion), options_(options) {
    if (motion.frames.empty()) throw InputError(motion.source + ": no frames");
    for (const std::string side : {"Right", "Left"}) {
      const auto s = static_cast<std::size_t>(side == "Left");
      shoulder_[s] = motion.segment(side + "UpperArm");
      wrist_[s] = motion.segment(side + "Hand");
      hip_[s] = motion.segment(side + "UpperLeg");
      knee_[s] = motion.segment(side + "LowerLeg");
      ankle_[s] = motion.segment(side + "Foot");
      toe_[s] = motion.segment(side + "Toe");
    }
    leg_ = (at(0, hip_[0]) - at(0, knee_[0])).norm() + (at(0, knee_[0]) - at(0, ankle_[0])).norm();
    shank_ = (at(0, knee_[0]) - at(0, ankle_[0])).norm();
    hips_from_bones_ = kHipOverLeg * leg_;
  }

  ClimbWindow find() {
    window_.last = motion_.frames.size() - 1;
    check_option(options_.start, "start");
    check_option(options_.end, "end");
    const std::size_t from = options_.start ? frame_at(*options_.start) : 0;
    const std::size_t until = options_.end ? frame_at(*options_.end) : window_.last;
    if (from >= until && motion_.frames.size() > 1) {
      throw InputError(motion_.source + ": start and end leave no frames");
    }
    const auto hands = hands_on(from, until);
    if (!hands) {
      window_.warnings.push_back(
          "no hand support was found: the climb's start and end could not be told");
    }
    window_.first = options_.start || !hands ? from : standing_before(*hands, from);
    window_.last = options_.end || !hands ? until : kneeling_after(*hands, until);
    set_floor(std::clamp(hands.value_or(window_.first), window_.first, window_.last));
    set_hip_height();
    set_heading();
    return std::move(window_);
  }

 private:
  const Vector3d& at(std::size_t frame, std::size_t segment) const {
    return motion_.frames[frame].origin[segment];
  }
  Vector3d middle(std::size_t frame, const std::array<std::size_t, 2>& pair) const {
    return 0.5 * (at(frame, pair[0]) + at(frame, pair[1]));
  }

  std::size_t frames_in(double time) const {
    return static_cast<std::size_t>(std::lround(time * motion_.rate));
  }
  std::size_t frame_at(double time) const {
    return std::min(frames_in(time - motion_.start_time), motion_.frames.size() - 1);
  }

  void check_option(const std::optional<double>& time, const char* name) const {
    const double end = motion_.start_time + motion_.duration();
    if (time && !(*time >= motion_.start_time && *time <= end)) {
      throw InputError(motion_.source + ": " + name + " " + std::to_string(*time) +
                       " s: expected " + std::to_string(motion_.start_time) + " to " +
                       std::to_string(end) + " s");
    }
  }

  double speed(std::size_t frame, std::size_t segment) const {
    const std::size_t half = std::max<std::size_t>(1, frames_in(0.5 * kSpeedWindow));
    const std::size_t before = frame > half ? frame - half : 0;
    const std::size_t after = std::min(frame + half, motion_.frames.size() - 1);
    if (after == before) return 0.0;
    return (at(after, segment) - at(before, segment)).norm() * motion_.rate /
           static_cast<double>(after - before);
  }

  double trunk_tilt(std::size_t frame) const {
    const Vector3d trunk = middle(frame, shoulder_) - middle(frame, hip_);
    return std::atan2(trunk.head<2>().norm(), trunk.z());
  }

  bool hands_rest(std::size_t frame) const {
    if (trunk_tilt(frame) < kTrunkBent) return false;
    const Vector3d hips = middle(frame, hip_);
    for (std::size_t s = 0; s < 2; ++s) {
      const Vector3d& wrist = at(frame, wrist_[s]);
      if ((wrist - hips).head<2>().norm() < kHandsAway * hips_from_bones_) return false;
      if (wrist.z() > at(frame, shoulder_[s]).z()) return false;
      if (speed(frame, wrist_[s]) > kHandStill) return false;
    }
    return true;
  }

  std::optional<std::size_t> hands_on(std::size_t from, std::size_t until) const {
    const std::size_t needed = frames_in(kRestTime);
    std::size_t count = 0;
    for (std::size_t f = from; f <= until; ++f) {
      count = hands_rest(f) ? count + 1 : 0;
      if (count > needed) return f - count + 1;
    }
    return std::nullopt;
  }

  bool stands(std::size_t frame) const {
    return trunk_tilt(frame) < kTrunkBent && speed(frame, ankle_[0]) < kFootStill &&
           speed(frame, ankle_[1]) < kFootStill &&
           std::abs(at(frame, ankle_[0]).z() - at(frame, ankle_[1]).z()) < kFeetLevel;
  }

  std::size_t standing_before(std::size_t hands, std::size_t from) {
    for (std::size_t f = hands; f > from; --f) {
      if (!stands(f)) continue;
      std::size_t first = f;
      while (first > from && stands(first - 1)) --first;
      return std::max(first, before_bending(first, f));
    }
    window_.warnings.push_back("no standing posture was found before the hands touch");
    return from;
  }

  /// Half a second before the trunk last leaves its most upright posture in first..last.
  std::size_t before_bending(std::size_t first, std::size_t last) const {
    double upright = trunk_tilt(first);
    for (std::size_t f = first; f <= last; ++f) upright = std::min(upright, trunk_tilt(f));
    std::size_t bends = last;
    while (bends > first && trunk_tilt(bends) > upright + kBendOnset) --bends;
    return bends - std::min(bends, frames_in(kStandingTime));
  }

  bool kneels(std::size_t frame, double floor) const {
    for (std::size_t s = 0; s < 2; ++s) {
      const Vector3d& knee = at(frame, knee_[s]);
      const Vector3d& ankle = at(frame, ankle_[s]);
      if (speed(frame, knee_[s]) > kKneeStill) return false;
      if (knee.z() - ankle.z() > kShankLevel * shank_) return false;
      // On a floor the ankle of a kneeling person lies next to it.
      if (ankle.z() - floor < 0.5 * shank_ - kToeJointHeight && knee.z() - floor < 0.5 * shank_) {
        return false;
      }
    }
    return true;
  }

  std::size_t kneeling_after(std::size_t hands, std::size_t until) {
    const double floor = lowest_floor(window_.first, hands);
    std::size_t first = 0, last = 0;
    bool found = false;
    for (std::size_t f = hands; f <= until; ++f) {
      if (kneels(f, floor)) {
        if (!found) first = f;
        found = true;
        last = f;
      } else if (found && f - last > frames_in(kKneesGap)) {
        if (last - first >= frames_in(kRestTime)) break;
        found = false;
      }
    }
    if (!found || last - first < frames_in(kRestTime)) {
      window_.warnings.push_back("no rest on both knees was found: kept to the end");
      return until;
    }
    return last == until ? last : std::max(first, last - frames_in(kKneesMargin));
  }

  double lowest_floor(std::size_t first, std::size_t last) const {
    if (options_.floor) return *options_.floor;
    double toe = at(first, toe_[0]).z();
    for (std::size_t f = first; f <= last; ++f) {
      toe = std::min({toe, at(f, toe_[0]).z(), at(f, toe_[1]).z()});
    }
    return toe - kToeJointHeight;
  }

  /// @param hands frame of hands on, or the first one
  void set_floor(std::size_t hands) {
    window_.floor = lowest_floor(window_.first, hands);
    const double hips = middle(window_.first, hip_).z();
    if (!(window_.floor < hips) || hips - window_.floor > 3.0 * leg_) {
      throw InputError(motion_.source + ": floor " + std::to_string(window_.floor) +
                       " m does not fit hips at " + std::to_string(hips) + " m");
    }
  }

  void set_hip_height() {
    const std::size_t standing = std::min(window_.last, window_.first + frames_in(kStandingTime));
    for (std::size_t f = window_.first; f <= standing; ++f) {
      window_.hip_height = std::max(window_.hip_height, middle(f, hip_).z() - window_.floor);
    }
    if (window_.hip_height < kUpright * hips_from_bones_ ||
        window_.hip_height > hips_from_bones_ / kUpright) {
      window_.hip_height = hips_from_bones_;
      window_.warnings.push_back(
          "the person does not stand upright at the start: hip height taken from the leg bones");
    }
  }

  void set_heading() {
    // Angles around the mean direction, so that the median does not care about +-180 deg.
    Vector3d mean = Vector3d::Zero();
    std::vector<Vector3d> forward;
    for (std::size_t f = window_.first; f <= window_.last; ++f) {
      const Vector3d left = at(f, hip_[1]) - at(f, hip_[0]);
      const Vector3d normal(left.y(), -left.x(), 0.0);
      if (normal.norm() < 1e-6) continue;
      forward.push_back(normal.normalized());
      mean += forward.back();
    }
    if (mean.norm() < 1e-6) return;
    const double reference = std::atan2(mean.y(), mean.x());
    std::vector<double> offsets;
    offsets.reserve(forward.size());
    for (const auto& v : forward) {
      offsets.push_back(
          std::remainder(std::atan2(v.y(), v.x()) - reference, 2.0 * std::numbers::pi));
    }
    const auto half = offsets.begin() + static_cast<std::ptrdiff_t>(offsets.size() / 2);
    std::nth_element(offsets.begin(), half, offsets.end());
    window_.heading = std::remainder(reference + *half, 2.0 * std::numbers::pi);
  }

  const HumanMotion& motion_;
  const WindowOptions& options_;
  std::array<std::size_t, 2> shoulder_{}, wrist_{}, hip_{}, knee_{}, ankle_{}, toe_{};
  double leg_ = 0.0, shank_ = 0.0, hips_from_bones_ = 0.0;
  ClimbWindow window_;
};

}  // namespace

ClimbWindow find_climb(const HumanMotion& motion, const WindowOptions& options) {
  return ClimbFinder(motion, options).find();
}

}  // namespace clamber
