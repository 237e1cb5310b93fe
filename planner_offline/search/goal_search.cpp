#include "planner_offline/search/goal_search.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "planner_offline/planning_failed.hpp"

namespace clamber {
namespace {

constexpr int kTop = 0;  // the first obstacle

void append(std::vector<Stretch>& stretches, const std::vector<Stretch>& more) {
  stretches.insert(stretches.end(), more.begin(), more.end());
}

/// Half a turn about the vertical through the obstacle's middle: a box looks the same after it.
Pose half_turn(const ObstacleBox& box) {
  Pose X;
  X.R = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d middle(box.center.x(), box.center.y(), 0.0);
  X.p = middle - X.R * middle;
  return X;
}

Eigen::Vector3d turned(double heading, const Eigen::Vector3d& v) {
  return Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()) * v;
}

Stance stance_of(const std::vector<Touch>& soles) {
  Stance stance;
  for (const Touch& sole : soles) {
    stance.position += sole.position->head<2>() / static_cast<double>(soles.size());
    stance.heading += sole.heading / static_cast<double>(soles.size());
  }
  return stance;
}

/// From a posture to one that differs by little: what landing left of millimetres.
std::vector<Configuration> blend(const Configuration& from, const Configuration& to) {
  constexpr int kSteps = 20;
  std::vector<Configuration> path;
  for (int i = 1; i <= kSteps; ++i) {
    path.push_back(between(from, to, static_cast<double>(i) / kSteps));
  }
  return path;
}

}  // namespace

GoalSearch::GoalSearch(const RobotModel& model, const Scenario& scenario,
                       const Clearance& clearance, const PlannerSettings& settings,
                       Progress progress)
    : model_(model),
      scenario_(scenario),
      settings_(settings),
      transition_(model, scenario, clearance, settings),
      graph_(model, transition_, [progress](const std::string& what) { progress(0.0, what); }),
      ways_(model, clearance, settings),
      progress_(std::move(progress)) {}

/// Where the soles lie when the robot stands there as it did at the start.
std::vector<Touch> GoalSearch::footprints(const Stance& stance) const {
  RobotData data;
  forward_kinematics(model_, start_configuration(model_, scenario_), data);
  std::vector<Touch> feet;
  for (int link = 0; link < static_cast<int>(model_.contacts.size()); ++link) {
    if (!model_.contacts[static_cast<std::size_t>(link)].is_patch) {
      continue;
    }
    const Eigen::Vector3d from_middle = touch_point(model_, data, link) - scenario_.start_position;
    Eigen::Vector3d position(stance.position.x(), stance.position.y(), 0.0);
    position += turned(stance.heading - scenario_.start_yaw, from_middle);
    position.z() = surface_height(scenario_, kTop);
    feet.push_back({link, kTop, position, stance.heading});
  }
  return feet;
}

/// Where the soles are, in the order of the model's links.
std::vector<Touch> GoalSearch::soles_of(const Node& node) const {
  RobotData data;
  forward_kinematics(model_, node.x, data);
  std::vector<Touch> feet = footprints({});
  for (Touch& foot : feet) {
    const int body = model_.contacts[static_cast<std::size_t>(foot.link)].body;
    foot.position = touch_point(model_, data, foot.link);
    const Eigen::Matrix3d turn =
        data.X_WB[static_cast<std::size_t>(body)].R *
        sole_pose(model_, {foot.link, kTop, foot.position, 0.0}).R.transpose();
    foot.heading = std::atan2(turn(1, 0), turn(0, 0));
  }
  return feet;
}

/// Stances on top whose soles are inside the edges, from near the knees on.
std::vector<Stance> GoalSearch::stances_near(const Node& node) const {
  RobotData data;
  forward_kinematics(model_, node.x, data);
  Eigen::Vector3d knees = Eigen::Vector3d::Zero();
  double count = 0.0;
  const std::vector<Touch> soles = footprints({});
  for (const Contact& contact : node.contacts) {
    const bool of_leg = std::any_of(soles.begin(), soles.end(), [&](const Touch& sole) {
      return model_.contacts[static_cast<std::size_t>(sole.link)].limb ==
             model_.contacts[static_cast<std::size_t>(contact.link)].limb;
    });
    if (of_leg) {
      knees += touch_point(model_, data, contact.link);
      count += 1.0;
    }
  }
  std::vector<Stance> stances;
  if (count == 0.0) {
    return stances;
  }
  knees /= count;
  const double heading = scenario_.start_yaw;
  for (const double forward : {0.06, 0.09, 0.03, 0.12, 0.15, 0.0, 0.18}) {
    const Eigen::Vector3d p = knees + turned(heading, {forward, 0.0, 0.0});
    const Stance stance{p.head<2>(), heading};
    const std::vector<Touch> feet = footprints(stance);
    const bool inside = std::all_of(feet.begin(), feet.end(), [&](const Touch& foot) {
      const ContactLink& link = model_.contacts[static_cast<std::size_t>(foot.link)];
      const Pose pose = sole_pose(model_, foot);
      return std::all_of(link.points.begin(), link.points.end(), [&](const auto& corner) {
        const Eigen::Vector3d at = pose * corner;
        return (inside_surface(scenario_, kTop, at, settings_.references.surface_margin) - at)
                   .head<2>()
                   .norm() < 1e-9;
      });
    });
    if (inside) {
      stances.push_back(stance);
    }
  }
  return stances;
}

std::vector<Stretch> GoalSearch::stand_up(Node& node) {
  std::string failure = "no room for both soles near the knees, inside the obstacle's edges";
  for (const Stance& stance : stances_near(node)) {
    try {
      Node to = node;
      std::vector<Stretch> stretches = graph_.find(footprints(stance), model_.home, to);
      const Rejection rejection = transition_.make({}, model_.home, to, stretches);
      if (rejection.why.empty()) {
        stretches.back().name = "stand up";
        node = to;
        return stretches;
      }
      failure = rejection.why;
    } catch (const PlanningFailed& failed) {
      failure = failed.what();
    }
    progress_(0.0, "rejected: " + failure);
  }
  throw PlanningFailed("standing up on top: " + failure);
}

/// One foot after the other; which one goes first depends on which makes room for the other.
Rejection GoalSearch::step_to(std::vector<Touch> feet, Node& node,
                              std::vector<Stretch>& stretches) {
  Rejection rejection;
  for (std::size_t order = 0; order < feet.size(); ++order) {
    Node to = node;
    std::vector<Stretch> made;
    for (const Touch& foot : feet) {
      rejection = transition_.make({{foot.link}, {foot}}, model_.home, to, made);
      if (!rejection.why.empty()) {
        break;
      }
    }
    if (rejection.why.empty()) {
      node = to;
      append(stretches, made);
      return {};
    }
    std::rotate(feet.begin(), feet.begin() + 1, feet.end());
  }
  return rejection;
}

/// Statically stable steps: the centre of mass goes over the sole that stays before the other one
/// lifts.
std::vector<Stretch> GoalSearch::walk(Node& node, const std::vector<Touch>& to) {
  const std::vector<Touch> from = soles_of(node);
  const Stance a = stance_of(from), b = stance_of(to);
  const int steps = static_cast<int>(
      std::ceil(std::max((b.position - a.position).norm() / settings_.search.step_length,
                         std::abs(b.heading - a.heading) / settings_.search.step_turn)));
  std::vector<Stretch> stretches;
  for (int k = 1; k <= steps; ++k) {
    const double share = static_cast<double>(k) / steps;
    const Stance stance{a.position + share * (b.position - a.position),
                        a.heading + share * (b.heading - a.heading)};
    const Rejection rejection = step_to(k == steps ? to : footprints(stance), node, stretches);
    if (!rejection.why.empty()) {
      throw PlanningFailed("step " + std::to_string(k) + " of " + std::to_string(steps) +
                           " on top: " + rejection.why);
    }
    progress_(share, "step " + std::to_string(k) + " of " + std::to_string(steps));
  }
  return stretches;
}

/// From where the steps ended to exactly where the way down begins.
std::vector<Stretch> GoalSearch::close_up(Node& node, const Configuration& to) {
  std::vector<Configuration> path =
      ways_.find(node.x, to, {node.contacts, {}, settings_.search.step_margin});
  if (path.empty()) {
    throw PlanningFailed(
        "after the steps on top: no way to the posture that the way down begins in");
  }
  const std::vector<Configuration> rest = blend(path.back(), to);
  path.insert(path.end(), rest.begin(), rest.end());
  node.x = to;
  return {{"stand", Stretch::Kind::kMotion, path, node.contacts, {}, {}}};
}

std::vector<Stretch> GoalSearch::complete(std::vector<Stretch> climb) {
  if (scenario_.goal == Goal::kAllFours) {
    return climb;
  }
  climb = joined(std::move(climb));
  if (scenario_.goal == Goal::kBackDown) {
    append(climb, reversed(climb));
    return climb;
  }
  Node node{climb.back().path.back(), carrying(climb.back())};
  append(climb, stand_up(node));
  climb = joined(std::move(climb));
  if (scenario_.goal == Goal::kStandOnTop) {
    return climb;
  }
  const Pose X = half_turn(scenario_.obstacles[kTop]);
  const std::vector<Stretch> down = reversed(moved(climb, X));
  std::vector<Touch> soles = soles_of(node);
  for (Touch& sole : soles) {
    sole.position = X * *sole.position;
    sole.heading += std::numbers::pi;
  }
  append(climb, walk(node, soles));
  append(climb, close_up(node, down.front().path.front()));
  append(climb, down);
  return joined(std::move(climb));
}

}  // namespace clamber
