// The motion that a plan file makes the controller run, read and interpolated on its own.
// Start-up and tools only: reading allocates and throws InputError; evaluate() allocates never.
//
// Shares nothing with planner_offline: the verifier must not trust the planner's reader. Joints
// follow the controller's own spline (control/spline.hpp) through the keyframes, bit for bit. The
// base is not commanded: where it is follows from the contacts. Here it follows the same kind of
// spline through the keyframes' base poses (position, and the quaternion's four numbers, then
// normalised). Both splines interpolate one smooth posture path, so between keyframes joints and
// base agree up to fourth order in the keyframe distance; what is left shows as contact height
// error and slip, which the certificate measures and bounds.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "control/failure_policy.hpp"
#include "control/spline.hpp"
#include "robot_model/model.hpp"
#include "sim_backend/scenario.hpp"

namespace clamber {

inline constexpr int kNoSurface = -2;
inline constexpr int kFloorSurface = -1;  ///< else an index into Scenario::obstacles
inline constexpr std::size_t kMaxContactLinks = 16;

/// A point of a contact link that can touch: a sphere's centre or a sole's corner.
struct TouchCandidate {
  int link = 0;  ///< index into RobotModel::contacts
  int body = 0;
  Eigen::Vector3d p_B = Eigen::Vector3d::Zero();  ///< m, body frame
  double radius = 0.0;                            ///< m, the surface lies this far below
  bool of_patch = false;
};

/// Set of touch candidates: bit i is candidate i.
using TouchMask = std::uint64_t;

/// Every contact link's points in the model's order. @throws InputError for more than 64 points
[[nodiscard]] std::vector<TouchCandidate> touch_candidates(const RobotModel& model);

struct MotionKnot {
  double time = 0.0;  ///< s
  int phase = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();     ///< of the base, m
  Eigen::Vector4d orientation = Eigen::Vector4d::Zero();  ///< w x y z, sign continuous
  JointVector q;                                          ///< rad
  JointVector tau;                                        ///< feed-forward, N m
  std::array<int, kMaxContactLinks> surface{};            ///< per contact link
  std::array<Eigen::Vector3d, kMaxContactLinks> force{};  ///< N, world, as the plan says
};

/// Between two keyframes. The later one's contacts hold: a stretch of the plan begins with the
/// last keyframe of the stretch before it.
struct MotionSegment {
  double start = 0.0, end = 0.0;  ///< s
  int phase = 0;
  std::array<int, kMaxContactLinks> surface{};   ///< what each contact link rests on
  std::array<int, kMaxContactLinks> approach{};  ///< what it is on its way to, or just came off
};

/// Posture and its first two derivatives; velocity layout as VelocityVector.
struct MotionState {
  Configuration x;
  VelocityVector v;
  VelocityVector a;
};

/// Upper bounds over a stretch of time inside one segment.
struct MotionBounds {
  double speed = 0.0, acceleration = 0.0;                   ///< of the base's origin, m/s, m/s^2
  double turn_rate = 0.0, turn_acceleration = 0.0;          ///< of the base, rad/s, rad/s^2
  std::array<double, kMaxJoints> rate{}, acceleration_q{};  ///< per joint, rad/s, rad/s^2
};

class PlannedMotion {
 public:
  /// Reads a plan's text; `file` names it in messages.
  /// @throws InputError for anything that is not a plan for this robot and scenario's obstacles
  PlannedMotion(std::string_view text, const std::string& file, const RobotModel& model,
                const Scenario& scenario);
  PlannedMotion(const PlannedMotion&) = delete;
  PlannedMotion& operator=(const PlannedMotion&) = delete;

  // What the plan says of itself.
  std::string sha256;
  std::string robot_hash;
  std::string scenario_hash;
  std::string tool_version;
  double friction = 0.0;
  double ballast_mass = 0.0;  ///< kg
  std::vector<std::string> phases;
  std::vector<FailurePolicy> failure_policies;  ///< of the phases
  std::vector<MotionKnot> knots;
  std::vector<MotionSegment> segments;  ///< knots - 1

  [[nodiscard]] double duration() const { return knots.back().time; }
  /// State at time t of `segment` (its ends included).
  void evaluate(double t, std::size_t segment, MotionState& state) const noexcept;
  /// Feed-forward torque at time t, as the controller interpolates it.
  void feed_forward(double t, std::size_t segment, JointVector& tau) const noexcept;
  /// Bounds that hold from t0 to t1, both in `segment`; rigorous, not sampled.
  [[nodiscard]] MotionBounds bounds(double t0, double t1, std::size_t segment) const noexcept;

 private:
  struct Knots {
    const std::vector<MotionKnot>* knots = nullptr;
    [[nodiscard]] std::size_t size() const noexcept { return knots->size(); }
    [[nodiscard]] std::size_t dimensions() const noexcept {
      return 7 + static_cast<std::size_t>(knots->front().q.size());
    }
    [[nodiscard]] double time(std::size_t i) const noexcept { return (*knots)[i].time; }
    [[nodiscard]] double value(std::size_t i, std::size_t d) const noexcept {
      const MotionKnot& k = (*knots)[i];
      const auto at = static_cast<Eigen::Index>(d);
      return d < 3 ? k.position[at] : d < 7 ? k.orientation[at - 3] : k.q[at - 7];
    }
  };

  void find_segments(std::size_t links);

  ClampedSpline<Knots> spline_;
  std::vector<double> workspace_;
};

/// A moment that the certificate looks at. Every segment has its own first and last one, so a
/// keyframe is looked at twice, with the contacts before and after it.
struct SampleTime {
  double time = 0.0;  ///< s
  std::size_t segment = 0;
  double before = 0.0, after = 0.0;  ///< s to the neighbours in the segment, 0 at its ends
};

/// Evenly spaced in every segment, at most `spacing` (s) apart.
[[nodiscard]] std::vector<SampleTime> sample_times(const PlannedMotion& motion, double spacing);

}  // namespace clamber
