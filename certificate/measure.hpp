// Measures every quantity of a certificate at one sample, from model, plan and contact forces.
// One thread per Measure; allocates in the constructor only; blocks: never.
//
// Statics are summed body by body (no Jacobian, no program is solved): the forces are a witness,
// and to check a witness takes arithmetic only.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "certificate/body_motion.hpp"
#include "certificate/convex_distance.hpp"
#include "certificate/planned_motion.hpp"
#include "certificate/quantities.hpp"

namespace clamber {

/// What the certificate is to hold for.
struct Uncertainty {
  double friction_share = 0.625;  ///< of the scenario's coefficient: 0.5 of 0.8
  double mass_share = 0.05;       ///< of every link's mass, up or down
  double height = 0.01;           ///< m, of the obstacle, up or down
  double start_position = 0.02;   ///< m in any direction, of the mid-point between the soles
  double start_yaw = 0.035;       ///< rad about it, either way

  friend bool operator==(const Uncertainty&, const Uncertainty&) = default;
};

/// A sample's values, and by how much each may be worse between it and half way to its neighbours.
struct Measured {
  QuantityValues value;
  QuantityValues gap;
};

/// Forces on the touching points of a mask, in the order of its bits, N, world, on the robot.
using PointForces = std::span<const Eigen::Vector3d>;

/// Largest rate at which the forces change towards a neighbour of the sample, N/s, the points'
/// changes summed. `before` and `after` are the neighbours' forces, unused at a segment's ends.
[[nodiscard]] double force_rate(const SampleTime& sample, PointForces before, PointForces here,
                                PointForces after) noexcept;

class Measure {
 public:
  static constexpr double kFar = 0.1;  ///< m: distances are looked at up to here
  // Uncertainty is looked at up to here.
  static constexpr double kMostHeight = 0.03;  ///< m
  static constexpr double kMostStart = 2.0;    ///< of the start's uncertainty
  static constexpr double kMostMass = 0.5;     ///< of every mass

  Measure(const RobotModel& model, const Scenario& scenario, const PlannedMotion& motion,
          const Uncertainty& uncertainty);

  [[nodiscard]] const std::vector<TouchCandidate>& candidates() const { return candidates_; }
  [[nodiscard]] double friction() const { return friction_; }

  /// Goes to a sample: posture, kinematics, bounds. The rest refers to it.
  void place(const SampleTime& sample) noexcept;

  [[nodiscard]] const RobotData& data() const { return data_; }
  [[nodiscard]] const MotionState& state() const { return state_; }
  /// Where candidate i would touch: the sphere's bottom or the sole's corner, world, m.
  [[nodiscard]] Eigen::Vector3d touch_point(std::size_t i) const noexcept;
  /// Its height above the surface that its link rests on in this segment.
  [[nodiscard]] double height(std::size_t i) const noexcept;
  /// Candidates whose link rests on a surface in this segment.
  [[nodiscard]] TouchMask resting() const noexcept;
  /// What the joints supply at rest against weight and `forces`, and what remains of force and
  /// moment (about the centre of mass).
  void statics(TouchMask mask, PointForces forces, JointVector& tau, Eigen::Vector3d& force,
               Eigen::Vector3d& moment) const noexcept;

  /// `force_rates`: largest |change of force| per s towards either neighbour, all points summed.
  /// Samples must come in order: slip adds up from one to the next.
  [[nodiscard]] Measured measure(TouchMask mask, PointForces forces, double force_rates) noexcept;

 private:
  /// kNear: lies beside a contact of its body. kLanding: about to touch, or just came off.
  enum class Class : unsigned char { kIgnored, kNear, kLanding, kFree };
  struct GeomInfo {
    double reach = 0.0;  // m, farthest point from its body's origin
    int own_link = -1;   // contact link whose geom it is
    InflatedCore core;   // at the present sample
    double speed = 0.0;  // m/s, of its fastest point, at the present sample
  };
  struct Lost {  // least distance, and least distance less what may be lost to the neighbours
    double value = kFar, proven = kFar;
    void take(double distance, double loss);
  };

  [[nodiscard]] Class classify(std::size_t geom, int surface) const noexcept;
  [[nodiscard]] double travel(double speed, double acceleration) const noexcept;
  void measure_statics(TouchMask mask, PointForces forces, double force_rates,
                       Measured& out) noexcept;
  [[nodiscard]] double moment_curvature(TouchMask mask, PointForces forces,
                                        double force_rates) const noexcept;
  /// Velocity of the centre of mass and a bound on its acceleration.
  [[nodiscard]] std::pair<Eigen::Vector3d, double> com_motion() const noexcept;
  void measure_joints(Measured& out) const noexcept;
  void measure_support(TouchMask mask, Measured& out) const noexcept;
  void measure_pressure(TouchMask mask, PointForces forces, Measured& out) const noexcept;
  void measure_contacts(TouchMask mask, Measured& out) noexcept;
  void measure_surroundings(Measured& out) const noexcept;
  void measure_self(Measured& out) const noexcept;
  // What an uncertain world leaves (measure_uncertainty.cpp).
  void measure_height_and_start(TouchMask mask, Measured& out) const noexcept;
  void measure_tilt(Measured& out) const noexcept;
  [[nodiscard]] Eigen::Vector2d lever(const Eigen::Vector3d& p, const Eigen::Vector2d& extent,
                                      const InflatedCore& box) const noexcept;
  [[nodiscard]] Eigen::Vector2d displaced(double share,
                                          const Eigen::Vector2d& lever) const noexcept;
  [[nodiscard]] double place_held(const Eigen::Vector3d& p, double lost,
                                  int surface) const noexcept;
  // Single masses wrong (measure_masses.cpp).
  struct MassAnswer;
  void measure_masses(TouchMask mask, PointForces forces, Measured& out) const noexcept;
  [[nodiscard]] bool press_vertically(MassAnswer& answer) const noexcept;
  [[nodiscard]] bool change_least(PointForces forces, MassAnswer& answer) const noexcept;
  [[nodiscard]] double mass_held(TouchMask mask, const MassAnswer& answer) const noexcept;
  [[nodiscard]] Eigen::Vector2d zero_moment_point() const noexcept;
  [[nodiscard]] double edge_distance(const Eigen::Vector3d& p, int surface) const noexcept;

  const RobotModel& model_;
  const Scenario& scenario_;
  const PlannedMotion& motion_;
  Uncertainty uncertainty_;
  double friction_ = 0.0;
  double mass_ = 0.0;
  std::vector<TouchCandidate> candidates_;
  std::vector<GeomInfo> geoms_;
  std::vector<InflatedCore> obstacles_;
  std::vector<std::pair<int, int>> pairs_;

  SampleTime sample_;
  MotionState state_;
  RobotData data_;
  std::array<Twist, kMaxBodies> twists_{};
  std::array<BodyBounds, kMaxBodies> bounds_{};
  MotionBounds motion_bounds_;
  double h_ = 0.0;        // s, to the farther neighbour
  double fastest_ = 0.0;  // m/s, any point of any geom
  JointVector tau_, tau_ff_;

  // Slip, summed by trapezoids.
  TouchMask slipping_ = 0;
  std::array<Eigen::Vector3d, 64> slip_{};
  std::array<Eigen::Vector3d, 64> slip_rate_{};
};

}  // namespace clamber
