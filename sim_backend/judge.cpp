#include "sim_backend/judge.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>

#include "robot_model/loader.hpp"

namespace clamber {

/// Means over the window, per geom.
struct ClimbJudge::Loads {
  explicit Loads(std::size_t geoms) : top(geoms), side(geoms), floor(geoms) {}
  std::vector<double> top;      ///< N, normal force on the top face
  std::vector<double> side;     ///< N, normal force on anything else of the obstacles
  std::vector<double> floor;    ///< N
  double top_vertical = 0.0;    ///< N, vertical force through the top face
  double floor_vertical = 0.0;  ///< N
  /// Floor contacts along the way over the obstacle, from its middle, m.
  double first_floor = std::numeric_limits<double>::infinity();
  double last_floor = -std::numeric_limits<double>::infinity();
};

namespace {

/// Links that carry at least `min_load` (N) and are no sole.
std::vector<std::string> links_beside_soles(const RobotModel& model,
                                            const std::vector<double>& loads, double min_load) {
  std::set<int> soles;
  for (const ContactLink& contact : model.contacts) {
    if (contact.is_patch) {
      soles.insert(contact.geom);
    }
  }
  std::set<std::string> links;
  for (std::size_t g = 0; g < loads.size(); ++g) {
    if (loads[g] >= min_load && soles.count(static_cast<int>(g)) == 0) {
      links.insert(model.geoms[g].link);
    }
  }
  return {links.begin(), links.end()};
}

}  // namespace

ClimbJudge::ClimbJudge(const RobotModel& model, const Scenario& scenario, const JudgeLimits& limits)
    : model_(model), scenario_(scenario), limits_(limits), forbidden_(model.geoms.size(), false) {
  for (const int geom : model_.forbidden_geoms) {
    forbidden_[static_cast<std::size_t>(geom)] = true;
  }
  for (const std::string& name : scenario_.goal_contacts) {
    if (!model_.find_contact(name)) {
      throw InputError(scenario_.name + ": goal.contacts: robot " + model_.name +
                       " has no contact link '" + name + "'");
    }
  }
  if (scenario_.goal == Goal::kAllFours) {
    goal_contacts_ = all_fours_contacts(model_, scenario_);
  } else {
    for (const ContactLink& contact : model_.contacts) {
      if (contact.is_patch) {
        goal_contacts_.push_back(contact.name);
      }
    }
  }
}

void ClimbJudge::push(double time, std::span<const ContactObservation> contacts,
                      const VelocityVector& velocity) {
  Sample sample;
  sample.time = time;
  sample.speed = std::max({velocity.head<3>().norm(), velocity.segment<3>(3).norm(),
                           velocity.tail(velocity.size() - 6).lpNorm<Eigen::Infinity>()});
  std::copy_if(contacts.begin(), contacts.end(), std::back_inserter(sample.contacts),
               [](const ContactObservation& c) { return c.surface != Surface::kRobot; });
  was_on_top_ = was_on_top_ || carried_by_top(sample);
  samples_.push_back(std::move(sample));
  // The oldest sample kept is the last one at or before the window's start.
  while (samples_.size() > 1 && samples_[1].time <= time - limits_.window) {
    samples_.pop_front();
  }
}

bool ClimbJudge::on_top(const ContactObservation& contact) const {
  return contact.surface == Surface::kObstacle && contact.other == 0 &&
         contact.normal.z() >= limits_.top_cosine &&
         std::abs(contact.position.z() - scenario_.obstacles[0].top()) <= limits_.top_tolerance;
}

bool ClimbJudge::carried_by_top(const Sample& sample) const {
  double carried = 0.0;
  for (const ContactObservation& contact : sample.contacts) {
    if (contact.surface == Surface::kFloor) {
      return false;
    }
    carried += on_top(contact) ? contact.force.z() : 0.0;
  }
  return carried >= limits_.weight_share * model_.total_mass * kGravity;
}

ClimbJudge::Loads ClimbJudge::mean_loads() const {
  Loads loads(model_.geoms.size());
  const double share = 1.0 / static_cast<double>(std::max<std::size_t>(samples_.size(), 1));
  for (const Sample& sample : samples_) {
    for (const ContactObservation& contact : sample.contacts) {
      const auto geom = static_cast<std::size_t>(contact.geom);
      const double force = std::abs(contact.normal_force()) * share;
      if (contact.surface == Surface::kFloor) {
        loads.floor[geom] += force;
        loads.floor_vertical += contact.force.z() * share;
        const ObstacleBox& box = scenario_.obstacles[0];
        const Eigen::AngleAxisd turn(-box.yaw, Eigen::Vector3d::UnitZ());
        const double along = (turn * (contact.position - box.center)).x();
        loads.first_floor = std::min(loads.first_floor, along);
        loads.last_floor = std::max(loads.last_floor, along);
      } else if (on_top(contact)) {
        loads.top[geom] += force;
        loads.top_vertical += contact.force.z() * share;
      } else {
        loads.side[geom] += force;
      }
    }
  }
  return loads;
}

/// Which goal contacts are loaded on the top, and what else.
void ClimbJudge::judge_on_top(const Loads& loads, ClimbVerdict& verdict) const {
  for (const std::string& goal : goal_contacts_) {
    if (std::find(verdict.final_contacts.begin(), verdict.final_contacts.end(), goal) ==
        verdict.final_contacts.end()) {
      verdict.missing_contacts.push_back(goal);
    }
  }
  if (scenario_.goal == Goal::kStandOnTop) {
    verdict.unwanted_contacts = links_beside_soles(model_, loads.top, limits_.min_load);
  }
  verdict.success = verdict.missing_contacts.empty() && verdict.unwanted_contacts.empty() &&
                    verdict.floor_contacts.empty() &&
                    verdict.weight_on_obstacle >= limits_.weight_share;
}

/// Whether the soles, and they alone, are loaded on the floor where the goal says.
void ClimbJudge::judge_on_floor(const Loads& loads, ClimbVerdict& verdict) const {
  for (const std::string& goal : goal_contacts_) {
    const ContactLink& link = model_.contacts[static_cast<std::size_t>(*model_.find_contact(goal))];
    if (loads.floor[static_cast<std::size_t>(link.geom)] < limits_.min_load) {
      verdict.missing_contacts.push_back(goal);
    }
  }
  verdict.unwanted_contacts = links_beside_soles(model_, loads.floor, limits_.min_load);
  const double face = scenario_.obstacles[0].half_extents.x();
  verdict.on_the_right_side =
      scenario_.goal == Goal::kOver ? loads.first_floor > face : loads.last_floor < -face;
  verdict.success = verdict.missing_contacts.empty() && verdict.unwanted_contacts.empty() &&
                    verdict.was_on_top && verdict.on_the_right_side &&
                    verdict.final_contacts.empty() && verdict.weight_on_obstacle == 0.0 &&
                    verdict.weight_on_floor >= limits_.weight_share;
}

ClimbVerdict ClimbJudge::verdict() const {
  ClimbVerdict verdict;
  if (samples_.empty()) {
    verdict.missing_contacts = goal_contacts_;
    return verdict;
  }
  const Loads loads = mean_loads();
  verdict.observed = samples_.back().time - samples_.front().time;
  for (const Sample& sample : samples_) {
    verdict.rest_speed = std::max(verdict.rest_speed, sample.speed);
  }
  verdict.weight_on_obstacle = loads.top_vertical / (model_.total_mass * kGravity);
  verdict.weight_on_floor = loads.floor_vertical / (model_.total_mass * kGravity);
  verdict.was_on_top = was_on_top_;

  std::set<std::string> floor;
  std::set<std::string> forbidden;
  std::set<std::string> side;
  for (std::size_t g = 0; g < model_.geoms.size(); ++g) {
    const std::string& link = model_.geoms[g].link;
    if (loads.floor[g] > 0.0) {
      floor.insert(link);
    }
    if (loads.side[g] >= limits_.min_load) {
      side.insert(link);
    }
    if (forbidden_[g] && loads.floor[g] + loads.side[g] + loads.top[g] > 0.0) {
      forbidden.insert(link);
    }
  }
  verdict.floor_contacts.assign(floor.begin(), floor.end());
  verdict.forbidden_contacts.assign(forbidden.begin(), forbidden.end());
  verdict.side_contacts.assign(side.begin(), side.end());
  for (const ContactLink& contact : model_.contacts) {
    if (loads.top[static_cast<std::size_t>(contact.geom)] >= limits_.min_load) {
      verdict.final_contacts.push_back(contact.name);
    }
  }
  if (scenario_.goal == Goal::kOver || scenario_.goal == Goal::kBackDown) {
    judge_on_floor(loads, verdict);
  } else {
    judge_on_top(loads, verdict);
  }
  // Half a step of slack: sample times are sums of rounded steps.
  const bool long_enough = verdict.observed >= limits_.window - 1e-6;
  verdict.success = verdict.success && long_enough && verdict.forbidden_contacts.empty() &&
                    verdict.side_contacts.empty() && verdict.rest_speed <= limits_.rest_speed;
  return verdict;
}

std::string describe(const ClimbVerdict& verdict) {
  std::ostringstream out;
  out.precision(3);
  const auto list = [&](const char* what, const std::vector<std::string>& names) {
    if (names.empty()) return;
    out << (out.tellp() > 0 ? "; " : "") << what;
    for (const std::string& name : names) out << ' ' << name;
  };
  list("do not carry where they should:", verdict.missing_contacts);
  list("carry and should not:", verdict.unwanted_contacts);
  if (!verdict.on_the_right_side) list("on the wrong side of", {"the obstacle"});
  list("on the floor:", verdict.floor_contacts);
  list("must not carry:", verdict.forbidden_contacts);
  list("loaded on a side:", verdict.side_contacts);
  out << (out.tellp() > 0 ? "; " : "") << "weight on the obstacle "
      << 100.0 * verdict.weight_on_obstacle << " %; speed at rest " << verdict.rest_speed << " m/s";
  return out.str();
}

}  // namespace clamber
