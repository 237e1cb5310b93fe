#include "bench/robustness/climb_watch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace clamber {
namespace {

constexpr double kSaturatedTime = 0.1;  // s
constexpr double kPlannedLoad = 15.0;   // N: a contact that the plan counts on
constexpr double kNoLoad = 1.0;         // N
constexpr double kExtraLoad = 20.0;     // N
constexpr double kPatience = 0.5;       // s
constexpr double kLoadFilter = 0.1;     // s
constexpr double kFar = 0.05;           // m
constexpr double kTilted = 0.14;        // rad

template <typename... Values>
std::string text(const char* format, Values... values) {
  std::array<char, 160> line{};
  std::snprintf(line.data(), line.size(), format, values...);
  return line.data();
}

}  // namespace

ClimbWatch::ClimbWatch(const RobotModel& model, const Scenario& scenario, const Plan& plan,
                       const Perturbation& perturbation)
    : model_(model), plan_(plan), saturated_(model.joints.size()), links_(model.contacts.size()) {
  Configuration origin;
  origin.q = JointVector::Zero(model.joint_count());
  offset_ = perturbed(origin, scenario, perturbation).X_WB;
  for (const Keyframe& keyframe : plan.keyframes) {
    std::vector<double>& forces = force_.emplace_back(model.contacts.size(), -1.0);
    for (const PlannedContact& contact : keyframe.contacts)
      if (const auto link = model.find_contact(contact.link))
        forces[static_cast<std::size_t>(*link)] = contact.force.norm();
  }
}

void ClimbWatch::note(const TelemetryFrame& frame, std::string what) {
  events_.push_back({frame.plan_time, plan_.phases.at(frame.phase).name, std::move(what)});
}

void ClimbWatch::observe(const OdeWorld& /*world*/, const TelemetryFrame& frame) {
  if (frame.plan_time <= 0.0) return;
  while (at_ + 2 < plan_.keyframes.size() && plan_.keyframes[at_ + 1].time <= frame.plan_time)
    ++at_;
  watch_torques(frame);
  watch_links(frame);
  watch_base(frame);
  last_time_ = frame.time;
}

void ClimbWatch::watch_torques(const TelemetryFrame& frame) {
  const double dt = frame.time - last_time_;
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    const bool full = std::abs(frame.tau_cmd[j]) >= model_.joints[j].torque_limit - 1e-6;
    const double before = saturated_[j];
    saturated_[j] = full ? before + dt : before >= kSaturatedTime ? before : 0.0;
    if (before < kSaturatedTime && saturated_[j] >= kSaturatedTime)
      note(frame, model_.joints[j].name + " at its torque limit");
  }
}

double ClimbWatch::planned_force(std::size_t link) const {
  return std::max(0.0, std::min(force_[at_][link], force_[at_ + 1][link]));
}

bool ClimbWatch::planned_near(std::size_t link, double time) const {
  for (std::size_t k = 0; k < force_.size(); ++k)
    if (std::abs(plan_.keyframes[k].time - time) <= 2.0 * kPatience && force_[k][link] >= 0.0)
      return true;
  return false;
}

void ClimbWatch::watch_links(const TelemetryFrame& frame) {
  const double dt = frame.time - last_time_;
  const double share = std::min(1.0, dt / kLoadFilter);
  for (std::size_t c = 0; c < links_.size(); ++c) {
    LinkWatch& link = links_[c];
    const std::string& name = model_.contacts[c].name;
    link.load += share * (frame.force_obstacle[c] + frame.force_floor[c] - link.load);
    const double planned = planned_force(c);
    link.was_loaded = planned > 0.0 && (link.was_loaded || link.load > 5.0);
    link.idle = planned >= kPlannedLoad && link.load < kNoLoad ? link.idle + dt : 0.0;
    if (link.idle > kPatience && !link.idle_noted) {
      link.idle_noted = true;
      note(frame, name + (link.was_loaded ? " lost its contact" : " never loaded") +
                      text(" (planned %.0f N)", planned));
    }
    const bool extra = link.load > kExtraLoad && !planned_near(c, frame.plan_time);
    link.extra = extra ? link.extra + dt : 0.0;
    if (link.extra > 0.0 && !link.extra_noted) {
      link.extra_noted = true;
      note(frame, name + " hits the " + (frame.force_obstacle[c] > 0.0 ? "obstacle" : "floor") +
                      text(" (%.0f N)", link.load));
    }
  }
  if (frame.force_forbidden > 1.0 && !forbidden_noted_) {
    forbidden_noted_ = true;
    note(frame, text("torso or pelvis carries %.0f N", frame.force_forbidden));
  }
  if (frame.force_other > kExtraLoad && !other_noted_) {
    other_noted_ = true;
    note(frame, text("another link carries %.0f N", frame.force_other));
  }
}

void ClimbWatch::watch_base(const TelemetryFrame& frame) {
  const Keyframe& a = plan_.keyframes[at_];
  const Keyframe& b = plan_.keyframes[at_ + 1];
  const double s = std::clamp((frame.plan_time - a.time) / (b.time - a.time), 0.0, 1.0);
  const Eigen::Vector3d planned = offset_ * ((1.0 - s) * a.x.X_WB.p + s * b.x.X_WB.p);
  const Eigen::Quaterniond turn = Eigen::Quaterniond(offset_.R * a.x.X_WB.R)
                                      .slerp(s, Eigen::Quaterniond(offset_.R * b.x.X_WB.R));
  const auto& q = frame.base_orientation;
  const double tilt = turn.angularDistance(Eigen::Quaterniond(q[0], q[1], q[2], q[3]));
  const Eigen::Vector3d away(frame.base_position[0] - planned.x(),
                             frame.base_position[1] - planned.y(),
                             frame.base_position[2] - planned.z());
  farthest_ = std::max(farthest_, away.norm());
  most_tilted_ = std::max(most_tilted_, tilt);
  if ((away.norm() > kFar || tilt > kTilted) && !far_noted_) {
    far_noted_ = true;
    note(frame, text("the base is off by %.0f %.0f %.0f mm, %.1f deg", 1e3 * away.x(),
                     1e3 * away.y(), 1e3 * away.z(), tilt * 180.0 / M_PI));
  }
}

}  // namespace clamber
