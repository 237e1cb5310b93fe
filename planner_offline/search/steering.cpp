#include "planner_offline/search/steering.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace clamber {
namespace {

/// A reference point that runs along a polyline and waits for its follower.
struct Runner {
  std::size_t leg = 0;
  Eigen::Vector3d reference = Eigen::Vector3d::Zero();
  int waited = 0;  // steps at a corner

  void advance(const std::vector<Eigen::Vector3d>& path, const Eigen::Vector3d& follower,
               double step) {
    constexpr double kLead = 0.02;      // m the reference may run ahead
    constexpr double kArrived = 0.005;  // m, wanted before the next leg begins ...
    constexpr int kPatience = 10;       // ... for so many steps: not every corner can be reached
    if (leg >= path.size()) {
      return;
    }
    const bool begins_leg = leg > 0 && reference == path[leg - 1];
    const double distance = (reference - follower).norm();
    const bool near = distance <= kArrived || (!begins_leg && distance <= kLead);
    if (!near && ++waited <= kPatience) {
      return;
    }
    if (!near && !begins_leg && !on_last_leg(path)) {
      reference = path[leg++];  // out of reach: on to the next corner from here
    }
    waited = 0;
    if (at_end(path)) {
      return;
    }
    const Eigen::Vector3d gap = path[leg] - reference;
    if (gap.norm() <= step) {
      reference = path[leg++];
    } else {
      reference += step * gap.normalized();
    }
  }
  [[nodiscard]] bool on_last_leg(const std::vector<Eigen::Vector3d>& path) const {
    return leg + 1 >= path.size();
  }
  [[nodiscard]] bool at_end(const std::vector<Eigen::Vector3d>& path) const {
    return leg >= path.size();
  }
};

std::string numbers(const char* format, double a, double b) {
  char text[160];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

}  // namespace

struct Steering::Progress {
  std::vector<Runner> runners;
  ContactSet contacts;       // the goal's, with their slip so far
  double swing_error = 0.0;  // m, largest height error of a landing link (place: 3 cm allowed)
  bool swings_done = true;
  double com_error = 0.0;  // m
};

Task Steering::swing_tasks(const MotionGoal& goal, Progress& progress, Task& places) const {
  Task first = empty_task(model_);
  progress.swings_done = true;
  for (std::size_t i = 0; i < goal.swings.size(); ++i) {
    const Swing& swing = goal.swings[i];
    Runner& runner = progress.runners[i];
    const ContactLink& link = model_.contacts[static_cast<std::size_t>(swing.link)];
    const Eigen::Vector3d touch = touch_point(model_, data_, swing.link);
    runner.advance(swing.path, touch, settings_.search.swing_step);
    const Eigen::Vector3d error = runner.reference - touch;
    const Task whole = point_task(model_, data_, link.body, touch,
                                  shortened(error, 1.5 * settings_.search.swing_step));
    if (swing.lands && runner.on_last_leg(swing.path)) {
      first = first + Task{whole.J.bottomRows<1>(), whole.e.tail<1>()};
      places = places + Task{whole.J.topRows<2>(), whole.e.head<2>()};
    } else {
      first = first + whole;
    }
    double tilt = 0.0;  // rad
    if (swing.orientation && runner.on_last_leg(swing.path)) {
      const auto body = static_cast<std::size_t>(link.body);
      Pose level = data_.X_WB[body];
      level.R = *swing.orientation;
      const Task pose = pose_task(model_, data_, link.body, level);
      tilt = pose.e.tail<3>().norm();
      first = first + Task{pose.J.bottomRows<3>(),
                           shortened(pose.e.tail<3>(), settings_.search.posture_step)};
    }
    const Eigen::Vector3d left = swing.path.back() - touch;
    // All corners of a sole come within the millimetre that counts as touching.
    constexpr double kLanded = 1e-3, kSoleLanded = 5e-4, kPlaced = 0.03;  // m
    constexpr double kLevel = 2e-3;                                       // rad
    const double landed = swing.orientation ? kSoleLanded : kLanded;
    const bool there = runner.at_end(swing.path) && std::abs(left.z()) < landed &&
                       left.head<2>().norm() < kPlaced && tilt < kLevel;
    progress.swings_done = progress.swings_done && there;
    progress.swing_error = std::max(progress.swing_error, left.norm());
  }
  return first;
}

/// Towards the wanted posture; the nearer the worst joint is to its torque limit, the more towards
/// a posture that needs less.
Eigen::VectorXd Steering::posture_error(const Configuration& x, const MotionGoal& goal) {
  const double step = settings_.search.posture_step;
  const Eigen::VectorXd wanted = shortened(*goal.posture - x.q, step);
  const double measure = relief_.measure(x, goal.contacts);
  const double load = std::pow(measure, 0.25);  // about the worst joint's share of its limit
  const double begin = settings_.search.relief_from, full = settings_.search.relief_full;
  const double weight = std::clamp((load - begin) / (full - begin), 0.0, 1.0);
  if (weight == 0.0 || !std::isfinite(measure)) {
    return wanted;  // out of balance there is no load to take off
  }
  return (1.0 - weight) * wanted +
         weight * Eigen::VectorXd(relief_.direction(x, goal.contacts, measure, step));
}

TaskStack Steering::stack_for(const Configuration& x, const MotionGoal& goal, Progress& progress) {
  Task held = contact_tasks(model_, data_, progress.contacts);
  held.e = shortened(held.e, 0.01);
  progress.swing_error = 0.0;
  Task places = empty_task(model_);
  TaskStack stack{held};
  stack.push_back(swing_tasks(goal, progress, places));
  if (!goal.reach_contacts.empty()) {
    // Contacts roll: where they are, and so where the CoM has to be, moves with the posture.
    const SupportRegion region(contact_points(model_, data_, goal.reach_contacts));
    const Eigen::Vector2d error =
        region.nearest_inside(goal.com, goal.com_margin) - data_.com.head<2>();
    progress.com_error = error.norm();
    stack.push_back(com_task(model_, data_, shortened(error, settings_.search.com_step)));
  }
  stack.push_back(places);
  Task posture = empty_task(model_);
  if (goal.posture) {
    posture = posture_task(model_, x.q, *goal.posture, JointVector::Ones(model_.joint_count()));
    posture.e = posture_error(x, goal);
  }
  stack.push_back(posture);
  return stack;
}

double Steering::reach_kept(const MotionGoal& goal) const {
  return SupportRegion(contact_points(model_, data_, goal.reach_contacts))
      .margin(data_.com.head<2>());
}

MotionResult Steering::move(const Configuration& start, const MotionGoal& goal) {
  MotionResult result;
  result.path.push_back(start);
  Configuration x = start;
  forward_kinematics(model_, x, data_);
  Progress progress;
  IkConstraints constraints;
  constraints.contacts = &goal.contacts;
  progress.contacts = goal.contacts;
  for (const Swing& swing : goal.swings) {
    progress.runners.push_back({0, touch_point(model_, data_, swing.link), 0});
    constraints.landing.push_back(swing.link);
  }
  constraints.region_margin = goal.region_margin;
  int stalled = 0;
  for (int i = 0; i < settings_.search.most_steps; ++i) {
    // Contacts roll, so their region moves with the posture.
    const SupportRegion region(contact_points(model_, data_, goal.contacts));
    constraints.region = &region;
    const TaskStack stack = stack_for(x, goal, progress);
    VelocityVector dv;
    const HqpStatus status = ik_.step(x, data_, stack, constraints, dv);
    if (status != HqpStatus::optimal) {
      result.reason = std::string("inverse kinematics: ") + to_string(status);
      return result;
    }
    Configuration next;
    integrate(model_, x, dv, next);
    x = next;
    const RobotData before = data_;
    forward_kinematics(model_, x, data_);
    track_slip(model_, before, data_, progress.contacts);
    result.path.push_back(x);
    const double motion = dv.cwiseAbs().maxCoeff();
    stalled = motion < 1e-3 ? stalled + 1 : 0;
    const bool com_ok = goal.reach_contacts.empty() || reach_kept(goal) >= goal.reach_margin;
    if (progress.swings_done && com_ok) {
      result.reached = true;
      return result;
    }
    constexpr int kGivenUp = 12;
    if (stalled >= kGivenUp) {
      break;
    }
  }
  if (!progress.swings_done) {
    result.shortfall = progress.swing_error;
    result.reason = numbers("swing stops %.1f cm short", 100.0 * progress.swing_error, 0.0) +
                    ik_.binding(x, data_, constraints);
  } else {
    const double margin = reach_kept(goal);
    result.shortfall = goal.reach_margin - margin;
    result.reason = numbers("centre of mass keeps %.1f cm of %.1f cm support margin",
                            100.0 * margin, 100.0 * goal.reach_margin) +
                    ik_.binding(x, data_, constraints);
  }
  return result;
}

}  // namespace clamber
