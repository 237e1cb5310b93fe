#include "planner_offline/search/placement_search.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <future>
#include <limits>
#include <memory>
#include <mutex>
#include <set>

namespace clamber {
namespace {

/// A knee has only half an arm's room: `share` of the search's step. What helps most often first.
struct Direction {
  double Placing::*member;
  double share;
};
constexpr Direction kDirections[] = {{&Placing::arms_apart, 1.0},
                                     {&Placing::last_side_back, 1.0},
                                     {&Placing::arms_forward, 1.0},
                                     {&Placing::legs_inward, 0.5},
                                     {&Placing::legs_forward, 0.5}};

constexpr double kTrifle = 0.005;  // of a move's score: 1 mm of a failed move's shortfall

Placing moved(Placing placing, double Placing::*member, double by) {
  placing.*member += by;
  return placing;
}

/// At 1 it is `b`.
Placing between(const Placing& a, const Placing& b, double share) {
  Placing result = a;
  for (const Direction& direction : kDirections) {
    result.*direction.member += share * (b.*direction.member - a.*direction.member);
  }
  return result;
}

struct Attempt {
  Placing placing;
  SearchResult result;
  std::vector<CostSample> costs;
  double reference_seconds = 0.0;
  double seconds = 0.0;
  double score = -std::numeric_limits<double>::infinity();
  bool checked = false;  ///< a climb, with a certificate
};

bool same(const Placing& a, const Placing& b) {
  return std::all_of(std::begin(kDirections), std::end(kDirections), [&](auto direction) {
    return std::abs(a.*direction.member - b.*direction.member) < 1e-9;
  });
}

class PlacementSearch {
 public:
  PlacementSearch(const RobotModel& model, const Scenario& scenario, const Clearance& clearance,
                  const PlannerSettings& settings, const Configuration& start,
                  const std::vector<Move>& moves, const ClimbCheck& check,
                  const MotionSearch::Progress& progress);

  [[nodiscard]] ClimbSearch run();

 private:
  [[nodiscard]] std::vector<Move> placed(const Placing& placing) const;
  [[nodiscard]] Attempt attempt(const Placing& placing) const;
  [[nodiscard]] double steadiness(const std::vector<Stretch>& stretches) const;
  [[nodiscard]] double score(const SearchResult& result) const;
  [[nodiscard]] bool try_all(const std::vector<Placing>& placings);
  [[nodiscard]] bool used_up(std::size_t attempts) const;
  [[nodiscard]] bool enough() const;
  [[nodiscard]] bool hopeless(double step) const;
  [[nodiscard]] std::string why_given_up(double step) const;
  [[nodiscard]] bool finished();
  [[nodiscard]] double score_of(const Placing& placing) const;
  [[nodiscard]] std::vector<Placing> together(const Placing& from, double step) const;
  void go_on_from(Placing last);
  void keep(Attempt attempt);
  void give_up_best(const std::string& why);
  void check_best();

  const RobotModel& model_;
  const Scenario& scenario_;
  const Clearance& clearance_;
  Clearance resting_;  // to the obstacle where it is
  const PlannerSettings& settings_;
  const Configuration& start_;
  const std::vector<Move>& moves_;
  const ClimbCheck& check_;
  MotionSearch::Progress progress_;
  std::set<std::string> standing_limbs_;
  double last_side_ = 0.0;  // sign of y of the leg that leaves the floor last
  struct Tried {
    Placing placing;
    double score;
  };
  std::vector<Tried> tried_;
  Attempt best_;
  std::vector<Attempt> lesser_;  // other climbs, should the best one get no certificate
  double reference_seconds_ = 0.0, seconds_ = 0.0;
  ClimbSearch found_;
};

PlacementSearch::PlacementSearch(const RobotModel& model, const Scenario& scenario,
                                 const Clearance& clearance, const PlannerSettings& settings,
                                 const Configuration& start, const std::vector<Move>& moves,
                                 const ClimbCheck& check, const MotionSearch::Progress& progress)
    : model_(model),
      scenario_(scenario),
      clearance_(clearance),
      resting_(model, scenario, where_it_is(settings.clearance)),
      settings_(settings),
      start_(start),
      moves_(moves),
      check_(check) {
  for (const ContactLink& contact : model.contacts) {
    if (contact.is_patch) {
      standing_limbs_.insert(contact.limb);
    }
  }
  for (const Move& move : moves) {
    for (const int link : move.lands) {
      if (standing_limbs_.count(model.contacts[static_cast<std::size_t>(link)].limb) != 0) {
        last_side_ = std::copysign(1.0, move.references.at(link).y());
      }
    }
  }
  const auto mutex = std::make_shared<std::mutex>();
  progress_ = [mutex, &progress](int move, int of, const std::string& what) {
    const std::lock_guard lock(*mutex);
    progress(move, of, what);
  };
}

std::vector<Move> PlacementSearch::placed(const Placing& placing) const {
  std::vector<Move> result = moves_;
  for (Move& move : result) {
    for (auto& [link, reference] : move.references) {
      const double side = std::copysign(1.0, reference.y());
      if (standing_limbs_.count(model_.contacts[static_cast<std::size_t>(link)].limb) == 0) {
        const bool last_side = reference.y() * last_side_ > 0.0;
        reference.x() += placing.arms_forward - (last_side ? placing.last_side_back : 0.0);
        reference.y() += side * std::max(placing.arms_apart, -std::abs(reference.y()));
      } else {
        reference.y() -= side * std::min(placing.legs_inward, std::abs(reference.y()));
        reference.x() += placing.legs_forward;
      }
    }
  }
  return result;
}

/// Worst support margin of a climb once hands carry, less a little for torque beyond what is easy
/// and for a posture in the end that is near an edge, m.
double PlacementSearch::steadiness(const std::vector<Stretch>& stretches) const {
  double worst = std::numeric_limits<double>::infinity(), peak = 0.0;
  RobotData data;
  ContactForces forces(model_, settings_.forces);
  constexpr std::size_t kEvery = 3;
  for (const Stretch& stretch : stretches) {
    for (std::size_t i = 0; i < stretch.path.size(); i += kEvery) {
      forward_kinematics(model_, stretch.path[i], data);
      peak = std::max(peak, forces.solve(data, stretch.contacts).peak_share);
      if (!only_patches(model_, stretch.contacts)) {
        const SupportRegion region(contact_points(model_, data, stretch.contacts));
        worst = std::min(worst, region.margin(data.com.head<2>()));
      }
    }
  }
  // Shanks and feet that come to rest close to an edge end up on it when the joints sag.
  forward_kinematics(model_, stretches.back().path.back(), data);
  const double gap = resting_.report(data, stretches.back().contacts, {}).obstacle;
  constexpr double kRestingGap = 0.025;  // m
  constexpr double kEasyShare = 0.6;     // of a joint's torque limit
  constexpr double kPerShare = 0.03;     // m of margin that the whole limit more is worth
  return worst - kPerShare * std::max(0.0, peak - kEasyShare) - std::max(0.0, kRestingGap - gap);
}

/// Climbs by their steadiness, failures below them by how far they came.
double PlacementSearch::score(const SearchResult& result) const {
  if (result.success) {
    return static_cast<double>(moves_.size()) + 1.0 + steadiness(result.stretches);
  }
  constexpr double kFar = 0.2;  // m
  return static_cast<double>(result.furthest) - std::min(1.0, result.shortfall / kFar);
}

Attempt PlacementSearch::attempt(const Placing& placing) const {
  const auto begin = std::chrono::steady_clock::now();
  Attempt attempt;
  attempt.placing = placing;
  ReferenceOptimiser references(model_, scenario_, clearance_, settings_);
  MotionSearch search(model_, scenario_, clearance_, settings_, references);
  attempt.result = search.run(start_, placed(placing), progress_);
  attempt.score = score(attempt.result);
  attempt.costs = references.log();
  attempt.reference_seconds = references.seconds();
  attempt.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return attempt;
}

/// Takes stock of an attempt.
void PlacementSearch::keep(Attempt attempt) {
  ++found_.attempts;
  tried_.push_back({attempt.placing, attempt.score});
  found_.candidates += attempt.result.candidates_tried;
  found_.backtracks += attempt.result.backtracks;
  found_.costs.insert(found_.costs.end(), attempt.costs.begin(), attempt.costs.end());
  found_.rejected.insert(found_.rejected.end(), attempt.result.rejected.begin(),
                         attempt.result.rejected.end());
  reference_seconds_ += attempt.reference_seconds;
  seconds_ += attempt.seconds;
  if (attempt.score > best_.score) {
    std::swap(attempt, best_);
  }
  if (attempt.result.success) {
    lesser_.push_back(std::move(attempt));
  }
}

/// A climb without a certificate counts as a failure after the last move.
void PlacementSearch::give_up_best(const std::string& why) {
  SearchResult& result = best_.result;
  result.success = false;
  result.failure = why;
  result.furthest = moves_.size();
  result.shortfall = 0.0;
  best_.score = score(result);
  found_.rejected.push_back(why);
  const auto next =
      std::max_element(lesser_.begin(), lesser_.end(),
                       [](const Attempt& a, const Attempt& b) { return a.score < b.score; });
  if (next != lesser_.end()) {
    best_ = std::move(*next);
    lesser_.erase(next);
  }
}

bool PlacementSearch::used_up(std::size_t attempts) const {
  return found_.attempts >= attempts ||
         found_.candidates >= settings_.search.most_candidates_in_all;
}

bool PlacementSearch::enough() const {
  const SearchSettings& search = settings_.search;
  if (best_.result.success) {
    const double steadiness = best_.score - static_cast<double>(moves_.size()) - 1.0;
    return steadiness >= search.steady_margin || used_up(search.steady_attempts);
  }
  return used_up(search.most_attempts);
}

/// Reach, and the room for the centre of mass, change about as much as contacts are moved. Where no
/// move by twice this step brought the furthest attempt nearer, this step does not mend a shortfall
/// of more than two steps; a nominal one is no distance.
bool PlacementSearch::hopeless(double step) const {
  constexpr double kMended = 2.0;  // of the step
  return !best_.result.success && best_.result.shortfall != kNominalShortfall &&
         best_.result.shortfall > kMended * step;
}

/// @param step  of the places tried last, m
std::string PlacementSearch::why_given_up(double step) const {
  char text[200];
  if (found_.candidates >= settings_.search.most_candidates_in_all) {
    std::snprintf(text, sizeof text,
                  "%zu candidates are its share of search.most_candidates_in_all",
                  found_.candidates);
  } else if (found_.attempts >= settings_.search.most_attempts) {
    std::snprintf(text, sizeof text, "%zu sets of places are used up (search.most_attempts)",
                  found_.attempts);
  } else {
    std::snprintf(text, sizeof text, "moving contacts by %.0f mm brings it no nearer", 1e3 * step);
  }
  return text;
}

/// The climb that would be taken is asked for its certificate, which costs as much as to find one.
void PlacementSearch::check_best() {
  if (const std::string why = check_(best_.result); !why.empty()) {
    return give_up_best(why);
  }
  best_.checked = true;
}

bool PlacementSearch::finished() {
  while (enough() && best_.result.success && !best_.checked) {
    check_best();
  }
  return enough();
}

/// Attempts in pairs, each in a thread of its own; the order of the results is that of the list.
/// True when one of them is better than all before by more than a trifle.
bool PlacementSearch::try_all(const std::vector<Placing>& placings) {
  const double before = best_.score;
  std::vector<Placing> fresh;
  for (const Placing& placing : placings) {
    if (std::none_of(fresh.begin(), fresh.end(),
                     [&](const Placing& other) { return same(placing, other); }) &&
        std::none_of(tried_.begin(), tried_.end(),
                     [&](const Tried& other) { return same(placing, other.placing); })) {
      fresh.push_back(placing);
    }
  }
  for (std::size_t i = 0; i < fresh.size() && !finished(); i += 2) {
    std::future<Attempt> other;
    if (i + 1 < fresh.size()) {
      other = std::async(std::launch::async, [this, &fresh, i] { return attempt(fresh[i + 1]); });
    }
    keep(attempt(fresh[i]));
    if (other.valid()) {
      keep(other.get());
    }
  }
  return best_.score > before + (best_.result.success ? 0.0 : kTrifle);
}

double PlacementSearch::score_of(const Placing& placing) const {
  const auto tried = std::find_if(tried_.begin(), tried_.end(),
                                  [&](const Tried& other) { return same(placing, other.placing); });
  return tried == tried_.end() ? -std::numeric_limits<double>::infinity() : tried->score;
}

/// What helped alone, together: all directions that did, and the best two of them. How far a climb
/// gets changes smoothly enough with the places that this saves many attempts.
std::vector<Placing> PlacementSearch::together(const Placing& from, double step) const {
  struct Help {
    double gain;
    double Placing::*member;
    double by;
  };
  std::vector<Help> helps;
  for (const Direction& direction : kDirections) {
    const auto help = [&](double by) {
      return Help{score_of(moved(from, direction.member, by)) - score_of(from), direction.member,
                  by};
    };
    const Help back = help(-direction.share * step), on = help(direction.share * step);
    const Help& better = back.gain > on.gain ? back : on;
    if (better.gain > kTrifle) helps.push_back(better);
  }
  std::sort(helps.begin(), helps.end(),
            [](const Help& a, const Help& b) { return a.gain > b.gain; });
  std::vector<Placing> result;
  Placing sum = from;
  for (std::size_t i = 0; i < helps.size(); ++i) {
    sum.*helps[i].member += helps[i].by;
    if (i == 1 || (i > 1 && i + 1 == helps.size())) result.push_back(sum);
  }
  std::reverse(result.begin(), result.end());
  return result;
}

/// The way from there to the best places, on and on while it helps.
void PlacementSearch::go_on_from(Placing last) {
  for (Placing here = best_.placing; !same(here, last); here = best_.placing) {
    if (!try_all({between(last, here, 1.5), between(last, here, 2.0)})) return;
    last = here;
  }
}

ClimbSearch PlacementSearch::run() {
  (void)try_all({Placing{}});
  double step = 0.06;  // m
  constexpr double kFinest = 0.0075;
  double tried = 0.0;  // m, the last step
  while (!finished() && step >= kFinest) {
    tried = step;
    const Placing from = best_.placing;
    std::vector<Placing> around;
    for (const Direction& direction : kDirections) {
      for (const double sign : {-1.0, 1.0}) {
        around.push_back(moved(from, direction.member, sign * direction.share * step));
      }
    }
    const bool better = try_all(around);
    (void)try_all(together(from, step));
    go_on_from(from);
    if (!better) {
      step *= 0.5;
      if (hopeless(step)) {
        break;
      }
    }
  }
  while (best_.result.success && !best_.checked) {
    check_best();
  }
  if (!best_.result.success) {
    found_.given_up = why_given_up(tried);
  }
  found_.best = std::move(best_.result);
  found_.reference_share = seconds_ > 0.0 ? reference_seconds_ / seconds_ : 0.0;
  return std::move(found_);
}

}  // namespace

ClimbSearch search_climb(const RobotModel& model, const Scenario& scenario,
                         const Clearance& clearance, const PlannerSettings& settings,
                         const Configuration& start, const std::vector<Move>& moves,
                         const ClimbCheck& check, const MotionSearch::Progress& progress) {
  return PlacementSearch(model, scenario, clearance, settings, start, moves, check, progress).run();
}

}  // namespace clamber
