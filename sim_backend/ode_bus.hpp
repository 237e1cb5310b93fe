// The motor bus onto the simulated robot: drives, joint sensors and the truth behind them.
// One thread at a time (as OdeWorld); allocates: ODE does in every exchange, so a run on this bus
// proves nothing about the heap; blocks: never, whatever the deadline.
#pragma once

#include "firmware_hal/motor_bus.hpp"
#include "sim_backend/ode_world.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

/// One exchange is one step of the world, in this order:
///   1. every drive forms its torque from the new command and the state it has now (drive law of
///      JointCommand) and saturates it;
///   2. the world advances by OdeOptions::step;
///   3. the states are read back: position and rate after the step, torque as the drive gave it.
/// So a command acts without delay and the controller sees a state that is one step younger.
class OdeBus final : public MotorBus {
 public:
  /// The world must outlive the bus.
  explicit OdeBus(OdeWorld& world) : world_(world) {}

  [[nodiscard]] int joint_count() const noexcept override;
  [[nodiscard]] BusStatus enable() override;
  /// kDown when the drives are off or a span has not one entry per joint; the world then stands
  /// still. A command that is not finite counts as zero torque and sets kJointFault.
  [[nodiscard]] BusStatus exchange(std::span<const JointCommand> commands,
                                   std::span<JointState> states,
                                   std::int64_t deadline_ns) noexcept override;
  void disable() noexcept override { enabled_ = false; }
  [[nodiscard]] BusCounters counters() const noexcept override { return counters_; }

 private:
  OdeWorld& world_;
  bool enabled_ = false;
  BusCounters counters_;
};

/// Fills the simulation-truth part of the frame (base pose, forces; flag kFrameHasTruth) with the
/// world's last step.
/// A contact link is credited with the contacts of its own geom and of the other geoms on its body
/// (of several contact links on one body: the nearest); self-contacts count nowhere.
void read_truth(const OdeWorld& world, TelemetryFrame& frame);

/// The contact link that a contact is credited to, as above; -1: none. Index into
/// RobotModel::contacts. Does not allocate.
[[nodiscard]] int contact_link_of(const RobotModel& model, const Configuration& x, int geom,
                                  const Eigen::Vector3d& p_W);

}  // namespace clamber
