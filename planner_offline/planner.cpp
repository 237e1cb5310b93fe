#include "planner_offline/planner.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "planner_offline/certify/failure_policy.hpp"
#include "planner_offline/search/goal_search.hpp"
#include "planner_offline/search/invented_sequence.hpp"
#include "planner_offline/search/placement_search.hpp"
#include "planner_offline/search/timing.hpp"

#ifndef CLAMBER_VERSION
#define CLAMBER_VERSION "unversioned"
#endif

namespace clamber {
namespace {

constexpr const char* kAfterAllFours = "after all fours";  // stage of the log

class Stopwatch {
 public:
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Turns stretches into the plan's keyframes: times, contact forces, torques and margins.
class PlanWriter {
 public:
  PlanWriter(const RobotModel& model, const Scenario& scenario, const Clearance& clearance,
             const PlannerSettings& settings, Plan& plan)
      : model_(model),
        scenario_(scenario),
        clearance_(clearance),
        settings_(settings),
        forces_(model, settings.forces),
        plan_(plan) {}

  void add(const Stretch& stretch);

 private:
  [[nodiscard]] ForceSolution forces_at(const Stretch& stretch, double share);
  void add_keyframe(const Stretch& stretch, const TimedPosture& posture);

  const RobotModel& model_;
  const Scenario& scenario_;
  const Clearance& clearance_;
  const PlannerSettings& settings_;
  ContactForces forces_;
  Plan& plan_;
  RobotData data_;
  double begin_ = 0.0;  // s, of the stretch being written
};

/// Weight goes over linearly: every mix of two force distributions that balance one posture
/// balances it too, and stays within cones and torque limits.
ForceSolution PlanWriter::forces_at(const Stretch& stretch, double share) {
  ForceSolution from = forces_.solve(data_, stretch.contacts);
  if (stretch.kind == Stretch::Kind::kMotion) {
    return from;
  }
  const ContactSet& larger = stretch.next_contacts.size() >= stretch.contacts.size()
                                 ? stretch.next_contacts
                                 : stretch.contacts;
  const ForceSolution to = forces_.solve(data_, stretch.next_contacts);
  ForceSolution mixed = from;
  mixed.status = std::max(from.status, to.status);
  mixed.tau = (1.0 - share) * from.tau + share * to.tau;
  mixed.forces.assign(larger.size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < larger.size(); ++i) {
    const auto add_share = [&](const ContactSet& contacts, const ForceSolution& solution,
                               double weight) {
      for (std::size_t c = 0; c < contacts.size(); ++c) {
        if (contacts[c].link == larger[i].link) {
          mixed.forces[i] += weight * solution.forces[c];
        }
      }
    };
    add_share(stretch.contacts, from, 1.0 - share);
    add_share(stretch.next_contacts, to, share);
  }
  mixed.torque_margin = std::numeric_limits<double>::infinity();
  for (int j = 0; j < model_.joint_count(); ++j) {
    mixed.torque_margin =
        std::min(mixed.torque_margin,
                 model_.joints[static_cast<std::size_t>(j)].torque_limit - std::abs(mixed.tau[j]));
  }
  return mixed;
}

void PlanWriter::add_keyframe(const Stretch& stretch, const TimedPosture& posture) {
  forward_kinematics(model_, posture.x, data_);
  const ForceSolution forces = forces_at(stretch, posture.share);
  Keyframe keyframe;
  keyframe.time = begin_ + posture.time;
  keyframe.phase = static_cast<int>(plan_.phases.size()) - 1;
  if (forces.status != Equilibrium::kFeasible) {
    char text[160];
    std::snprintf(text, sizeof text, "%s at %.2f s: %s", stretch.name.c_str(), keyframe.time,
                  forces.status == Equilibrium::kTorque
                      ? "a joint torque exceeds its limit between the postures that were checked"
                      : "the robot does not balance between the postures that were checked");
    throw PlanningFailed(text);
  }
  keyframe.x = posture.x;
  keyframe.tau = forces.tau;
  keyframe.torque_margin = forces.torque_margin;
  const bool grows = stretch.next_contacts.size() >= stretch.contacts.size();
  const bool loads = stretch.kind == Stretch::Kind::kLoad;
  const ContactSet& contacts = loads && grows ? stretch.next_contacts : stretch.contacts;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const Contact& contact = contacts[i];
    keyframe.contacts.push_back(
        {model_.contacts[static_cast<std::size_t>(contact.link)].name,
         contact.surface == kFloor
             ? "floor"
             : scenario_.obstacles[static_cast<std::size_t>(contact.surface)].name,
         touch_point(model_, data_, contact.link), forces.forces[i]});
  }
  keyframe.support_margin =
      SupportRegion(contact_points(model_, data_, carrying(stretch))).margin(data_.com.head<2>());
  const ClearanceReport clear = clearance_.report(data_, contacts, stretch.landing);
  keyframe.obstacle_clearance = clear.obstacle;
  keyframe.self_clearance = clear.self;
  plan_.keyframes.push_back(keyframe);
}

void PlanWriter::add(const Stretch& stretch) {
  begin_ = plan_.keyframes.empty() ? 0.0 : plan_.keyframes.back().time;
  plan_.phases.push_back({stretch.name, begin_});
  for (const TimedPosture& posture : time_stretch(model_, stretch, settings_.timing)) {
    if (posture.time > 0.0 || plan_.keyframes.empty()) {
      add_keyframe(stretch, posture);  // a stretch begins where the one before ended
    }
  }
}

/// Adds the climb's phases and keyframes to the plan; the robot stands for a moment before it
/// moves.
/// @throws PlanningFailed
void write_keyframes(PlanWriter& writer, const Node& start, const std::vector<Stretch>& stretches) {
  writer.add({"stand", Stretch::Kind::kLoad, {start.x}, start.contacts, start.contacts, {}});
  for (const Stretch& stretch : joined(stretches)) {
    writer.add(stretch);
  }
}

}  // namespace

Plan plan_header(const RobotModel& model, const Scenario& scenario, const std::string& recording,
                 bool synthetic_recording) {
  Plan plan;
  plan.robot = model.name;
  plan.robot_hash = model.hash;
  plan.scenario = scenario.name;
  plan.scenario_hash = scenario.hash;
  plan.recording = recording;
  plan.synthetic_recording = synthetic_recording;
  plan.tool_version = CLAMBER_VERSION;
  plan.friction = scenario.friction;
  plan.obstacle_height = scenario.obstacles.front().top();
  plan.ballast_mass = model.ballast_mass;
  plan.joint_names.reserve(model.joints.size());
  for (const Joint& joint : model.joints) {
    plan.joint_names.push_back(joint.name);
  }
  return plan;
}

namespace {

/// One planning job: what every way of finding stretches shares.
class Planning {
 public:
  Planning(const RobotModel& model, const Scenario& scenario, const PlannerSettings& settings,
           const PlanningProgress& progress, const PlanCheck& check, Plan header)
      : model_(model),
        scenario_(scenario),
        settings_(with_friction(settings, scenario)),
        progress_(progress),
        check_(check),
        header_(std::move(header)),
        clearance_(model, scenario, settings_.clearance) {}

  void check_start();
  void find_along(const std::vector<Move>& moves);
  [[nodiscard]] PlanningResult finish();

 private:
  static PlannerSettings with_friction(PlannerSettings settings, const Scenario& scenario) {
    settings.forces.friction = settings.friction_share * scenario.friction;
    return settings;
  }
  [[nodiscard]] std::string written(const std::vector<Stretch>& stretches);
  [[nodiscard]] Configuration start() const { return start_configuration(model_, scenario_); }
  [[nodiscard]] PlannerSettings seeded(std::size_t seed) const;
  void complete(const std::vector<Stretch>& climb);
  [[noreturn]] void fail(const std::string& why) const;

  const RobotModel& model_;
  const Scenario& scenario_;
  PlannerSettings settings_;
  const PlanningProgress& progress_;
  const PlanCheck& check_;
  Plan header_;
  Clearance clearance_;
  PlanningResult result_;
  double writing_ = 0.0, checking_ = 0.0;  // s
};

/// What the plan does not hold for although it is stated; empty: nothing.
std::string less_than_stated(const Plan& plan) {
  if (plan.certified_for.empty()) return "not certified for anything (search.as_stated)";
  std::string out;
  for (const CertifiedFor& row : plan.certified_for) {
    if (row.holds >= row.stated) continue;
    char text[120];
    std::snprintf(text, sizeof text, "%s%s %.3g of %.3g %s",
                  out.empty() ? "holds for less than is stated: " : ", ", row.what.c_str(),
                  row.holds, row.stated, row.unit.c_str());
    out += text;
  }
  return out;
}

/// Writes the plan of the stretches (none: of standing at the start) and has it checked; why it
/// does not do, empty: it does.
std::string Planning::written(const std::vector<Stretch>& stretches) {
  const Stopwatch write_time;
  Plan plan = header_;
  const Clearance clearance(model_, scenario_, where_it_is(settings_.clearance));
  PlanWriter writer(model_, scenario_, clearance, settings_, plan);
  try {
    write_keyframes(writer,
                    stretches.empty()
                        ? standing_at(model_, scenario_, start())
                        : Node{stretches.front().path.front(), stretches.front().contacts},
                    stretches);
  } catch (const PlanningFailed& error) {
    return error.what();
  }
  writing_ += write_time.seconds();
  const Stopwatch check_time;
  std::string why = check_ ? check_(plan) : "";
  if (why.empty() && settings_.search.as_stated) why = less_than_stated(plan);
  checking_ += check_time.seconds();
  if (why.empty()) {
    result_.plan = std::move(plan);
  }
  return why;
}

void Planning::fail(const std::string& why) const {
  throw PlanningFailed(why, std::make_shared<const PlanningLog>(result_));
}

PlannerSettings Planning::seeded(std::size_t seed) const {
  PlannerSettings settings = settings_;
  settings.search.seed += seed;
  return settings;
}

/// No choice of contacts or postures changes the start: what it violates every climb would, and
/// each would be found before it is refused.
void Planning::check_start() {
  if (const std::string why = written({}); !why.empty()) {
    result_.rejected.push_back(why);
    fail("the start of " + scenario_.name +
         ", on its soles, does not do, whatever follows: " + why);
  }
}

/// The climb along recorded contacts, then the rest of the goal.
void Planning::find_along(const std::vector<Move>& moves) {
  const Stopwatch time;
  const ClimbSearch search = search_climb(
      model_, scenario_, clearance_, settings_, start(), moves,
      [this](const SearchResult& found) { return written(found.stretches); },
      [this](int move, int of, const std::string& what) {
        progress_(static_cast<double>(move) / std::max(of, 1), what);
      });
  const double searched = time.seconds() - writing_ - checking_;
  result_.stages = {{"reference optimisation", search.reference_share * searched},
                    {"search", (1.0 - search.reference_share) * searched}};
  result_.costs = search.costs;
  result_.rejected = search.rejected;
  result_.candidates = search.candidates;
  result_.backtracks = search.backtracks;
  if (!search.best.success) {
    fail("no statically stable, torque-feasible climb of " + scenario_.name + " found in " +
         std::to_string(search.attempts) + " sets of contact places; " + search.given_up +
         "; the furthest attempt ended with: " + search.best.failure);
  }
  if (scenario_.goal != Goal::kAllFours) {
    complete(search.best.stretches);
  }
}

/// What the goal asks for after the climb. Another seed makes other postures and ways.
void Planning::complete(const std::vector<Stretch>& climb) {
  const Stopwatch time;
  const double before = writing_ + checking_;
  const auto note_time = [&] {
    result_.stages.emplace_back(kAfterAllFours, time.seconds() - (writing_ + checking_ - before));
  };
  std::string why;
  for (std::size_t seed = 0; seed < settings_.search.most_seeds; ++seed) {
    try {
      const PlannerSettings settings = seeded(seed);
      GoalSearch goal(model_, scenario_, clearance_, settings,
                      [this](double share, const std::string& what) { progress_(share, what); });
      why = written(goal.complete(climb));
    } catch (const PlanningFailed& failed) {
      why = failed.what();
    }
    if (why.empty()) {
      note_time();
      return;
    }
    result_.rejected.push_back(why);
  }
  note_time();
  fail(std::string("all fours is reached, ") + to_string(scenario_.goal) + " is not: " + why);
}

PlanningResult Planning::finish() {
  const Stopwatch time;
  state_failure_policies(model_, scenario_, result_.plan);
  result_.stages.emplace_back("timing and torques", writing_);
  result_.stages.emplace_back("checks of plans found", checking_);
  result_.stages.emplace_back("failure policies", time.seconds());
  progress_(1.0, "done");
  return std::move(result_);
}

}  // namespace

namespace {

/// One way to plan: its settings, and what the plan says when it gave no climb.
struct Try {
  PlannerSettings settings;
  std::string failed;
};

std::string no_climb_with(const char* what, double metres) {
  char text[160];
  std::snprintf(text, sizeof text, "No climb with %.3g mm of %s.", 1e3 * metres, what);
  return text;
}

/// From the room that the uncertainty asks for to what a certificate just allows. With less room
/// no climb holds for what is stated.
std::vector<Try> tries(PlannerSettings settings) {
  std::vector<Try> out;
  const auto add_wide = [&](std::string failed) -> PlannerSettings& {
    out.push_back({settings, std::move(failed)});
    out.back().settings.search.most_attempts =
        std::min(settings.search.wide_attempts, settings.search.most_attempts);
    return out.back().settings;
  };
  if (settings.clearance.elsewhere.any() && !settings.search.as_stated) {
    add_wide("No climb with room for an obstacle that is elsewhere.");
    settings.clearance.elsewhere = {};
  }
  if (!settings.clearance.elsewhere.any())
    for (const double wide : settings.search.wide_clearances)
      if (wide > settings.clearance.obstacle)
        add_wide(no_climb_with("clearance", wide)).clearance.obstacle = wide;
  out.push_back({settings, no_climb_with("support margin", settings.search.support_margin)});
  if (settings.search.tight_margin < settings.search.support_margin) {
    out.push_back({settings, ""});
    out.back().settings.search.support_margin = settings.search.tight_margin;
  }
  return out;
}

/// What earlier tries found out and cost goes before the log of a later one.
void prepend(const PlanningLog& earlier, PlanningLog& log) {
  log.rejected.insert(log.rejected.begin(), earlier.rejected.begin(), earlier.rejected.end());
  log.candidates += earlier.candidates;
  log.backtracks += earlier.backtracks;
}

/// What all sequences of one climb are planned with.
struct Climb {
  const RobotModel& model;
  const Scenario& scenario;
  const PlanningProgress& progress;
  const PlanCheck& check;
};

/// Along one sequence of moves, with less and less room.
/// @param most  candidates that all tries together may use; each gets an even share of what is left
/// @throws PlanningFailed with the log of all tries
PlanningResult plan_along(const Climb& climb, const std::vector<Move>& moves,
                          const PlannerSettings& settings, std::size_t most, Plan header) {
  std::vector<Try> all = tries(settings);
  PlanningLog earlier;  // of the tries before
  for (std::size_t i = 0;; ++i) {
    all[i].settings.search.most_candidates_in_all = (most - earlier.candidates) / (all.size() - i);
    Planning planning(climb.model, climb.scenario, all[i].settings, climb.progress, climb.check,
                      header);
    try {
      planning.find_along(moves);
      PlanningResult result = planning.finish();
      prepend(earlier, result);
      return result;
    } catch (const PlanningFailed& failed) {
      PlanningLog log = failed.log() != nullptr ? *failed.log() : PlanningLog();
      prepend(earlier, log);
      if (i + 1 == all.size() || log.candidates >= most)
        throw PlanningFailed(failed.what(), std::make_shared<const PlanningLog>(log));
      earlier = std::move(log);
      header.notes.push_back(all[i].failed);
    }
  }
}

bool came_to_all_fours(const PlanningLog& log) {
  return std::any_of(log.stages.begin(), log.stages.end(),
                     [](const auto& stage) { return stage.first == kAfterAllFours; });
}

/// What lands together, move by move; supports on the way are the planner's own.
std::vector<std::vector<int>> order_of(const std::vector<Move>& moves) {
  std::vector<std::vector<int>> order;
  for (const Move& move : moves)
    if (!move.optional) {
      order.push_back(move.lands);
      std::sort(order.back().begin(), order.back().end());
    }
  return order;
}

/// The moves in the same order with places and hints from postures that rest on all goal contacts.
std::vector<std::vector<Move>> moved_elsewhere(const Climb& climb, const std::vector<Move>& moves,
                                               const PlannerSettings& settings) {
  std::vector<std::vector<Move>> out;
  try {
    for (const ContactSequence& sequence :
         invented_sequences(climb.model, climb.scenario, settings)) {
      std::vector<std::string> notes;
      std::vector<Move> invented = plan_moves(climb.model, climb.scenario, sequence, notes);
      if (order_of(invented) == order_of(moves)) out.push_back(std::move(invented));
    }
  } catch (const PlanningFailed&) {
    // No such posture: why the recording's places fail says more.
  }
  return out;
}

/// A demonstrator's places may suit a body with other arms only. @throws what `recorded` says
PlanningResult plan_elsewhere(const Climb& climb, const std::vector<Move>& moves,
                              PlannerSettings settings, const PlanningFailed& recorded,
                              Plan header) {
  settings.forces.friction = settings.friction_share * climb.scenario.friction;
  const std::size_t most = settings.search.most_candidates_in_all;
  settings.search.most_attempts = settings.search.order_attempts;
  header.notes.push_back(
      "No climb with the recording's contact places: its order, places from a posture on all goal "
      "contacts.");
  PlanningLog log = *recorded.log();
  const std::vector<std::vector<Move>> sequences = moved_elsewhere(climb, moves, settings);
  for (std::size_t i = 0; i < sequences.size() && log.candidates < most; ++i) {
    try {
      PlanningResult result = plan_along(climb, sequences[i], settings,
                                         (most - log.candidates) / (sequences.size() - i), header);
      prepend(log, result);
      return result;
    } catch (const PlanningFailed& failed) {
      PlanningLog now = *failed.log();
      prepend(log, now);
      log = std::move(now);
    }
  }
  throw PlanningFailed(recorded.what(), std::make_shared<const PlanningLog>(log));
}

}  // namespace

PlanningResult plan_climb(const RobotModel& model, const Scenario& scenario,
                          const ContactSequence& sequence, const PlannerSettings& settings,
                          const PlanningProgress& progress, const PlanCheck& check) {
  Plan header = plan_header(model, scenario, sequence.recording, sequence.synthetic);
  header.notes = sequence.notes;
  const std::vector<Move> moves = plan_moves(model, scenario, sequence, header.notes);
  Planning(model, scenario, settings, progress, check, header).check_start();
  const Climb climb{model, scenario, progress, check};
  constexpr double kRecorded = 0.75;  // of the candidates: the rest is for other places
  try {
    return plan_along(climb, moves, settings,
                      static_cast<std::size_t>(
                          kRecorded * static_cast<double>(settings.search.most_candidates_in_all)),
                      header);
  } catch (const PlanningFailed& recorded) {
    if (came_to_all_fours(*recorded.log())) throw;
    return plan_elsewhere(climb, moves, settings, recorded, header);
  }
}

PlanningResult plan_without_recording(const RobotModel& model, const Scenario& scenario,
                                      const PlannerSettings& settings,
                                      const PlanningProgress& progress, const PlanCheck& check) {
  PlannerSettings used = settings;
  used.forces.friction = settings.friction_share * scenario.friction;
  used.search.most_attempts = settings.search.order_attempts;
  const Climb climb{model, scenario, progress, check};
  Planning(model, scenario, used, progress, check, plan_header(model, scenario, "none", false))
      .check_start();
  std::string why;
  PlanningLog log;
  for (const ContactSequence& sequence : invented_sequences(model, scenario, used)) {
    Plan header = plan_header(model, scenario, sequence.recording, sequence.synthetic);
    header.notes = sequence.notes;
    const std::vector<Move> moves = plan_moves(model, scenario, sequence, header.notes);
    try {
      return plan_along(climb, moves, used, used.search.most_candidates_in_all, header);
    } catch (const PlanningFailed& failed) {
      why = failed.what();
      PlanningLog now = *failed.log();
      prepend(log, now);
      log = std::move(now);
    }
  }
  throw PlanningFailed("without a recording: " + why, std::make_shared<const PlanningLog>(log));
}

std::vector<std::string> contact_order(const Plan& plan) {
  std::vector<std::string> order;
  const std::string load = "load ";
  for (const Phase& phase : plan.phases) {
    if (phase.name.rfind(load, 0) == 0) {
      order.push_back(phase.name.substr(load.size()));
    }
  }
  return order;
}

}  // namespace clamber
