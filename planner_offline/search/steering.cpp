#include "planner_offline/search/steering.hpp"

#include <algorithm>
#include <cstdio>

namespace clamber {
namespace {

/// A reference point that runs along a polyline and waits for its follower.
struct Runner {
  std::size_t leg = 0;
  Eigen::Vector3d reference = Eigen::Vector3d::Zero();

  void advance(const std::vector<Eigen::Vector3d>& path, const Eigen::Vector3d& follower,
               double step) {
    constexpr double kLead = 0.02;      // m the reference may run ahead
    constexpr double kArrived = 0.005;  // m, before the next leg begins
    const bool begins_leg = leg > 0 && leg < path.size() && reference == path[leg - 1];
    if (leg >= path.size() || (reference - follower).norm() > (begins_leg ? kArrived : kLead)) {
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
    const Eigen::Vector3d left = swing.path.back() - touch;
    constexpr double kLanded = 5e-4, kPlaced = 0.03;
    const bool there = runner.at_end(swing.path) && std::abs(left.z()) < kLanded &&
                       left.head<2>().norm() < kPlaced;
    progress.swings_done = progress.swings_done && there;
    progress.swing_error = std::max(progress.swing_error, left.norm());
  }
  return first;
}

TaskStack Steering::stack_for(const Configuration& x, const MotionGoal& goal,
                              Progress& progress) const {
  Task held = empty_task(model_);
  for (const Contact& contact : goal.contacts) {
    held = held + contact_task(model_, data_, contact);
  }
  held.e = shortened(held.e, 0.01);
  progress.swing_error = 0.0;
  Task places = empty_task(model_);
  TaskStack stack{held};
  stack.push_back(swing_tasks(goal, progress, places));
  if (goal.com) {
    const Eigen::Vector2d error = *goal.com - data_.com.head<2>();
    progress.com_error = error.norm();
    stack.push_back(com_task(model_, data_, shortened(error, settings_.search.com_step)));
  }
  stack.push_back(places);
  Task posture = empty_task(model_);
  if (goal.posture) {
    posture = posture_task(model_, x.q, *goal.posture, JointVector::Ones(model_.joint_count()));
    posture.e = shortened(posture.e, settings_.search.posture_step);
  }
  if (goal.base_orientation) {
    Task turn = base_orientation_task(model_, data_, *goal.base_orientation);
    turn.e = shortened(turn.e, settings_.search.posture_step);
    posture = posture + turn;
  }
  stack.push_back(posture);
  return stack;
}

MotionResult Steering::move(const Configuration& start, const MotionGoal& goal) {
  MotionResult result;
  result.path.push_back(start);
  Configuration x = start;
  forward_kinematics(model_, x, data_);
  Progress progress;
  IkConstraints constraints;
  constraints.contacts = &goal.contacts;
  for (const Swing& swing : goal.swings) {
    progress.runners.push_back({0, touch_point(model_, data_, swing.link)});
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
      result.reason = "constraints contradict each other";
      return result;
    }
    Configuration next;
    integrate(model_, x, dv, next);
    x = next;
    forward_kinematics(model_, x, data_);
    result.path.push_back(x);
    const double motion = dv.cwiseAbs().maxCoeff();
    stalled = motion < 1e-3 ? stalled + 1 : 0;
    const bool com_ok =
        !goal.reach_region || goal.reach_region->margin(data_.com.head<2>()) >= goal.reach_margin;
    const bool posture_ok = !goal.posture_must_converge || stalled >= 3;
    if (progress.swings_done && com_ok && posture_ok) {
      result.reached = true;
      return result;
    }
    constexpr int kGivenUp = 12;
    if (stalled >= kGivenUp) {
      break;
    }
  }
  if (!progress.swings_done) {
    result.reason = numbers("swing stops %.1f cm short", 100.0 * progress.swing_error, 0.0);
  } else if (goal.reach_region) {
    result.reason =
        numbers("centre of mass keeps %.1f cm of %.1f cm support margin",
                100.0 * goal.reach_region->margin(data_.com.head<2>()), 100.0 * goal.reach_margin);
  } else {
    result.reason = "posture does not settle";
  }
  return result;
}

}  // namespace clamber
