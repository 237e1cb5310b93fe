#include "sim_backend/judge.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "robot_model/loader.hpp"

namespace clamber {

/// Means over the window, per geom.
struct ClimbJudge::Loads {
  explicit Loads(std::size_t geoms) : top(geoms), side(geoms), floor(geoms) {}
  std::vector<double> top;    ///< N, normal force on the top face
  std::vector<double> side;   ///< N, normal force on anything else of the obstacles
  std::vector<double> floor;  ///< N
  double top_vertical = 0.0;  ///< N, vertical force through the top face
};

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
}

void ClimbJudge::push(double time, std::span<const ContactObservation> contacts,
                      const VelocityVector& velocity) {
  Sample sample;
  sample.time = time;
  sample.speed = std::max({velocity.head<3>().norm(), velocity.segment<3>(3).norm(),
                           velocity.tail(velocity.size() - 6).lpNorm<Eigen::Infinity>()});
  std::copy_if(contacts.begin(), contacts.end(), std::back_inserter(sample.contacts),
               [](const ContactObservation& c) { return c.surface != Surface::kRobot; });
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

ClimbJudge::Loads ClimbJudge::mean_loads() const {
  Loads loads(model_.geoms.size());
  const double share = 1.0 / static_cast<double>(std::max<std::size_t>(samples_.size(), 1));
  for (const Sample& sample : samples_) {
    for (const ContactObservation& contact : sample.contacts) {
      const auto geom = static_cast<std::size_t>(contact.geom);
      const double force = std::abs(contact.normal_force()) * share;
      if (contact.surface == Surface::kFloor) {
        loads.floor[geom] += force;
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

ClimbVerdict ClimbJudge::verdict() const {
  ClimbVerdict verdict;
  if (samples_.empty()) {
    verdict.missing_contacts = scenario_.goal_contacts;
    return verdict;
  }
  const Loads loads = mean_loads();
  verdict.observed = samples_.back().time - samples_.front().time;
  for (const Sample& sample : samples_) {
    verdict.rest_speed = std::max(verdict.rest_speed, sample.speed);
  }
  verdict.weight_on_obstacle = loads.top_vertical / (model_.total_mass * kGravity);

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
  for (const std::string& goal : scenario_.goal_contacts) {
    if (std::find(verdict.final_contacts.begin(), verdict.final_contacts.end(), goal) ==
        verdict.final_contacts.end()) {
      verdict.missing_contacts.push_back(goal);
    }
  }
  // Half a step of slack: sample times are sums of rounded steps.
  const bool long_enough = verdict.observed >= limits_.window - 1e-6;
  verdict.success = long_enough && verdict.missing_contacts.empty() &&
                    verdict.floor_contacts.empty() && verdict.forbidden_contacts.empty() &&
                    verdict.side_contacts.empty() &&
                    verdict.weight_on_obstacle >= limits_.weight_share &&
                    verdict.rest_speed <= limits_.rest_speed;
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
  list("not on the obstacle:", verdict.missing_contacts);
  list("on the floor:", verdict.floor_contacts);
  list("must not carry:", verdict.forbidden_contacts);
  list("loaded on a side:", verdict.side_contacts);
  out << (out.tellp() > 0 ? "; " : "") << "weight on the obstacle "
      << 100.0 * verdict.weight_on_obstacle << " %; speed at rest " << verdict.rest_speed << " m/s";
  return out.str();
}

}  // namespace clamber
