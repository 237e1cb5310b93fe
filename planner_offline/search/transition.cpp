#include "planner_offline/search/transition.hpp"

#include <algorithm>

#include "planner_offline/certify/support_region.hpp"

namespace clamber {
namespace {

constexpr double kOff = 0.035;  // m that a link is lifted straight up, and comes down straight
constexpr double kTolerance = 0.005;  // m, of the centre of mass
constexpr double kKept = 0.75;        // of the support margin, all along a motion
constexpr double kLeastOff = 0.01;    // m that will do

std::vector<int> links_of(const std::vector<Touch>& touches) {
  std::vector<int> links;
  links.reserve(touches.size());
  for (const Touch& touch : touches) {
    links.push_back(touch.link);
  }
  return links;
}

void append(std::vector<Configuration>& path, const std::vector<Configuration>& more) {
  path.insert(path.end(), more.begin() + (path.empty() ? 0 : 1), more.end());
}

}  // namespace

Transition::Transition(const RobotModel& model, const Scenario& scenario,
                       const Clearance& clearance, const PlannerSettings& settings)
    : model_(model),
      scenario_(scenario),
      settings_(settings),
      sampler_(model, scenario, clearance, settings),
      ways_(model, clearance, settings),
      steering_(model, clearance, settings),
      check_(model, settings) {}

double Transition::wanted_margin(const ContactSet& contacts) const {
  if (!only_patches(model_, contacts)) {
    return settings_.search.wanted_margin;
  }
  return contacts.size() == 1 ? settings_.search.step_margin : settings_.search.free_margin;
}

/// Brings the centre of mass over the contacts that stay, then takes the weight off the others.
Rejection Transition::shift(const ContactChange& change, const TouchPosture& posture, double margin,
                            Node& node, std::vector<Stretch>& stretches) {
  const ContactSet stay = without(node.contacts, change.lifts);
  RobotData data;
  forward_kinematics(model_, node.x, data);
  MotionGoal goal;
  goal.contacts = node.contacts;
  goal.reach_contacts = stay;
  goal.com_margin = margin;
  goal.reach_margin = margin - kTolerance;
  goal.region_margin = std::min(
      settings_.search.support_margin,
      SupportRegion(contact_points(model_, data, node.contacts)).margin(data.com.head<2>()));
  forward_kinematics(model_, posture.x, data);
  goal.com = data.com.head<2>();
  goal.posture = posture.x.q;
  const MotionResult moved = steering_.move(node.x, goal);
  const std::string name = names_of(model_, change.lifts);
  if (!moved.reached) {
    return {"weight shift before lifting " + name + ": " + moved.reason, moved.shortfall};
  }
  stretches.push_back(
      {"shift off " + name, Stretch::Kind::kMotion, moved.path, node.contacts, {}, {}});
  stretches.push_back(
      {"unload " + name, Stretch::Kind::kLoad, {moved.path.back()}, node.contacts, stay, {}});
  node = {moved.path.back(), stay};
  return {};
}

MotionResult Transition::raise(const Configuration& x, const ContactSet& contacts,
                               const std::vector<int>& links, double margin) {
  RobotData data;
  forward_kinematics(model_, x, data);
  MotionGoal goal;
  goal.contacts = contacts;
  goal.region_margin = kKept * margin;
  goal.posture = x.q;
  for (const int link : links) {
    const Eigen::Vector3d up(0.0, 0.0, kOff);
    goal.swings.push_back({link, {touch_point(model_, data, link) + up}, false, {}});
  }
  MotionResult moved = steering_.move(x, goal);
  // Well off the surface is enough: a forearm whose wrist stays down does not come far.
  RobotData after;
  forward_kinematics(model_, moved.path.back(), after);
  moved.reached = std::all_of(links.begin(), links.end(), [&](int link) {
    return touch_point(model_, after, link).z() >= touch_point(model_, data, link).z() + kLeastOff;
  });
  return moved;
}

MotionResult Transition::lower(const Configuration& x, const ContactSet& contacts,
                               const TouchPosture& posture, double margin) {
  MotionGoal goal;
  goal.contacts = contacts;
  goal.region_margin = kKept * margin;
  goal.posture = posture.x.q;
  for (const Touch& touch : posture.touches) {
    Swing swing{touch.link, {*touch.position}, true, {}};
    if (model_.contacts[static_cast<std::size_t>(touch.link)].is_patch) {
      swing.orientation = sole_pose(model_, touch).R;
    }
    goal.swings.push_back(swing);
  }
  return steering_.move(x, goal);
}

/// Off the surface, to over the new place, down. The contacts of `node` carry all the while.
Rejection Transition::go(const ContactChange& change, const TouchPosture& posture, double margin,
                         Node& node, std::vector<Stretch>& stretches) {
  const std::vector<int> touching = links_of(posture.touches);
  const std::string name = touching.empty()       ? "lift " + names_of(model_, change.lifts)
                           : change.lifts.empty() ? "reach " + names_of(model_, touching)
                                                  : "swing " + names_of(model_, touching);
  Stretch stretch{name, Stretch::Kind::kMotion, {node.x}, node.contacts, {}, touching};
  stretch.landing.insert(stretch.landing.end(), change.lifts.begin(), change.lifts.end());
  if (!change.lifts.empty()) {
    const MotionResult off = raise(node.x, node.contacts, change.lifts, margin);
    if (!off.reached) {
      return {name + ": " + off.reason, off.shortfall};
    }
    append(stretch.path, off.path);
  }
  Configuration above = posture.x;
  if (!touching.empty()) {
    ContactSet there = node.contacts;
    for (Contact& contact : there) {
      contact.slip.setZero();
    }
    const MotionResult over = raise(posture.x, there, touching, margin);
    if (!over.reached) {
      return {name + ": " + over.reason, over.shortfall};
    }
    above = over.path.back();
  }
  const std::vector<Configuration> way =
      ways_.find(stretch.path.back(), above, {node.contacts, stretch.landing, kKept * margin});
  if (way.empty()) {
    return {name + ": no way found between two postures (search.most_way_nodes)",
            kNominalShortfall};
  }
  append(stretch.path, way);
  if (!touching.empty()) {
    const MotionResult down = lower(stretch.path.back(), node.contacts, posture, margin);
    if (!down.reached) {
      return {name + ": " + down.reason, down.shortfall};
    }
    append(stretch.path, down.path);
  }
  node.x = stretch.path.back();
  stretches.push_back(std::move(stretch));
  return {};
}

Rejection Transition::reach(const ContactChange& change, const TouchPosture& posture, double margin,
                            Node& node, std::vector<Stretch>& stretches) {
  Rejection rejection;
  if (!change.lifts.empty()) {
    rejection = shift(change, posture, margin, node, stretches);
  }
  if (rejection.why.empty()) {
    press_outer_contacts(model_, scenario_, settings_.references.press, node.contacts);
    rejection = go(change, posture, margin, node, stretches);
  }
  if (!rejection.why.empty()) {
    return rejection;
  }
  if (!posture.touches.empty()) {
    RobotData data;
    forward_kinematics(model_, node.x, data);
    ContactSet with = node.contacts;
    for (const Touch& touch : posture.touches) {
      with.push_back(make_contact(model_, scenario_, data, touch.link, touch.surface));
    }
    press_outer_contacts(model_, scenario_, settings_.references.press, with);
    stretches.push_back({"load " + names_of(model_, links_of(posture.touches)),
                         Stretch::Kind::kLoad,
                         {node.x},
                         node.contacts,
                         with,
                         {}});
    node.contacts = with;
  }
  return check_.check(stretches);
}

Rejection Transition::make(const ContactChange& change, const JointVector& attractor, Node& node,
                           std::vector<Stretch>& stretches, std::size_t skip) {
  TouchRequest request;
  request.start = node.x;
  request.supports = without(node.contacts, change.lifts);
  request.touches = change.touches;
  request.attractor = attractor;
  request.near = change.lifts.empty() && change.touches.empty() ? attractor : node.x.q;
  const double wanted = wanted_margin(request.supports);
  const double least = settings_.search.support_margin;
  Rejection rejection;
  for (const double margin : {wanted, 0.5 * (wanted + least)}) {
    request.support_margin = margin;
    const std::vector<TouchPosture> postures = sampler_.sample(request);
    if (postures.empty()) {
      const std::string name = change.touches.empty() ? names_of(model_, change.lifts)
                                                      : names_of(model_, links_of(change.touches));
      rejection = {name + ": " + sampler_.failure().why, sampler_.failure().shortfall};
    }
    for (const TouchPosture& posture : postures) {
      Node to = node;
      std::vector<Stretch> made;
      rejection = reach(change, posture, margin, to, made);
      if (rejection.why.empty() && skip-- == 0) {
        node = to;
        stretches.insert(stretches.end(), made.begin(), made.end());
        return {};
      }
    }
  }
  return rejection.why.empty() ? Rejection{"no other way of making the change", kNominalShortfall}
                               : rejection;
}

}  // namespace clamber
