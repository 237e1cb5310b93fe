#include "control/pid.hpp"

#include <algorithm>

namespace clamber {

void JointPid::configure(const PidGains& gains, const PidLimits& limits, double dt,
                         double derivative_filter, double transfer_time) noexcept {
  *this = JointPid();
  gains_ = gains;
  limits_ = limits;
  dt_ = dt;
  filter_share_ = dt / (dt + derivative_filter);
  transfer_decay_ = transfer_time / (dt + transfer_time);
}

void JointPid::activate(double dq, double applied) noexcept {
  rate_ = dq;
  integral_ = 0.0;
  output_ = std::clamp(applied, -limits_.torque, limits_.torque);
  rebase_ = true;
}

void JointPid::set_gains(const PidGains& gains) noexcept {
  gains_ = gains;
  rebase_ = true;
}

double JointPid::update(double q_ref, double q, double dq, double tau_ff) noexcept {
  const double error = q_ref - q;
  rate_ += filter_share_ * (dq - rate_);
  const double pd = gains_.kp * error - gains_.kd * rate_ + tau_ff;
  const double step = gains_.ki * error * dt_;
  const double pid = pd + integral_ + step;
  if (rebase_) transfer_ = output_ - pid;
  rebase_ = false;
  const double wanted = pid + transfer_;
  const double low = std::max(-limits_.torque, output_ - limits_.torque_rate * dt_);
  const double high = std::min(limits_.torque, output_ + limits_.torque_rate * dt_);
  output_ = std::clamp(wanted, low, high);
  const bool winds_up = (wanted > high && error > 0.0) || (wanted < low && error < 0.0);
  if (!winds_up) integral_ = std::clamp(integral_ + step, -limits_.torque, limits_.torque);
  const double steady = tau_ff + integral_ + transfer_;
  steady_ = std::clamp(steady, -limits_.torque, limits_.torque);
  resting_ = std::clamp(steady + gains_.kp * error, -limits_.torque, limits_.torque);
  transfer_ *= transfer_decay_;
  return output_;
}

}  // namespace clamber
