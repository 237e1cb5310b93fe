#include "planner_offline/search/touch_sampler.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "planner_offline/certify/support_region.hpp"

namespace clamber {

/// One start on its way to a posture.
struct TouchSampler::Attempt {
  Configuration x;
  RobotData data;
  ContactSet supports;
  ContactSet contacts;  // supports and touches: what may be near
  std::vector<Touch> touches;
  std::vector<int> landing;
  JointVector hint;

  [[nodiscard]] const ContactSet& carrying() const {
    return supports.empty() ? contacts : supports;
  }
};

namespace {

/// Axes of a level sole in its body's frame, from the corners: forward, left, up.
Eigen::Matrix3d sole_axes(const ContactLink& link) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : link.points) {
    centre += point / static_cast<double>(link.points.size());
  }
  Eigen::Vector3d up =
      (link.points[1] - link.points[0]).cross(link.points[2] - link.points[0]).normalized();
  if (up.dot(centre) > 0.0) {
    up = -up;  // the ankle is above the sole
  }
  const Eigen::Vector3d forward = (Eigen::Vector3d::UnitX() - up * up.x()).normalized();
  Eigen::Matrix3d axes;
  axes << forward, up.cross(forward), up;
  return axes;
}

double heading_of(const Eigen::Matrix3d& R) { return std::atan2(R(1, 0), R(0, 0)); }

constexpr double kReached = 4e-3;  // m

}  // namespace

Pose sole_pose(const RobotModel& model, const Touch& touch) {
  const ContactLink& link = model.contacts[static_cast<std::size_t>(touch.link)];
  Pose pose;
  pose.R = Eigen::AngleAxisd(touch.heading, Eigen::Vector3d::UnitZ()) * sole_axes(link).transpose();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : link.points) {
    centre += pose.R * point / static_cast<double>(link.points.size());
  }
  pose.p = *touch.position - centre;
  return pose;
}

Task holding(const RobotModel& model, const RobotData& data, const ContactSet& contacts) {
  Task held = contact_tasks(model, data, contacts);
  held.e = shortened(held.e, 0.01);
  return held;
}

double normal(std::mt19937& random) {
  constexpr int kTerms = 12;  // their sum has variance 1
  double sum = -0.5 * kTerms;
  for (int i = 0; i < kTerms; ++i) {
    sum += static_cast<double>(random()) / 4294967296.0;
  }
  return sum;
}

TouchSampler::TouchSampler(const RobotModel& model, const Scenario& scenario,
                           const Clearance& clearance, const PlannerSettings& settings)
    : model_(model),
      scenario_(scenario),
      clearance_(clearance),
      settings_(settings),
      ik_(model, clearance, settings.ik),
      forces_(model, settings.forces) {}

/// False: it moved hardly or not at all.
bool TouchSampler::advance(Attempt& attempt, const TaskStack& stack, bool collisions) {
  IkConstraints constraints;
  constraints.contacts = &attempt.contacts;
  constraints.landing = attempt.landing;
  constraints.collisions = collisions;
  VelocityVector dv;
  if (ik_.step(attempt.x, attempt.data, stack, constraints, dv) != HqpStatus::optimal) {
    return false;
  }
  Configuration next;
  integrate(model_, attempt.x, dv, next);
  attempt.x = next;
  const RobotData before = attempt.data;
  forward_kinematics(model_, attempt.x, attempt.data);
  track_slip(model_, before, attempt.data, attempt.supports);
  constexpr double kStill = 2e-4;
  return dv.cwiseAbs().maxCoeff() > kStill;
}

JointVector TouchSampler::hint_for(const TouchRequest& request, std::size_t start) {
  constexpr double kSpread = 0.3;  // rad
  const double share = start == 0 ? 0.0 : start == 1 ? 1.0 : 0.5 * static_cast<double>(start % 3);
  JointVector hint = (1.0 - share) * request.start.q + share * request.attractor;
  for (int j = 0; start > 1 && j < model_.joint_count(); ++j) {
    const Joint& joint = model_.joints[static_cast<std::size_t>(j)];
    hint[j] =
        std::clamp(hint[j] + kSpread * normal(random_), joint.lower + settings_.ik.limit_margin,
                   joint.upper - settings_.ik.limit_margin);
  }
  return hint;
}

/// Towards the hint, through whatever is in the way: this is where a search begins, not a motion.
void TouchSampler::relax(Attempt& attempt) {
  constexpr int kSteps = 40;
  for (int i = 0; i < kSteps; ++i) {
    Task posture =
        posture_task(model_, attempt.x.q, attempt.hint, JointVector::Ones(model_.joint_count()));
    posture.e = shortened(posture.e, settings_.ik.joint_step);
    if (!advance(attempt, holding(model_, attempt.data, attempt.supports) / posture, false)) {
      return;
    }
  }
}

/// A sole without a place gets the one that is nearest to where it happens to be.
void TouchSampler::settle_soles(Attempt& attempt) {
  for (Touch& touch : attempt.touches) {
    const ContactLink& link = model_.contacts[static_cast<std::size_t>(touch.link)];
    if (touch.position || !link.is_patch) {
      continue;
    }
    const Eigen::Vector3d at = touch_point(model_, attempt.data, touch.link);
    double reach = 0.0;  // of a sole beyond its middle
    for (const Eigen::Vector3d& point : link.points) {
      const Pose& X_WB = attempt.data.X_WB[static_cast<std::size_t>(link.body)];
      reach = std::max(reach, (X_WB * point - at).norm());
    }
    touch.position =
        inside_surface(scenario_, touch.surface, at, settings_.references.surface_margin + reach);
    touch.heading = heading_of(attempt.x.X_WB.R);
  }
}

/// Where a point contact is to touch: its place, or straight below where it is, inside the edges.
Eigen::Vector3d TouchSampler::place(const Touch& touch, const Eigen::Vector3d& at) const {
  return touch.position.value_or(
      inside_surface(scenario_, touch.surface, at, settings_.references.surface_margin));
}

Task TouchSampler::reach_task(const Attempt& attempt) const {
  Task reach = empty_task(model_);
  for (const Touch& touch : attempt.touches) {
    const ContactLink& link = model_.contacts[static_cast<std::size_t>(touch.link)];
    if (link.is_patch) {
      Task pose = pose_task(model_, attempt.data, link.body, sole_pose(model_, touch));
      pose.e.head<3>() = shortened(pose.e.head<3>(), settings_.ik.base_step);
      pose.e.tail<3>() = shortened(pose.e.tail<3>(), settings_.ik.joint_step);
      reach = reach + pose;
    } else {
      const Eigen::Vector3d at = touch_point(model_, attempt.data, touch.link);
      reach = reach + point_task(model_, attempt.data, link.body, at,
                                 shortened(place(touch, at) - at, settings_.ik.base_step));
    }
  }
  return reach;
}

void TouchSampler::reach(Attempt& attempt, double margin) {
  constexpr int kSteps = 200;
  constexpr int kThrough = 20;  // steps before links mind what is in their way
  for (int i = 0; i < kSteps; ++i) {
    const SupportRegion region(contact_points(model_, attempt.data, attempt.carrying()));
    const Eigen::Vector2d com = attempt.data.com.head<2>();
    Task posture =
        posture_task(model_, attempt.x.q, attempt.hint, JointVector::Ones(model_.joint_count()));
    posture.e = shortened(posture.e, settings_.search.posture_step);
    TaskStack stack;
    if (!attempt.supports.empty()) {
      stack.push_back(holding(model_, attempt.data, attempt.supports));
    }
    if (!attempt.touches.empty()) {
      stack.push_back(reach_task(attempt));
    }
    stack.push_back(
        com_task(model_, attempt.data,
                 shortened(region.nearest_inside(com, margin) - com, settings_.search.com_step)));
    stack.push_back(posture);
    if (!advance(attempt, stack, i > kThrough) && i > kThrough + 1) {
      return;
    }
  }
}

double TouchSampler::reach_error(const Attempt& attempt) const {
  double error = 0.0;
  for (const Touch& touch : attempt.touches) {
    const ContactLink& link = model_.contacts[static_cast<std::size_t>(touch.link)];
    if (!link.is_patch) {
      const Eigen::Vector3d at = touch_point(model_, attempt.data, touch.link);
      error = std::max(error, (place(touch, at) - at).norm());
      continue;
    }
    const Pose wanted = sole_pose(model_, touch);
    const Pose& now = attempt.data.X_WB[static_cast<std::size_t>(link.body)];
    for (const Eigen::Vector3d& corner : link.points) {
      error = std::max(error, (wanted * corner - now * corner).norm());
    }
  }
  for (const Contact& contact : attempt.supports) {
    error = std::max(error, contact.slip.norm());
  }
  return error;
}

std::string TouchSampler::binding(const Attempt& attempt) const {
  return ik_.binding(attempt.x, attempt.data,
                     {.contacts = &attempt.contacts, .landing = attempt.landing});
}

Rejection TouchSampler::judge(const Attempt& attempt, double margin, double& peak_torque) {
  char text[200];
  const double error = reach_error(attempt);
  if (error > kReached) {
    std::snprintf(text, sizeof text, "contact out of reach by %.1f cm", 100.0 * error);
    return {text + binding(attempt), error};
  }
  const SupportRegion region(contact_points(model_, attempt.data, attempt.carrying()));
  const double kept = region.margin(attempt.data.com.head<2>());
  constexpr double kTolerance = 4e-3;  // m: the task stops near the margin, not on it
  if (kept < margin - kTolerance) {
    std::snprintf(text, sizeof text, "centre of mass keeps %.1f cm of %.1f cm support margin",
                  100.0 * kept, 100.0 * margin);
    return {text + binding(attempt), margin - kept};
  }
  const ClearanceReport clear = clearance_.report(attempt.data, attempt.contacts, attempt.landing);
  if (clear.obstacle_excess < -2e-3) {
    std::snprintf(text, sizeof text, "%s is %.1f cm too near to the obstacle or floor",
                  clear.worst_obstacle_pair.c_str(), -100.0 * clear.obstacle_excess);
    return {text, -clear.obstacle_excess};
  }
  if (clear.self < 0.0) {
    return {"links collide: " + clear.worst_self_pair, -clear.self};
  }
  const ForceSolution forces = forces_.solve(attempt.data, attempt.carrying());
  peak_torque = forces.peak_torque;
  if (forces.status == Equilibrium::kTorque) {
    const Joint& joint = model_.joints[static_cast<std::size_t>(forces.peak_joint)];
    std::snprintf(text, sizeof text, "%s needs %.1f N m of %.1f", joint.name.c_str(),
                  forces.peak_torque, joint.torque_limit * settings_.forces.torque_share);
    return {text, kNominalShortfall};
  }
  if (forces.status == Equilibrium::kBalance) {
    return {"no contact forces balance the robot", kNominalShortfall};
  }
  return {};
}

std::vector<TouchPosture> TouchSampler::sample(const TouchRequest& request) {
  std::vector<TouchPosture> found;
  failure_ = {"no posture tried", std::numeric_limits<double>::infinity()};
  random_.seed(static_cast<std::mt19937::result_type>(settings_.search.seed));
  for (std::size_t start = 0; start < settings_.search.touch_samples &&
                              found.size() < settings_.search.most_touch_postures;
       ++start) {
    Attempt attempt;
    attempt.x = request.start;
    attempt.supports = request.supports;
    attempt.touches = request.touches;
    attempt.hint = hint_for(request, start);
    forward_kinematics(model_, attempt.x, attempt.data);
    attempt.contacts = request.supports;
    for (Contact& contact : attempt.supports) {
      contact.slip.setZero();
    }
    for (const Touch& touch : request.touches) {
      attempt.contacts.push_back(
          make_contact(model_, scenario_, attempt.data, touch.link, touch.surface));
      attempt.landing.push_back(touch.link);
    }
    if (request.supports.empty()) {
      attempt.x.q = attempt.hint;
      forward_kinematics(model_, attempt.x, attempt.data);
    } else if (start > 0) {
      relax(attempt);
    }
    settle_soles(attempt);
    reach(attempt, request.support_margin);
    TouchPosture posture;
    const Rejection rejection = judge(attempt, request.support_margin, posture.peak_torque);
    if (!rejection.why.empty()) {
      if (rejection.shortfall < failure_.shortfall) {
        failure_ = rejection;
      }
      continue;
    }
    posture.x = attempt.x;
    posture.touches = attempt.touches;
    for (Touch& touch : posture.touches) {
      touch.position = place(touch, touch_point(model_, attempt.data, touch.link));
    }
    posture.distance = (attempt.x.q - request.near).cwiseAbs().maxCoeff();
    found.push_back(std::move(posture));
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.cost() < b.cost(); });
  return found;
}

}  // namespace clamber
