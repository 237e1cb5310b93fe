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

/// The robot stands for a moment before it moves.
Stretch standing(const std::vector<Stretch>& stretches) {
  const Stretch& first = stretches.front();
  return {"stand", Stretch::Kind::kLoad, {first.path.front()}, first.contacts, first.contacts, {}};
}

/// Adds the climb's phases and keyframes to the plan. @throws PlanningFailed
void write_keyframes(PlanWriter& writer, const std::vector<Stretch>& stretches) {
  writer.add(standing(stretches));
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

  void find_along(const std::vector<Move>& moves);
  [[nodiscard]] PlanningResult finish();

 private:
  static PlannerSettings with_friction(PlannerSettings settings, const Scenario& scenario) {
    settings.forces.friction = settings.friction_share * scenario.friction;
    return settings;
  }
  [[nodiscard]] std::string written(const std::vector<Stretch>& stretches);
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

/// Writes the plan of the stretches and has it checked; why it does not do, empty: it does.
std::string Planning::written(const std::vector<Stretch>& stretches) {
  const Stopwatch write_time;
  Plan plan = header_;
  PlanWriter writer(model_, scenario_, clearance_, settings_, plan);
  try {
    write_keyframes(writer, stretches);
  } catch (const PlanningFailed& error) {
    return error.what();
  }
  writing_ += write_time.seconds();
  const Stopwatch check_time;
  const std::string why = check_ ? check_(plan) : "";
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

/// The climb along recorded contacts, then the rest of the goal.
void Planning::find_along(const std::vector<Move>& moves) {
  const Stopwatch time;
  const ClimbSearch search = search_climb(
      model_, scenario_, clearance_, settings_, start_configuration(model_, scenario_), moves,
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
    fail("no statically stable, torque-feasible climb of " + scenario_.name +
         " found; the furthest attempt ended with: " + search.best.failure);
  }
  if (scenario_.goal != Goal::kAllFours) {
    complete(search.best.stretches);
  }
}

/// What the goal asks for after the climb. Another seed makes other postures and ways.
void Planning::complete(const std::vector<Stretch>& climb) {
  const Stopwatch time;
  const double before = writing_ + checking_;
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
      result_.stages.emplace_back("after all fours",
                                  time.seconds() - (writing_ + checking_ - before));
      return;
    }
    result_.rejected.push_back(why);
  }
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

/// From the room that the uncertainty asks for to what a certificate just allows.
std::vector<Try> tries(PlannerSettings settings) {
  std::vector<Try> out;
  const auto add_wide = [&](std::string failed) -> PlannerSettings& {
    out.push_back({settings, std::move(failed)});
    out.back().settings.search.most_attempts =
        std::min(settings.search.wide_attempts, settings.search.most_attempts);
    return out.back().settings;
  };
  if (settings.clearance.elsewhere.any()) {
    add_wide("No climb with room for an obstacle that is elsewhere.");
    settings.clearance.elsewhere = {};
  }
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

void prepend(const std::vector<std::string>& earlier, std::vector<std::string>& rejected) {
  rejected.insert(rejected.begin(), earlier.begin(), earlier.end());
}

}  // namespace

PlanningResult plan_climb(const RobotModel& model, const Scenario& scenario,
                          const ContactSequence& sequence, const PlannerSettings& settings,
                          const PlanningProgress& progress, const PlanCheck& check) {
  Plan header = plan_header(model, scenario, sequence.recording, sequence.synthetic);
  header.notes = sequence.notes;
  const std::vector<Move> moves = plan_moves(model, scenario, sequence, header.notes);
  const std::vector<Try> all = tries(settings);
  std::vector<std::string> rejected;  // by the tries before
  for (std::size_t i = 0;; ++i) {
    Planning planning(model, scenario, all[i].settings, progress, check, header);
    try {
      planning.find_along(moves);
      PlanningResult result = planning.finish();
      prepend(rejected, result.rejected);
      return result;
    } catch (const PlanningFailed& failed) {
      PlanningLog log = failed.log() != nullptr ? *failed.log() : PlanningLog();
      prepend(rejected, log.rejected);
      if (i + 1 == all.size())
        throw PlanningFailed(failed.what(), std::make_shared<const PlanningLog>(log));
      rejected = std::move(log.rejected);
      header.notes.push_back(all[i].failed);
    }
  }
}

PlanningResult plan_without_recording(const RobotModel& model, const Scenario& scenario,
                                      const PlannerSettings& settings,
                                      const PlanningProgress& progress, const PlanCheck& check) {
  PlannerSettings used = settings;
  used.forces.friction = settings.friction_share * scenario.friction;
  used.search.most_attempts = settings.search.order_attempts;
  std::string why;
  PlanningLog log;
  for (const ContactSequence& sequence : invented_sequences(model, scenario, used)) {
    try {
      return plan_climb(model, scenario, sequence, used, progress, check);
    } catch (const PlanningFailed& failed) {
      why = failed.what();
      if (failed.log() != nullptr) {
        log.rejected.insert(log.rejected.end(), failed.log()->rejected.begin(),
                            failed.log()->rejected.end());
      }
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
