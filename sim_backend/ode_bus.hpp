// The motor bus onto the simulated robot: drives, joint sensors and the truth behind them.
// One thread at a time (as OdeWorld); allocates: ODE does in every exchange, so a run on this bus
// proves nothing about the heap; blocks: never, whatever the deadline.
#pragma once

#include <cstdint>
#include <deque>
#include <random>
#include <vector>

#include "firmware_hal/motor_bus.hpp"
#include "sim_backend/ode_world.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

/// What real drives and encoders add. The default is none of it.
struct DriveErrors {
  std::vector<double> torque_factor;  ///< per joint, actual over believed; empty: 1
  /// s from a command to its effect, in whole steps of the world: bus, drive and sensor together.
  double delay = 0.0;
  double encoder_resolution = 0.0;  ///< rad per count
  double encoder_noise = 0.0;       ///< rad, uniform within +-
  std::uint64_t seed = 0;           ///< of the noise

  /// The encoder gives positions only: rates are differences of its readings.
  [[nodiscard]] bool encoder_is_exact() const {
    return encoder_resolution == 0.0 && encoder_noise == 0.0;
  }
};

/// One exchange takes one `tick`, in this order:
///   1. every drive forms its torque from the command and the state it has now (drive law of
///      JointCommand) and saturates it;
///   2. the world advances, by as many of its steps as reach the tick's end: with half a tick a
///      step these are two, with two ticks a step one at every other tick;
///   3. the states are read back: position and rate after the step, torque as the drive gave it.
/// So a command acts without delay and the controller sees a state that is one step younger.
/// Encoders are on the motors' side of springs, as a drive's own is; the torque is what the drive
/// believes to give.
class OdeBus final : public MotorBus {
 public:
  /// The world must outlive the bus.
  /// @param tick s; 0: the world's step
  explicit OdeBus(OdeWorld& world, DriveErrors errors = {}, double tick = 0.0,
                  const DrivesAlone& alone = {});

  [[nodiscard]] int joint_count() const noexcept override;
  [[nodiscard]] BusStatus enable() override;
  /// kDown when the drives are off or a span has not one entry per joint; the world then stands
  /// still. A command that is not finite counts as zero torque and sets kJointFault.
  [[nodiscard]] BusStatus exchange(std::span<const JointCommand> commands,
                                   std::span<JointState> states,
                                   std::int64_t deadline_ns) noexcept override;
  /// A tick in which no exchange comes: the world goes on with the drives alone.
  void pass();
  [[nodiscard]] bool set_failure_policy(FailurePolicy policy) noexcept override {
    policy_ = policy;
    return true;
  }
  void disable() noexcept override { enabled_ = false; }
  [[nodiscard]] BusCounters counters() const noexcept override { return counters_; }

 private:
  struct Delayed {
    double time = 0.0;  ///< s, of its effect
    std::vector<JointCommand> commands;
  };

  void step(JointVector& wanted);
  [[nodiscard]] double advance(JointVector& wanted);
  [[nodiscard]] JointVector torques() const;
  [[nodiscard]] double reading(double exact);
  void read(const JointVector& wanted, double elapsed);

  OdeWorld& world_;
  DriveErrors errors_;
  double tick_;
  bool enabled_ = false;
  BusCounters counters_;
  double owed_ = 0.0;  ///< s that the world is behind the bus
  std::vector<JointCommand> acting_;
  std::vector<JointState> read_;
  std::deque<Delayed> pending_;
  std::mt19937_64 noise_;
  DrivesAlone alone_;
  FailurePolicy policy_ = FailurePolicy::kLimp;
  double silence_ = 0.0;  ///< s since the last exchange
  bool on_their_own_ = false;
  JointVector rest_q_, rest_torque_;  ///< rad and N m, when the watchdogs ran out
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
