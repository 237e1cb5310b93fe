#include "planner_offline/planner.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "planner_offline/search/goal_search.hpp"
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

PlanningResult plan_climb(const RobotModel& model, const Scenario& scenario,
                          const ContactSequence& sequence, const PlannerSettings& settings,
                          const PlanningProgress& progress, const PlanCheck& check) {
  PlannerSettings used = settings;
  used.forces.friction = settings.friction_share * scenario.friction;
  Plan empty = plan_header(model, scenario, sequence.recording, sequence.synthetic);
  empty.notes = sequence.notes;
  const std::vector<Move> moves = plan_moves(model, scenario, sequence, empty.notes);
  const Clearance clearance(model, scenario, used.clearance);

  PlanningResult result;
  double writing = 0.0, checking = 0.0;  // s
  const auto written = [&](const std::vector<Stretch>& stretches) -> std::string {
    const Stopwatch write_time;
    Plan plan = empty;
    PlanWriter writer(model, scenario, clearance, used, plan);
    try {
      write_keyframes(writer, stretches);
    } catch (const PlanningFailed& error) {
      return error.what();
    }
    writing += write_time.seconds();
    const Stopwatch check_time;
    const std::string why = check ? check(plan) : "";
    checking += check_time.seconds();
    if (why.empty()) {
      result.plan = std::move(plan);
    }
    return why;
  };
  const auto go_on = [&](const std::vector<Stretch>& climb) {
    const Stopwatch goal_time;
    GoalSearch goal(model, scenario, clearance, used,
                    [&progress](const std::string& what) { progress(1.0, what); });
    const std::vector<Stretch> stretches = goal.complete(climb);
    result.stages.push_back({"after all fours", goal_time.seconds()});
    const std::string why = written(stretches);
    if (!why.empty()) {
      throw PlanningFailed("after all fours: " + why);
    }
  };
  const Stopwatch search_time;
  const ClimbSearch search =
      search_climb(model, scenario, clearance, used, start_configuration(model, scenario), moves,
                   [&written](const SearchResult& found) { return written(found.stretches); },
                   [&progress](int move, int of, const std::string& what) {
                     progress(static_cast<double>(move) / std::max(of, 1), what);
                   });
  const double searched = search_time.seconds() - writing - checking;
  result.stages = {{"reference optimisation", search.reference_share * searched},
                   {"search", (1.0 - search.reference_share) * searched},
                   {"timing and torques", writing},
                   {"checks of plans found", checking}};
  result.costs = search.costs;
  result.rejected = search.rejected;
  result.candidates = search.candidates;
  result.backtracks = search.backtracks;
  if (!search.best.success) {
    throw PlanningFailed("no statically stable, torque-feasible climb of " + scenario.name +
                             " found; the furthest attempt ended with: " + search.best.failure,
                         std::make_shared<const PlanningLog>(result));
  }
  if (scenario.goal != Goal::kAllFours) {
    go_on(search.best.stretches);
  }
  progress(1.0, "done");
  return result;
}

}  // namespace clamber
