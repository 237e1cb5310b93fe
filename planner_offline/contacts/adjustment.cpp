#include "planner_offline/contacts/adjustment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "planner_offline/contacts/standing_leg.hpp"
#include "planner_offline/planning_failed.hpp"
#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr double kStanding = 0.5;     // s before the first touch: the feet show the floor
constexpr double kBelowFloor = 0.02;  // m, a sole lower than this: an earlier step up
constexpr double kAfter = 0.5;        // s played after the last touch

/// A sphere in the motion's world, m.
struct Ball {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  double radius = 0.0;
};

/// What the search needs of one sample of the motion.
struct Sample {
  double time = 0.0;
  double base_y = 0.0;
  std::vector<Ball> limbs;      ///< wrists, elbows, knees
  std::vector<bool> upright;    ///< per limb: a shank that stands on its foot, no knee to rest on
  std::vector<Ball> soles;      ///< middles of the soles, radius 0
  std::vector<Ball> forbidden;  ///< torso and pelvis, as balls along their axes
  double lower_sole = 0.0;      ///< m, lowest corner of the lower foot
  double upper_sole = 0.0;      ///< m, lowest corner of the other
  std::vector<Ball> corners;    ///< sole corners, radius 0
};

Ball ball(const Eigen::Vector3d& p, double radius) { return {p.x(), p.y(), p.z(), radius}; }

void add_geom(const Geom& geom, const RobotData& data, std::vector<Ball>& balls) {
  const Pose X_WG = data.X_WB[static_cast<std::size_t>(geom.body)] * geom.X_BG;
  const double radius = geom.shape == Shape::kBox ? geom.half_extents.minCoeff() : geom.radius;
  const double half = geom.shape == Shape::kCapsule ? 0.5 * geom.length : 0.0;
  for (const double t : {-half, 0.0, half}) {
    balls.push_back(ball(X_WG * Eigen::Vector3d(0.0, 0.0, t), radius));
  }
}

class Search {
 public:
  Search(const RobotModel& model, const RobotMotion& motion, const AdjustmentConfig& config)
      : model_(model), config_(config) {
    for (std::size_t i = 0; i < model.contacts.size(); ++i) {
      (model.contacts[i].is_patch ? feet_ : limbs_).push_back(i);
    }
    const auto stride =
        static_cast<std::size_t>(std::max(1.0, std::round(config.sample_period * motion.rate)));
    period_ = static_cast<double>(stride) / motion.rate;
    for (std::size_t k = 0; k < motion.frames.size(); k += stride) {
      add_sample(static_cast<double>(k) / motion.rate, motion.frames[k]);
    }
  }

  [[nodiscard]] Adjustment run() const {
    Adjustment best;
    best.score = -std::numeric_limits<double>::infinity();
    const auto [near, far] = front_range();
    const auto [low, high] = sole_range();
    for (double top = low + config_.lowest; top <= high + config_.highest;
         top += config_.height_step) {
      for (double front = near; front <= far; front += config_.distance_step) {
        for (const Episode& episode : episodes(top, front)) {
          Adjustment candidate = evaluate(top, front, episode, best.score);
          if (candidate.score > best.score) {
            best = std::move(candidate);
          }
        }
      }
    }
    return best;
  }

 private:
  void add_sample(double time, const Configuration& x) {
    RobotData data;
    forward_kinematics(model_, x, data);
    Sample sample;
    sample.time = time;
    sample.base_y = x.X_WB.p.y();
    std::vector<double> soles;
    for (const ContactLink& link : model_.contacts) {
      const Pose& X_WB = data.X_WB[static_cast<std::size_t>(link.body)];
      if (!link.is_patch) {
        sample.limbs.push_back(ball(X_WB * link.points.front(), link.radius));
        // A knee may be at the height of the top, before the obstacle, while its leg stands.
        sample.upright.push_back(upright_over_foot(model_, link, data));
        continue;
      }
      double lowest = std::numeric_limits<double>::infinity();
      for (const Eigen::Vector3d& corner : link.points) {
        sample.corners.push_back(ball(X_WB * corner, 0.0));
        lowest = std::min(lowest, sample.corners.back().z);
      }
      soles.push_back(lowest);
      sample.soles.push_back(ball(sole_middle(link, data), 0.0));
    }
    const auto [lower, upper] = std::minmax_element(soles.begin(), soles.end());
    sample.lower_sole = *lower;
    sample.upper_sole = *upper;
    for (const int geom : model_.forbidden_geoms) {
      add_geom(model_.geoms[static_cast<std::size_t>(geom)], data, sample.forbidden);
    }
    samples_.push_back(std::move(sample));
  }

  /// Front faces worth trying: somewhere under the limbs' path.
  [[nodiscard]] std::pair<double, double> front_range() const {
    double near = std::numeric_limits<double>::infinity();
    double far = -near;
    for (const Sample& sample : samples_) {
      for (const Ball& limb : sample.limbs) {
        near = std::min(near, limb.x);
        far = std::max(far, limb.x);
      }
    }
    return {near, far};
  }

  [[nodiscard]] std::pair<double, double> sole_range() const {
    const auto [low, high] = std::minmax_element(
        samples_.begin(), samples_.end(),
        [](const Sample& a, const Sample& b) { return a.lower_sole < b.lower_sole; });
    return {low->lower_sole, high->lower_sole};
  }

  /// How well a limb touches, 0..1: fully when it is just below the top (the playback presses it
  /// on), nothing when it is further above than what counts as contact or deeper than the playback
  /// can push it out.
  [[nodiscard]] double touch(const Ball& limb, double top, double front) const {
    const double gap = limb.z - limb.radius - top;
    const double above = 1.0 - std::max(gap, 0.0) / config_.threshold;
    const double below = std::min(1.0, (config_.give + gap) / (0.5 * config_.give));
    const double inset = std::min(1.0, (limb.x - front) / config_.inset);
    return std::min(above, below) > 0.0 && inset > 0.0 ? std::min(above, below) * inset : 0.0;
  }

  [[nodiscard]] bool any_touch(const Sample& sample, double top, double front) const {
    for (std::size_t i = 0; i < sample.limbs.size(); ++i) {
      if (!sample.upright[i] && touch(sample.limbs[i], top, front) > 0.0) {
        return true;
      }
    }
    return std::any_of(sample.soles.begin(), sample.soles.end(),
                       [&](const Ball& sole) { return touch(sole, top, front) > 0.0; });
  }

  [[nodiscard]] static double depth(const Ball& b, double top, double front) {
    return std::max(0.0, std::min(top - (b.z - b.radius), b.x + b.radius - front));
  }

  struct Episode {
    std::size_t first = 0;  ///< first and last sample with a touch
    std::size_t last = 0;
  };

  /// Stretches of touch; a pause longer than `pause` ends one.
  [[nodiscard]] std::vector<Episode> episodes(double top, double front) const {
    std::vector<Episode> episodes;
    for (std::size_t k = 0; k < samples_.size(); ++k) {
      if (!any_touch(samples_[k], top, front)) {
        continue;
      }
      if (episodes.empty() ||
          samples_[k].time - samples_[episodes.back().last].time > config_.pause) {
        episodes.push_back({k, k});
      }
      episodes.back().last = k;
    }
    return episodes;
  }

  [[nodiscard]] Adjustment evaluate(double top, double front, const Episode& episode,
                                    double to_beat) const;
  [[nodiscard]] double touch_score(double top, double front, const Episode& episode,
                                   std::vector<double>& touched) const;
  [[nodiscard]] double penalty(double top, double front, std::size_t first, std::size_t last) const;

  const RobotModel& model_;
  AdjustmentConfig config_;
  std::vector<std::size_t> limbs_;  ///< indices of the point contacts, as in Sample::limbs
  std::vector<std::size_t> feet_;   ///< ... of the patches, as in Sample::soles
  std::vector<Sample> samples_;
  double period_ = 0.0;
};

double Search::touch_score(double top, double front, const Episode& episode,
                           std::vector<double>& touched) const {
  touched.assign(model_.contacts.size(), 0.0);
  for (std::size_t k = episode.first; k <= episode.last; ++k) {
    for (std::size_t i = 0; i < limbs_.size(); ++i) {
      if (!samples_[k].upright[i]) {
        touched[limbs_[i]] += period_ * touch(samples_[k].limbs[i], top, front);
      }
    }
    for (std::size_t i = 0; i < feet_.size(); ++i) {
      touched[feet_[i]] += period_ * touch(samples_[k].soles[i], top, front);
    }
  }
  double score = 0.0;
  for (const double seconds : touched) {
    score += seconds / (seconds + config_.half_time);
  }
  return score;
}

double Search::penalty(double top, double front, std::size_t first, std::size_t last) const {
  double forbidden = 0.0;
  double feet = 0.0;
  double limbs = 0.0;
  for (std::size_t k = first; k <= last; ++k) {
    for (const Ball& b : samples_[k].forbidden) {
      forbidden = std::max(forbidden, depth(b, top, front));
    }
    for (const Ball& b : samples_[k].corners) {
      feet = std::max(feet, depth(b, top, front));
    }
    for (const Ball& b : samples_[k].limbs) {
      limbs = std::max(limbs, depth(b, top, front) - config_.give);
    }
  }
  return config_.forbidden_cost * forbidden + config_.foot_cost * feet + config_.limb_cost * limbs;
}

Adjustment Search::evaluate(double top, double front, const Episode& episode,
                            double to_beat) const {
  Adjustment result;
  result.score = -std::numeric_limits<double>::infinity();
  const double score = touch_score(top, front, episode, result.touch);
  if (score <= to_beat) {
    return result;  // costs only lower it
  }
  const auto samples_in = [this](double seconds) {
    return static_cast<std::size_t>(std::round(seconds / period_));
  };
  const std::size_t standing = episode.first - std::min(episode.first, samples_in(kStanding));
  result.floor = samples_[standing].lower_sole;
  for (std::size_t k = standing; k <= episode.first; ++k) {
    result.floor = std::min(result.floor, samples_[k].lower_sole);
  }
  result.obstacle_height = top - result.floor;
  if (result.obstacle_height < config_.lowest || result.obstacle_height > config_.highest) {
    return result;
  }
  std::size_t first = episode.first;
  while (first > 0 && samples_[first - 1].lower_sole > result.floor - kBelowFloor) {
    --first;
  }
  const std::size_t last = std::min(episode.last + samples_in(kAfter), samples_.size() - 1);
  result.front = front;
  result.lateral = samples_[episode.first].base_y;
  result.start = samples_[first].time;
  result.end = samples_[last].time;
  result.score = score - penalty(top, front, first, last);
  return result;
}

}  // namespace

Configuration Adjustment::apply(const Configuration& x) const {
  Configuration placed = x;
  placed.X_WB.p -= Eigen::Vector3d(front, lateral, floor);
  return placed;
}

Adjustment find_adjustment(const RobotModel& model, const RobotMotion& motion,
                           const AdjustmentConfig& config) {
  if (motion.frames.empty() || !(motion.rate > 0.0)) {
    throw InputError(motion.recording + ": the mapped motion has no frames or no rate");
  }
  Adjustment found = Search(model, motion, config).run();
  if (!std::isfinite(found.score)) {
    throw PlanningFailed(
        motion.recording +
        ": at no obstacle height and distance does a hand, elbow, knee or foot of robot '" +
        model.name + "' touch the obstacle's top when the motion is played");
  }
  return found;
}

}  // namespace clamber
