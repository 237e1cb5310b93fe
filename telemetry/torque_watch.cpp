#include "telemetry/torque_watch.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

// A commanded torque is clipped to the limit exactly; what is measured may be off by this share.
constexpr double kSaturated = 0.999;

void keep_larger(double& kept, double torque) {
  if (std::abs(torque) > std::abs(kept)) kept = torque;
}

}  // namespace

double JointTorque::load(double torque) const noexcept {
  return limit && *limit > 0.0 ? std::abs(torque) / *limit : 0.0;
}

void TorqueWatch::describe(const TelemetryDescription& description) {
  description_ = description;
  name_joints();
}

void TorqueWatch::name_joints() {
  for (std::size_t j = 0; j < torques_.size(); ++j) {
    const bool known = j < description_.joint_names.size();
    torques_[j].name = known ? description_.joint_names[j] : "joint " + std::to_string(j);
    if (known) torques_[j].limit = description_.torque_limits[j];
  }
}

void TorqueWatch::add(const TelemetryFrame& frame) {
  const bool new_run = received_ > 0 && frame.sequence <= last_.sequence;
  if (new_run || frame.joint_count != torques_.size()) {
    torques_.assign(frame.joint_count, JointTorque{});
    name_joints();
  }
  if (new_run) received_ = lost_ = 0;
  if (received_ > 0) lost_ += frame.sequence - last_.sequence - 1;
  // A frame stands for the time since the one before, lost ones included.
  const double elapsed = received_ > 0 ? frame.time - last_.time : 0.0;
  ++received_;
  last_ = frame;
  for (std::size_t j = 0; j < torques_.size(); ++j) {
    torques_[j].now = frame.tau_meas[j];
    keep_larger(torques_[j].window, frame.tau_meas[j]);
    keep_larger(torques_[j].peak, frame.tau_meas[j]);
    const double limit = frame.tau_limit[j];
    const double torque = std::max(std::abs(frame.tau_meas[j]), std::abs(frame.tau_cmd[j]));
    if (limit > 0.0 && torque >= kSaturated * limit) torques_[j].saturated += elapsed;
  }
}

void TorqueWatch::start_window() {
  for (JointTorque& joint : torques_) joint.window = joint.now;
}

std::vector<JointTorque> TorqueWatch::worst_first() const {
  std::vector<JointTorque> sorted = torques_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const JointTorque& a, const JointTorque& b) {
    return a.load(a.window) > b.load(b.window);
  });
  return sorted;
}

const JointTorque& TorqueWatch::worst_of_run() const {
  return *std::max_element(
      torques_.begin(), torques_.end(),
      [](const JointTorque& a, const JointTorque& b) { return a.load(a.peak) < b.load(b.peak); });
}

}  // namespace clamber
