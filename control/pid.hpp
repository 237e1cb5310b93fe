// Position PID of one joint with feed-forward torque.
// Control thread only; allocates: never; blocks: never; throws: never.
#pragma once

#include <cstdint>

namespace clamber {

enum class FeedForward : std::uint8_t {
  kNone,  ///< PID alone, as in the paper
  kPlan,  ///< the plan's torques are added
};

struct PidGains {
  double kp = 0.0;  ///< N m/rad
  double ki = 0.0;  ///< N m/(rad s)
  double kd = 0.0;  ///< N m s/rad
};

struct PidLimits {
  double torque = 0.0;       ///< N m
  double torque_rate = 0.0;  ///< N m/s
};

/// tau = kp e + integral(ki e) - kd dq_filtered + tau_ff, limited in size and in rate.
///
/// The derivative acts on the measurement, so a step of the reference gives no kick. The integral
/// stands still while the output is limited and the error would push it further into the limit.
/// After activate(), set_gains() or rebase() the output goes on from where it was: the difference
/// is kept in a transfer torque that decays, which also works where ki = 0.
class JointPid {
 public:
  /// @param dt tick, s
  /// @param derivative_filter time constant of the rate's first-order filter, s
  /// @param transfer_time time constant with which a transfer torque decays, s
  void configure(const PidGains& gains, const PidLimits& limits, double dt,
                 double derivative_filter, double transfer_time) noexcept;

  /// Starts from rest in the integral, the joint at rate dq (rad/s) under the torque `applied` (N
  /// m).
  void activate(double dq, double applied) noexcept;
  void set_gains(const PidGains& gains) noexcept;
  /// Announces a step in the reference or the feed-forward that the output shall not follow at
  /// once.
  void rebase() noexcept { rebase_ = true; }

  /// One tick: reference and measurement in rad and rad/s, feed-forward in N m, all finite.
  /// @returns the torque to command, N m
  [[nodiscard]] double update(double q_ref, double q, double dq, double tau_ff) noexcept;

  /// The integral's torque goes over into the transfer torque.
  void clear_integral() noexcept {
    integral_ = 0.0;
    rebase_ = true;
  }

  [[nodiscard]] double output() const noexcept { return output_; }
  /// The last output without its answer to the rate, within the torque limit: what keeps the joint
  /// where it was.
  [[nodiscard]] double resting() const noexcept { return resting_; }
  /// What of the last output came neither from the error nor from the rate, within the torque
  /// limit.
  [[nodiscard]] double steady() const noexcept { return steady_; }
  [[nodiscard]] double integral() const noexcept { return integral_; }

 private:
  PidGains gains_;
  PidLimits limits_;
  double dt_ = 0.0;
  double filter_share_ = 1.0;    ///< of the new sample in the filtered rate
  double transfer_decay_ = 0.0;  ///< per tick
  double rate_ = 0.0;            ///< filtered, rad/s
  double integral_ = 0.0;        ///< N m
  double transfer_ = 0.0;        ///< N m
  double output_ = 0.0;          ///< N m
  double steady_ = 0.0;          ///< N m
  double resting_ = 0.0;         ///< N m
  bool rebase_ = false;
};

}  // namespace clamber
