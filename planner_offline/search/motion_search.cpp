#include "planner_offline/search/motion_search.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace clamber {
namespace {

/// Where a move's references are shifted to, m: forward over the obstacle, inward to the robot's
/// middle. The recording's own places come first.
struct Placement {
  double forward;
  double inward;
};
constexpr Placement kPlacements[] = {{0.0, 0.0},   {0.0, 0.04},   {0.03, 0.0}, {0.03, 0.04},
                                     {-0.03, 0.0}, {-0.03, 0.04}, {0.06, 0.0}, {0.06, 0.04},
                                     {-0.06, 0.0}, {0.1, 0.0},    {-0.1, 0.0}};

/// How far the centre of mass gets over the contacts that stay is theirs to say, hardly the next
/// place's. A weight shift that falls so short is not tried with less margin, after two such not
/// for further places, and after four, over other places before, the attempt ends: other places it
/// is.
constexpr double kFarOff = 0.015;  // m
constexpr int kMostFarOff = 2;
constexpr int kMostFarOffInAll = 4;

/// Ways of swinging, the plain one first. A limb that only reaches out leaves no support: for it
/// the height is all there is to choose.
std::vector<SwingWay> ways_for(const Move& move, const SearchSettings& settings) {
  std::vector<SwingWay> ways;
  for (const SwingWay& way :
       {SwingWay{0.0, 0.0, 0.02}, SwingWay{0.0, 0.0, 0.1}, SwingWay{0.0, 0.05, 0.06},
        SwingWay{0.03, 0.0, 0.02}, SwingWay{0.03, 0.08, 0.1}, SwingWay{-0.03, 0.05, 0.1}}) {
    if (!move.lifts.empty() || way.outward == 0.0) {
      ways.push_back({settings.swing_height + way.height, way.outward, way.back});
    }
  }
  return ways;
}

}  // namespace

Node standing_at(const RobotModel& model, const Scenario& scenario, const Configuration& start) {
  Node node{start, {}};
  RobotData data;
  forward_kinematics(model, start, data);
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    if (model.contacts[i].is_patch) {
      node.contacts.push_back(make_contact(model, scenario, data, static_cast<int>(i), kFloor));
    }
  }
  return node;
}

MotionSearch::MotionSearch(const RobotModel& model, const Scenario& scenario,
                           const Clearance& clearance, const PlannerSettings& settings,
                           ReferenceOptimiser& references)
    : model_(model),
      scenario_(scenario),
      clearance_(clearance),
      settings_(settings),
      references_(references),
      steering_(model, clearance, settings_),
      check_(model, settings_) {}

SupportRegion MotionSearch::region_of(const Configuration& x, const ContactSet& contacts) {
  RobotData data;
  forward_kinematics(model_, x, data);
  return SupportRegion(contact_points(model_, data, contacts));
}

double MotionSearch::margin_for(const ContactSet& contacts) const {
  return only_patches(model_, contacts) ? settings_.search.free_margin
                                        : settings_.search.support_margin;
}

/// Brings the centre of mass over the contacts that stay. Contacts that the next state lacks are
/// relaxed: a foot may roll over its front edge.
Rejection MotionSearch::shift_weight(const Move& move, double margin, const TouchKeyframe& keyframe,
                                     Node& node, std::vector<Stretch>& stretches) {
  const ContactSet common = without(node.contacts, move.lifts);
  ContactSet relaxed = node.contacts;
  for (Contact& contact : relaxed) {
    const bool lifts =
        std::find(move.lifts.begin(), move.lifts.end(), contact.link) != move.lifts.end();
    if (lifts && contact.mode == ContactMode::kPatch) {
      contact.mode = ContactMode::kToe;
    }
  }
  MotionGoal goal;
  goal.contacts = relaxed;
  goal.reach_contacts = common;
  goal.reach_margin = margin - 0.005;
  goal.com_margin = margin;
  RobotData data;
  forward_kinematics(model_, node.x, data);
  goal.region_margin = std::min(settings_.search.support_margin,
                                region_of(node.x, relaxed).margin(data.com.head<2>()));
  forward_kinematics(model_, keyframe.x, data);
  goal.com = data.com.head<2>();
  goal.posture = keyframe.x.q;
  const MotionResult moved = steering_.move(node.x, goal);
  if (!moved.reached) {
    // Falling short is no failure as long as the contacts that stay carry with the least margin.
    forward_kinematics(model_, moved.path.back(), data);
    const double kept = region_of(moved.path.back(), common).margin(data.com.head<2>());
    if (kept < settings_.search.support_margin) {
      return {"weight shift before lifting " + names_of(model_, move.lifts) + ": " + moved.reason,
              settings_.search.support_margin - kept};
    }
  }
  stretches.push_back({"shift off " + names_of(model_, move.lifts),
                       Stretch::Kind::kMotion,
                       moved.path,
                       relaxed,
                       {},
                       {}});
  stretches.push_back({"unload " + names_of(model_, move.lifts),
                       Stretch::Kind::kLoad,
                       {moved.path.back()},
                       relaxed,
                       common,
                       {}});
  node = {moved.path.back(), common};
  return {};
}

Rejection MotionSearch::swing(const Move& move, const SwingWay& way, const TouchKeyframe& keyframe,
                              Node& node, std::vector<Stretch>& stretches) {
  MotionGoal goal;
  goal.contacts = node.contacts;
  goal.region_margin = margin_for(goal.contacts);
  RobotData data;
  forward_kinematics(model_, node.x, data);
  goal.posture = keyframe.x.q;
  const double above = surface_height(scenario_, move.surface) + way.height;
  for (const int link : move.lands) {
    const Eigen::Vector3d from = touch_point(model_, data, link);
    const Eigen::Vector3d to = keyframe.positions.at(link);
    Swing path{link, {}, true, {}};
    if (!move.lifts.empty()) {
      // Up beside the obstacle's face first, then over its edge.
      const double side = from.y() >= data.X_WB[0].p.y() ? way.outward : -way.outward;
      path.path.push_back({std::min(from.x(), to.x()) - way.back, from.y() + side, above});
    }
    path.path.push_back(
        {to.x(), to.y(), holds_limb(model_, node.contacts, link) ? to.z() + 0.04 : above});
    path.path.push_back(to);
    goal.swings.push_back(path);
  }
  const MotionResult moved = steering_.move(node.x, goal);
  const std::string name =
      (move.lifts.empty() ? "reach " : "swing ") + names_of(model_, move.lands);
  if (!moved.reached) {
    return {name + ": " + moved.reason, moved.shortfall};
  }
  std::vector<int> touching = move.lands;
  touching.insert(touching.end(), move.lifts.begin(), move.lifts.end());
  stretches.push_back({name, Stretch::Kind::kMotion, moved.path, node.contacts, {}, touching});
  node.x = moved.path.back();
  forward_kinematics(model_, node.x, data);
  ContactSet with = node.contacts;
  for (const int link : move.lands) {
    with.push_back(make_contact(model_, scenario_, data, link, move.surface));
  }
  press_outer_contacts(model_, scenario_, settings_.references.press, with);
  stretches.push_back({"load " + names_of(model_, move.lands),
                       Stretch::Kind::kLoad,
                       {node.x},
                       node.contacts,
                       with,
                       {}});
  node.contacts = with;
  return {};
}

void MotionSearch::reject(std::size_t index, const Rejection& rejection) {
  result_.rejected.push_back(rejection.why);
  progress_(static_cast<int>(index), static_cast<int>(moves_->size()),
            "rejected: " + rejection.why);
  const bool further = index > result_.furthest || result_.failure.empty();
  if (further || (index == result_.furthest && rejection.shortfall < result_.shortfall)) {
    result_.furthest = index;
    result_.failure = rejection.why;
    result_.shortfall = rejection.shortfall;
  }
}

/// Takes the move as made and makes the rest of the climb after it; undoes it where that fails.
bool MotionSearch::go_on(std::size_t index, const std::vector<Stretch>& stretches,
                         const TouchKeyframe& keyframe, const Node& node) {
  const std::size_t kept_stretches = result_.stretches.size();
  const std::size_t kept_keyframes = result_.keyframes.size();
  result_.stretches.insert(result_.stretches.end(), stretches.begin(), stretches.end());
  result_.keyframes.push_back(keyframe);
  if (descend(index + 1, node)) {
    return true;
  }
  ++result_.backtracks;
  result_.stretches.resize(kept_stretches);
  result_.keyframes.resize(kept_keyframes);
  return false;
}

/// Makes the move to this keyframe in one way or another and, where that works, the rest of the
/// climb after it.
bool MotionSearch::try_keyframe(std::size_t index, const TouchKeyframe& keyframe, const Node& node,
                                int& far_off) {
  const Move& move = (*moves_)[index];
  const double least = settings_.search.support_margin, wanted = settings_.search.wanted_margin;
  for (const double margin : {wanted, 0.5 * (wanted + least)}) {
    std::vector<Stretch> shift;
    Node shifted = node;
    if (!move.lifts.empty()) {
      ++result_.candidates_tried;
      Rejection rejection = shift_weight(move, margin, keyframe, shifted, shift);
      if (rejection.why.empty()) {
        rejection = check_.check(shift);
      }
      if (!rejection.why.empty()) {
        reject(index, rejection);
        if (rejection.shortfall > kFarOff) {
          ++far_off;
          ++far_off_;
          return false;
        }
        continue;
      }
    }
    for (const SwingWay& way : ways_for(move, settings_.search)) {
      if (used_up(index)) {
        return false;
      }
      ++result_.candidates_tried;
      std::vector<Stretch> stretches;
      Node to = shifted;
      Rejection rejection = swing(move, way, keyframe, to, stretches);
      if (rejection.why.empty()) {
        rejection = check_.check(stretches);
      }
      if (!rejection.why.empty()) {
        reject(index, rejection);
        continue;
      }
      stretches.insert(stretches.begin(), shift.begin(), shift.end());
      // When the move works and what follows does not, another way to the same place is no help.
      return go_on(index, stretches, keyframe, to);
    }
    if (move.lifts.empty()) {
      break;  // no weight to shift: the margin makes no difference
    }
  }
  return false;
}

bool MotionSearch::is_there_already(const Move& move, const Node& node) const {
  constexpr double kNear = 0.03;  // m, not worth lifting a contact for
  RobotData data;
  forward_kinematics(model_, node.x, data);
  const ObstacleBox& box = scenario_.obstacles[static_cast<std::size_t>(move.surface)];
  return std::all_of(move.lands.begin(), move.lands.end(), [&](int link) {
    const Eigen::Vector3d gap =
        from_edge_frame(box, move.references.at(link)) - touch_point(model_, data, link);
    return gap.head<2>().norm() < kNear;
  });
}

/// The climb ends with the weight spread over all contacts, not where the last one happened to
/// land: a contact that hardly carries is one that a millimetre lifts off.
void MotionSearch::settle(const Node& node) {
  MotionGoal goal;
  goal.contacts = node.contacts;
  goal.region_margin = settings_.search.support_margin;
  goal.reach_contacts = node.contacts;
  goal.reach_margin = goal.com_margin = settings_.search.settled_margin;
  RobotData data;
  forward_kinematics(model_, node.x, data);
  goal.com = data.com.head<2>();
  goal.posture = node.x.q;
  // How far it gets is how far it goes: there is nothing to reach, only something to gain.
  MotionResult moved = steering_.move(node.x, goal);
  Stretch stretch{"settle", Stretch::Kind::kMotion, std::move(moved.path), node.contacts, {}, {}};
  if (check_.check({stretch}).why.empty()) {
    result_.stretches.push_back(std::move(stretch));
  }
}

bool MotionSearch::used_up(std::size_t index) {
  if (far_off_ >= kMostFarOffInAll) {
    return true;
  }
  if (result_.candidates_tried < settings_.search.most_candidates) {
    return false;
  }
  if (result_.failure.empty()) {
    result_.failure = names_of(model_, (*moves_)[index].lands) +
                      ": all candidates used up (search.most_candidates)";
    result_.shortfall = kNominalShortfall;
  }
  return true;
}

bool MotionSearch::descend(std::size_t index, const Node& node) {
  if (index == moves_->size()) {
    settle(node);
    return true;
  }
  const Move& move = (*moves_)[index];
  if (move.optional && is_there_already(move, node)) {
    return descend(index + 1, node);
  }
  const ContactSet supports = without(node.contacts, move.lifts);
  const ObstacleBox& box = scenario_.obstacles[static_cast<std::size_t>(move.surface)];
  int far_off = 0;
  for (const Placement& placement : kPlacements) {
    if (used_up(index)) {
      return false;
    }
    if (far_off >= kMostFarOff) {
      break;
    }
    if (placement.inward != 0.0 && move.lands.size() != 1) {
      continue;  // a pair keeps its width: it is what the support region lives on
    }
    progress_(static_cast<int>(index), static_cast<int>(moves_->size()),
              names_of(model_, move.lands));
    std::map<int, Eigen::Vector3d> wanted = move.references;
    for (auto& [link, reference] : wanted) {
      reference.x() += placement.forward;
      const double side = reference.y() - to_edge_frame(box, node.x.X_WB.p).y();
      reference.y() -= std::copysign(std::min(std::abs(side), placement.inward), side);
      reference = from_edge_frame(box, reference);
    }
    ++result_.candidates_tried;
    const TouchKeyframe keyframe = references_.optimise(
        move.state, node.x, supports, wanted, move.completes_limb, move.surface, move.hint);
    if (!keyframe.problem.empty()) {
      reject(index, {names_of(model_, move.lands) + ": " + keyframe.problem, keyframe.shortfall});
    } else if (try_keyframe(index, keyframe, node, far_off)) {
      return true;
    }
  }
  // A limb that cannot be set down farther on stays where it is.
  return move.optional && descend(index + 1, node);
}

SearchResult MotionSearch::run(const Configuration& start, const std::vector<Move>& moves,
                               const Progress& progress) {
  result_ = {};
  far_off_ = 0;
  progress_ = progress;
  moves_ = &moves;
  result_.success = descend(0, standing_at(model_, scenario_, start));
  moves_ = nullptr;
  return result_;
}

}  // namespace clamber
