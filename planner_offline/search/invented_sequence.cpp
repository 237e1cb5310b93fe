#include "planner_offline/search/invented_sequence.hpp"

#include "planner_offline/planning_failed.hpp"
#include "planner_offline/search/graph_search.hpp"
#include "planner_offline/search/move.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr int kTop = 0;  // the first obstacle

std::vector<Touch> goal_touches(const RobotModel& model, const Scenario& scenario) {
  std::vector<Touch> goal;
  for (const std::string& name : all_fours_contacts(model, scenario)) {
    const auto link = model.find_contact(name);
    if (!link) {
      throw InputError(scenario.name + ": goal.contacts: robot " + model.name +
                       " has no contact link '" + name + "'");
    }
    goal.push_back({*link, kTop, {}, 0.0});
  }
  return goal;
}

/// Above the front edge, leaning forward: from here the search for a resting posture starts.
Configuration over_the_edge(const RobotModel& model, const Scenario& scenario) {
  constexpr double kLean = 1.1;  // rad
  Configuration x = start_configuration(model, scenario);
  const ObstacleBox& box = scenario.obstacles[kTop];
  const Eigen::Vector3d edge = from_edge_frame(box, {0.15, 0.0, 0.0});
  x.X_WB.R = x.X_WB.R * Eigen::AngleAxisd(kLean, Eigen::Vector3d::UnitY());
  x.X_WB.p = {edge.x(), edge.y(), box.top() + 0.5 * x.X_WB.p.z()};
  return x;
}

std::vector<TouchPosture> resting_postures(const RobotModel& model, const Scenario& scenario,
                                           const PlannerSettings& settings,
                                           const std::vector<Touch>& goal) {
  const Clearance clearance(model, scenario, settings.clearance);
  TouchSampler sampler(model, scenario, clearance, settings);
  TouchRequest request;
  request.start = over_the_edge(model, scenario);
  request.touches = goal;
  request.attractor = request.near = model.home;
  request.support_margin = settings.search.wanted_margin;
  std::vector<TouchPosture> postures = sampler.sample(request);
  if (postures.empty()) {
    throw PlanningFailed("no posture found that rests on all goal contacts: " +
                         sampler.failure().why);
  }
  return postures;
}

using Order = std::vector<ContactChange>;

/// Every way through the contact graph from `now` to the goal.
void find_orders(const RobotModel& model, const ContactSet& now, const std::vector<Touch>& goal,
                 Order& so_far, std::vector<Order>& orders) {
  const std::vector<ContactChange> changes = changes_towards(model, now, goal);
  if (changes.empty()) {
    orders.push_back(so_far);
  }
  for (const ContactChange& change : changes) {
    ContactSet next = without(now, change.lifts);
    for (const Touch& touch : change.touches) {
      Contact contact;
      contact.link = touch.link;
      contact.surface = touch.surface;
      next.push_back(contact);
    }
    so_far.push_back(change);
    find_orders(model, next, goal, so_far, orders);
    so_far.pop_back();
  }
}

/// The joints between base and `link` as `from` has them: a hint for bringing that link down.
void take_chain(const RobotModel& model, int link, const JointVector& from, JointVector& q) {
  for (int body = model.contacts[static_cast<std::size_t>(link)].body; body > 0;
       body = model.bodies[static_cast<std::size_t>(body)].parent) {
    q[body - 1] = from[body - 1];
  }
}

ContactSequence sequence_of(const RobotModel& model, const Scenario& scenario, const Order& order,
                            const TouchPosture& posture) {
  constexpr double kSeconds = 2.0;  // longer than what counts as one touch
  ContactSequence sequence;
  sequence.recording = "none";
  sequence.robot = model.name;
  sequence.playback_obstacle_height = scenario.obstacles[kTop].top();
  sequence.notes = {"no recording: places from a posture on all goal contacts, order searched for"};
  ContactState state;
  state.posture.q = model.home;
  for (const ContactChange& change : order) {
    state.start = state.end;
    state.end += kSeconds;
    for (const Touch& landing : change.touches) {
      for (const Touch& touch : posture.touches) {
        if (touch.link == landing.link) {
          state.obstacle.push_back({model.contacts[static_cast<std::size_t>(touch.link)].name,
                                    scenario.obstacles[kTop].name,
                                    to_edge_frame(scenario.obstacles[kTop], *touch.position), 0.0});
          take_chain(model, touch.link, posture.x.q, state.posture.q);
        }
      }
    }
    sequence.states.push_back(state);
    sequence.reduced.push_back(state);
  }
  return sequence;
}

}  // namespace

std::vector<ContactSequence> invented_sequences(const RobotModel& model, const Scenario& scenario,
                                                const PlannerSettings& settings) {
  const std::vector<Touch> goal = goal_touches(model, scenario);
  ContactSet standing;
  for (int link = 0; link < static_cast<int>(model.contacts.size()); ++link) {
    if (model.contacts[static_cast<std::size_t>(link)].is_patch) {
      Contact contact;
      contact.link = link;
      standing.push_back(contact);
    }
  }
  std::vector<Order> orders;
  Order so_far;
  find_orders(model, standing, goal, so_far, orders);
  const std::vector<TouchPosture> postures = resting_postures(model, scenario, settings, goal);
  std::vector<ContactSequence> sequences;
  for (const Order& order : orders) {
    for (const TouchPosture& posture : postures) {
      sequences.push_back(sequence_of(model, scenario, order, posture));
    }
  }
  return sequences;
}

}  // namespace clamber
