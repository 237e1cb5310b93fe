// What crosses the motor bus, per joint. Real-time safe: plain data.
#pragma once

#include <cstdint>

namespace clamber {

/// Drive law: tau_motor = tau + kp (q - q_measured) + kd (dq - dq_measured), saturated by the
/// drive. Host PID is the default: kp = kd = 0 and tau carries the PID's output.
struct JointCommand {
  double q = 0.0;    ///< rad
  double dq = 0.0;   ///< rad/s
  double kp = 0.0;   ///< N m/rad
  double kd = 0.0;   ///< N m s/rad
  double tau = 0.0;  ///< N m
};

enum JointFlags : std::uint32_t {
  kJointEnabled = 1u << 0,
  kJointSaturated = 1u << 1,  ///< the drive clipped the torque
  kJointFault = 1u << 2,
  kJointStale = 1u << 3,  ///< no fresh reply this tick
};

struct JointState {
  double q = 0.0;              ///< rad
  double dq = 0.0;             ///< rad/s
  double tau = 0.0;            ///< N m, measured
  double temperature = 0.0;    ///< degree Celsius
  std::uint32_t flags = 0;     ///< JointFlags
  std::uint32_t age = 0;       ///< ticks since the reply it comes from
  std::uint64_t sequence = 0;  ///< counts replies
};

}  // namespace clamber
