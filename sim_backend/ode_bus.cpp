#include "sim_backend/ode_bus.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace clamber {
namespace {

bool is_forbidden(const RobotModel& model, int geom) {
  return std::find(model.forbidden_geoms.begin(), model.forbidden_geoms.end(), geom) !=
         model.forbidden_geoms.end();
}

double drive_law(const JointCommand& command, double q, double dq) {
  return command.tau + command.kp * (command.q - q) + command.kd * (command.dq - dq);
}

/// Pose of a body from the base and the joints on the way to it.
Pose body_pose(const RobotModel& model, const Configuration& x, int body) {
  Pose X_AB;  // from an ancestor A of the body
  for (int b = body; b != 0;) {
    const Body& link = model.bodies[static_cast<std::size_t>(b)];
    Pose X_JB;
    X_JB.R = Eigen::AngleAxisd(x.q[b - 1], link.axis).toRotationMatrix();
    X_AB = link.X_PJ * X_JB * X_AB;
    b = link.parent;
  }
  return x.X_WB * X_AB;
}

}  // namespace

int contact_link_of(const RobotModel& model, const Configuration& x, int geom,
                    const Eigen::Vector3d& p_W) {
  const int body = model.geoms[static_cast<std::size_t>(geom)].body;
  int nearest = -1;
  double nearest_distance = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < model.contacts.size(); ++c) {
    const ContactLink& link = model.contacts[c];
    if (link.geom == geom) {
      return static_cast<int>(c);
    }
    if (link.body != body) {
      continue;
    }
    const Pose X_WB = body_pose(model, x, body);
    for (const Eigen::Vector3d& point : link.points) {
      const double distance = (X_WB * point - p_W).norm();
      if (distance < nearest_distance) {
        nearest_distance = distance;
        nearest = static_cast<int>(c);
      }
    }
  }
  return nearest;
}

int OdeBus::joint_count() const noexcept { return world_.model().joint_count(); }

BusStatus OdeBus::enable() {
  enabled_ = true;
  return BusStatus::kOk;
}

BusStatus OdeBus::exchange(std::span<const JointCommand> commands, std::span<JointState> states,
                           std::int64_t /*deadline_ns*/) noexcept {
  const auto count = static_cast<std::size_t>(joint_count());
  if (!enabled_ || commands.size() != count || states.size() != count) {
    return BusStatus::kDown;
  }
  JointVector tau = JointVector::Zero(joint_count());
  for (std::size_t i = 0; i < count; ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    const double torque =
        drive_law(commands[i], world_.configuration().q[j], world_.velocity()[6 + j]);
    states[i].flags = kJointEnabled;
    if (std::isfinite(torque)) {
      tau[j] = torque;
    } else {
      states[i].flags |= kJointFault;
    }
  }
  world_.step(tau);
  ++counters_.exchanges;
  for (std::size_t i = 0; i < count; ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    states[i].q = world_.configuration().q[j];
    states[i].dq = world_.velocity()[6 + j];
    states[i].tau = world_.drive_torque()[j];
    if (states[i].tau != tau[j]) {
      states[i].flags |= kJointSaturated;
    }
    states[i].temperature = 25.0;  // ODE knows no heat: a drive at room temperature
    states[i].age = 0;
    states[i].sequence = counters_.exchanges;
  }
  return BusStatus::kOk;
}

void read_truth(const OdeWorld& world, TelemetryFrame& frame) {
  const RobotModel& model = world.model();
  const Configuration& x = world.configuration();
  frame.flags |= kFrameHasTruth;
  const Eigen::Quaterniond orientation(x.X_WB.R);
  frame.base_position = {x.X_WB.p.x(), x.X_WB.p.y(), x.X_WB.p.z()};
  frame.base_orientation = {orientation.w(), orientation.x(), orientation.y(), orientation.z()};
  frame.contact_count =
      static_cast<std::uint32_t>(std::min<std::size_t>(model.contacts.size(), kMaxContacts));
  frame.force_obstacle.fill(0.0);
  frame.force_floor.fill(0.0);
  frame.force_forbidden = 0.0;
  frame.force_other = 0.0;
  for (const ContactObservation& contact : world.contacts()) {
    if (contact.surface == Surface::kRobot) {
      continue;
    }
    const double force = contact.normal_force();
    if (is_forbidden(model, contact.geom)) {
      frame.force_forbidden += force;
      continue;
    }
    const int link = contact_link_of(model, x, contact.geom, contact.position);
    if (link < 0 || link >= kMaxContacts) {
      frame.force_other += force;
      continue;
    }
    auto& forces = contact.surface == Surface::kFloor ? frame.force_floor : frame.force_obstacle;
    forces[static_cast<std::size_t>(link)] += force;
  }
}

}  // namespace clamber
