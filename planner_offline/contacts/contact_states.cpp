#include "planner_offline/contacts/contact_states.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

namespace clamber {
namespace {

enum Surface { kOnObstacle, kOnFloor };
/// A surface and a link (index into the order of links).
using Touch = std::pair<Surface, std::size_t>;
using Signal = std::vector<bool>;  // per sample

/// Samples [first, last) with one set of touches.
struct Run {
  std::vector<Touch> touches;
  std::size_t first = 0;
  std::size_t last = 0;
  std::size_t counted_from = 0;  ///< where it starts once shorter runs are counted to it
};

const std::vector<ContactReference>& list_of(const ContactSample& sample, Surface surface) {
  return surface == kOnObstacle ? sample.obstacle : sample.floor;
}

/// Inverts every stretch of `value` that is shorter than `count` samples. A break at the start or
/// the end of the recording stays: it is not enclosed by touches.
void drop_short(Signal& signal, bool value, std::size_t count) {
  std::size_t first = 0;
  while (first < signal.size()) {
    std::size_t last = first;
    while (last < signal.size() && signal[last] == signal[first]) {
      ++last;
    }
    const bool enclosed = first > 0 && last < signal.size();
    if (signal[first] == value && last - first < count && (value || enclosed)) {
      std::fill(signal.begin() + static_cast<std::ptrdiff_t>(first),
                signal.begin() + static_cast<std::ptrdiff_t>(last), !value);
    }
    first = last;
  }
}

/// Counts runs shorter than `count` samples to the next one (at the end: to the one before).
std::vector<Run> absorb_short(const std::vector<Run>& runs, std::size_t count) {
  std::vector<Run> kept;
  std::size_t pending = 0;
  for (const Run& run : runs) {
    if (run.last - run.first < count) {
      continue;
    }
    if (!kept.empty() && kept.back().touches == run.touches) {
      kept.back().last = run.last;
    } else {
      kept.push_back(run);
      kept.back().counted_from = pending;
    }
    pending = run.last;
  }
  return kept;
}

double mean_stability(const ContactSample& sample) {
  double sum = 0.0;
  for (const ContactReference& contact : sample.obstacle) {
    sum += contact.stability;
  }
  return sample.obstacle.empty() ? std::numeric_limits<double>::infinity()
                                 : sum / static_cast<double>(sample.obstacle.size());
}

/// Reads one playback's samples as states.
class StateBuilder {
 public:
  StateBuilder(std::span<const ContactSample> samples, std::span<const std::string> links,
               const StateConfig& config)
      : samples_(samples), links_(links), config_(config) {
    const double period =
        (samples.back().time - samples.front().time) / static_cast<double>(samples.size() - 1);
    count_ = static_cast<std::size_t>(std::max(1.0, std::ceil(config.debounce / period - 1e-9)));
  }

  [[nodiscard]] std::vector<ContactState> states() const {
    std::vector<ContactState> states;
    for (const Run& run : absorb_short(runs(), count_)) {
      if (run.touches.empty() || run.touches.front().first != kOnObstacle) {
        continue;
      }
      for (const Run& part : split_moved(run)) {
        states.push_back(make_state(part));
      }
    }
    return states;
  }

 private:
  [[nodiscard]] std::map<Touch, Signal> signals() const {
    std::map<Touch, Signal> signals;
    for (std::size_t k = 0; k < samples_.size(); ++k) {
      for (const Surface surface : {kOnObstacle, kOnFloor}) {
        for (const ContactReference& contact : list_of(samples_[k], surface)) {
          const auto link = std::find(links_.begin(), links_.end(), contact.link) - links_.begin();
          Signal& signal = signals[{surface, static_cast<std::size_t>(link)}];
          signal.resize(samples_.size(), false);
          signal[k] = true;
        }
      }
    }
    for (auto& [touch, signal] : signals) {
      drop_short(signal, false, count_);
      drop_short(signal, true, count_);
    }
    return signals;
  }

  [[nodiscard]] std::vector<Run> runs() const {
    const std::map<Touch, Signal> all = signals();
    std::vector<Run> runs;
    for (std::size_t k = 0; k < samples_.size(); ++k) {
      std::vector<Touch> touches;
      for (const auto& [touch, signal] : all) {
        if (signal[k]) {
          touches.push_back(touch);
        }
      }
      if (runs.empty() || runs.back().touches != touches) {
        runs.push_back({std::move(touches), k, k, k});
      }
      runs.back().last = k + 1;
    }
    return runs;
  }

  [[nodiscard]] const ContactReference* find(std::size_t k, const Touch& touch) const {
    for (const ContactReference& contact : list_of(samples_[k], touch.first)) {
      if (contact.link == links_[touch.second]) {
        return &contact;
      }
    }
    return nullptr;
  }

  /// The touch as last seen at or before sample `at`, else as first seen after it. (The sample
  /// itself need not show it: short breaks are closed, and a break may begin before the run.)
  [[nodiscard]] ContactReference reference(std::size_t at, const Touch& touch) const {
    for (std::size_t back = 0; back <= at; ++back) {
      if (const ContactReference* contact = find(at - back, touch)) {
        return *contact;
      }
    }
    std::size_t k = at + 1;
    while (find(k, touch) == nullptr) {
      ++k;
    }
    return *find(k, touch);
  }

  [[nodiscard]] bool has_moved(const Run& run, std::size_t from, std::size_t to) const {
    return std::any_of(run.touches.begin(), run.touches.end(), [&](const Touch& touch) {
      const Eigen::Vector3d a = reference(from, touch).position;
      const Eigen::Vector3d b = reference(to, touch).position;
      return touch.first == kOnObstacle && (b - a).norm() > config_.moved;
    });
  }

  /// Cuts a run wherever a contact with the obstacle has moved on since the last cut.
  [[nodiscard]] std::vector<Run> split_moved(const Run& run) const {
    std::vector<Run> parts{run};
    for (std::size_t k = run.first + 1; k < run.last; ++k) {
      const bool room = k - parts.back().first >= count_ && run.last - k >= count_;
      if (room && has_moved(run, parts.back().first, k)) {
        parts.back().last = k;
        parts.push_back({run.touches, k, run.last, k});
      }
    }
    return parts;
  }

  /// Whether the sample shows every contact with the obstacle, and no other (a closed break, a
  /// dropped flicker).
  [[nodiscard]] bool complete(std::size_t k, const Run& run) const {
    std::size_t expected = 0;
    for (const Touch& touch : run.touches) {
      if (touch.first == kOnObstacle) {
        ++expected;
        if (find(k, touch) == nullptr) {
          return false;
        }
      }
    }
    return samples_[k].obstacle.size() == expected;
  }

  [[nodiscard]] std::size_t best_sample(const Run& run) const {
    const auto rank = [&](std::size_t k) {
      return std::make_tuple(!complete(k, run), samples_[k].stability, mean_stability(samples_[k]));
    };
    std::size_t best = run.first;
    for (std::size_t k = run.first + 1; k < run.last; ++k) {
      best = rank(k) < rank(best) ? k : best;
    }
    return best;
  }

  [[nodiscard]] ContactState make_state(const Run& run) const {
    const std::size_t best = best_sample(run);
    ContactState state;
    state.start = samples_[run.counted_from].time;
    state.end = samples_[std::min(run.last, samples_.size() - 1)].time;
    state.stability = samples_[best].stability;
    state.posture = samples_[best].posture;
    for (const Touch& touch : run.touches) {
      auto& list = touch.first == kOnObstacle ? state.obstacle : state.floor;
      list.push_back(reference(best, touch));
    }
    return state;
  }

  std::span<const ContactSample> samples_;
  std::span<const std::string> links_;
  StateConfig config_;
  std::size_t count_ = 1;  ///< samples in the debounce time
};

}  // namespace

std::vector<ContactState> build_states(std::span<const ContactSample> samples,
                                       std::span<const std::string> links,
                                       const StateConfig& config) {
  if (samples.size() < 2) {
    return {};
  }
  return StateBuilder(samples, links, config).states();
}

}  // namespace clamber
