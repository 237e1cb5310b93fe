// One controller tick as fixed-size plain data: what the ring carries, the run log stores and DDS
// sends. Any thread; allocates: never; blocks: never.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

#include "robot_model/types.hpp"

namespace clamber {

inline constexpr int kMaxContacts = 16;

/// Per-joint arrays are in the robot model's joint order, contact arrays in its contact order;
/// unused entries are zero. Holds nothing that depends on the wall clock, so that two runs of the
/// same plan in simulation give the same bytes.
struct TelemetryFrame {
  std::uint64_t sequence = 0;  ///< tick number
  double time = 0.0;           ///< s since the first tick
  double plan_time = 0.0;      ///< s on the plan's clock
  std::uint32_t joint_count = 0;
  std::uint32_t contact_count = 0;
  std::uint32_t phase = 0;  ///< index of the plan's phase (a phase: constant contact set)
  std::uint32_t flags = 0;  ///< bit 0: simulation truth below is valid
  std::uint32_t mode = 0;   ///< the supervisor's Mode
  std::uint32_t fault = 0;  ///< its FaultCode
  std::uint32_t fault_joint = kMaxJoints;     ///< where the fault was seen; kMaxJoints: at no joint
  std::uint32_t joint_faults = 0;             ///< one bit per joint whose drive reports a fault
  std::array<double, kMaxJoints> q_ref{};     ///< rad
  std::array<double, kMaxJoints> q{};         ///< rad
  std::array<double, kMaxJoints> dq{};        ///< rad/s
  std::array<double, kMaxJoints> tau_ff{};    ///< N m, feed-forward
  std::array<double, kMaxJoints> tau_cmd{};   ///< N m, commanded
  std::array<double, kMaxJoints> tau_meas{};  ///< N m, measured
  std::array<double, kMaxJoints> tau_limit{};    ///< N m, magnitude that the controller keeps to
  std::array<double, kMaxJoints> temperature{};  ///< degree Celsius; 0 where no drive says it
  std::array<double, kMaxJoints> age{};  ///< ticks since the reply that q, dq and tau_meas are of
  // Simulation truth (flags bit 0).
  std::array<double, 3> base_position{};     ///< m
  std::array<double, 4> base_orientation{};  ///< w x y z
  std::array<double, kMaxContacts>
      force_obstacle{};  ///< N, normal force of each contact link on obstacles
  std::array<double, kMaxContacts> force_floor{};  ///< N, on the floor
  double force_forbidden = 0.0;                    ///< N, carried by torso and pelvis
  double force_other = 0.0;  ///< N, carried by links that are neither contact links nor forbidden
};
static_assert(std::is_trivially_copyable_v<TelemetryFrame>);
// The run log stores frames as they are: a gap would hold whatever was there before.
static_assert(sizeof(TelemetryFrame) == 56 + 8 * (9 * kMaxJoints + 3 + 4 + 2 * kMaxContacts + 2));

inline constexpr std::uint32_t kFrameHasTruth = 1u << 0;

}  // namespace clamber
