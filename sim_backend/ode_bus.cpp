#include "sim_backend/ode_bus.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

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

OdeBus::OdeBus(OdeWorld& world, DriveErrors errors, double tick, const DrivesAlone& alone)
    : world_(world),
      errors_(std::move(errors)),
      tick_(tick > 0.0 ? tick : world.options().step),
      acting_(world.model().joints.size()),
      read_(world.model().joints.size()),
      noise_(errors_.seed),
      alone_(alone) {}

/// What the drives want to give now: by the host's commands, or by themselves.
JointVector OdeBus::torques() const {
  const JointVector q = world_.motor_position(), dq = world_.motor_rate();
  JointVector torque(joint_count());
  const double lost = silence_ - alone_.watchdog;
  const bool lowers = policy_ == FailurePolicy::kLower;
  const double share = lowers ? std::max(0.0, 1.0 - lost / alone_.lower_time) : 1.0;
  for (std::size_t i = 0; i < acting_.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    const Joint& joint = world_.model().joints[i];
    if (!on_their_own_)
      torque[j] = drive_law(acting_[i], q[j], dq[j]);
    else if (policy_ == FailurePolicy::kLimp)
      torque[j] = 0.0;
    else
      torque[j] = share * (rest_torque_[j] + joint.kp * (rest_q_[j] - q[j])) -
                  (lowers ? alone_.lower_damping : joint.kd) * dq[j];
  }
  return torque;
}

/// One step of the world under the commands that have arrived; `wanted`: the drives' torques.
void OdeBus::step(JointVector& wanted) {
  while (!pending_.empty() &&
         pending_.front().time <= world_.time() + 0.5 * world_.options().step) {
    acting_ = std::move(pending_.front().commands);
    pending_.pop_front();
  }
  const JointVector torque_of = torques();
  wanted = JointVector::Zero(joint_count());
  JointVector tau = wanted;
  for (std::size_t i = 0; i < acting_.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    const double torque = torque_of[j];
    read_[i].flags = kJointEnabled;
    if (std::isfinite(torque)) {
      wanted[j] = torque;
    } else {
      read_[i].flags |= kJointFault;
    }
    tau[j] = wanted[j] * (errors_.torque_factor.empty() ? 1.0 : errors_.torque_factor[i]);
  }
  world_.step(tau);
}

double OdeBus::reading(double exact) {
  if (errors_.encoder_noise > 0.0) {
    const double uniform = std::ldexp(static_cast<double>(noise_() >> 11), -53);
    exact += errors_.encoder_noise * (2.0 * uniform - 1.0);
  }
  const double count = errors_.encoder_resolution;
  return count > 0.0 ? count * std::round(exact / count) : exact;
}

void OdeBus::read(const JointVector& wanted, double elapsed) {
  const JointVector q = world_.motor_position(), dq = world_.motor_rate();
  for (std::size_t i = 0; i < read_.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    JointState& state = read_[i];
    const double before = state.q;
    state.q = reading(q[j]);
    const bool first = counters_.exchanges == 0;
    state.dq = errors_.encoder_is_exact() ? dq[j] : first ? 0.0 : (state.q - before) / elapsed;
    const double factor = errors_.torque_factor.empty() ? 1.0 : errors_.torque_factor[i];
    const double given = world_.drive_torque()[j];
    if (given != factor * wanted[j]) {
      state.flags |= kJointSaturated;
    }
    state.tau = given / factor;
    state.temperature = 25.0;  // ODE knows no heat: a drive at room temperature
    state.age = 0;
  }
}

/// The world by a tick. @return s that it has advanced
double OdeBus::advance(JointVector& wanted) {
  double elapsed = 0.0;
  for (owed_ += tick_; owed_ >= 0.5 * world_.options().step; owed_ -= world_.options().step) {
    step(wanted);
    elapsed += world_.options().step;
  }
  return elapsed;
}

void OdeBus::pass() {
  if (!enabled_) {
    return;
  }
  silence_ += tick_;
  if (!on_their_own_ && silence_ >= alone_.watchdog) {
    rest_q_ = world_.motor_position();
    rest_torque_ = world_.drive_torque();
    on_their_own_ = true;
  }
  JointVector wanted;
  static_cast<void>(advance(wanted));
}

BusStatus OdeBus::exchange(std::span<const JointCommand> commands, std::span<JointState> states,
                           std::int64_t /*deadline_ns*/) noexcept {
  const auto count = static_cast<std::size_t>(joint_count());
  if (!enabled_ || commands.size() != count || states.size() != count) {
    return BusStatus::kDown;
  }
  if (errors_.delay > 0.0) {
    pending_.push_back({world_.time() + errors_.delay, {commands.begin(), commands.end()}});
  } else {
    std::copy(commands.begin(), commands.end(), acting_.begin());
  }
  silence_ = 0.0;
  on_their_own_ = false;
  JointVector wanted;
  const double elapsed = advance(wanted);
  if (elapsed > 0.0) {
    read(wanted, elapsed);
  }
  ++counters_.exchanges;
  for (std::size_t i = 0; i < count; ++i) {
    states[i] = read_[i];
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
