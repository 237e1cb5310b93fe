#include "planner_offline/certify/sinking.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "robot_model/kinematics.hpp"

namespace clamber {
namespace {

constexpr double kStep = 0.01;          // s
constexpr double kAfterwards = 1.5;     // s after the drives have let go
constexpr double kStiffness = 1e5;      // N/m, of a touching point
constexpr double kDamping = 1e3;        // N s/m
constexpr double kGrip = 1e5;           // N s/m: a point that sticks creeps by its force over this
constexpr double kStopStiffness = 5e3;  // N m/rad, of a joint's stop
constexpr double kStopDamping = 200.0;  // N m s/rad
constexpr double kFast = 1.0;           // m/s: what else happens does not matter any more
constexpr double kNear = 0.05;          // m: farther solids are not looked at

/// A part of a link that can touch: spheres and points, and capsules as a whole for edges.
struct Feeler {
  int body = 0;
  Geom shape;
  bool forbidden = false;
};

std::vector<Feeler> feelers_of(const RobotModel& model) {
  std::vector<Feeler> feelers;
  for (std::size_t g = 0; g < model.geoms.size(); ++g) {
    const Geom& geom = model.geoms[g];
    const bool forbidden = std::find(model.forbidden_geoms.begin(), model.forbidden_geoms.end(),
                                     static_cast<int>(g)) != model.forbidden_geoms.end();
    const auto add = [&](const Geom& shape) { feelers.push_back({geom.body, shape, forbidden}); };
    const auto add_sphere = [&](const Eigen::Vector3d& at, double radius) {
      Geom sphere = geom;
      sphere.shape = Shape::kSphere;
      sphere.X_BG.p = geom.X_BG * at;
      sphere.radius = radius;
      add(sphere);
    };
    if (geom.shape != Shape::kBox) add(geom);
    if (geom.shape == Shape::kCapsule)
      for (const double end : {-0.5, 0.5}) add_sphere({0.0, 0.0, end * geom.length}, geom.radius);
    if (geom.shape == Shape::kBox)
      for (int corner = 0; corner < 8; ++corner)
        add_sphere(
            Eigen::Vector3d((corner & 1) ? 1 : -1, (corner & 2) ? 1 : -1, (corner & 4) ? 1 : -1)
                .cwiseProduct(geom.half_extents),
            0.0);
  }
  return feelers;
}

class Descent {
 public:
  Descent(const RobotModel& model, const Scenario& scenario, const Configuration& x,
          const JointVector& tau, const DrivesAlone& drives)
      : model_(model),
        friction_(scenario.friction),
        drives_(drives),
        feelers_(feelers_of(model)),
        x_(x),
        q_rest_(x.q),
        tau_rest_(tau),
        v_(VelocityVector::Zero(model.velocity_count())) {
    for (const ObstacleBox& box : scenario.obstacles) {
      obstacles_.push_back(solid_of(box));
    }
  }

  Sinking run() {
    Sinking found{.body_above = std::numeric_limits<double>::infinity()};
    forward_kinematics(model_, x_, data_);
    const double height = data_.com.z();
    const double end = drives_.lower_time + kAfterwards;
    for (double t = 0.0; t < end && found.fastest < kFast; t += kStep) {
      const Eigen::Vector3d before = data_.com;
      step(std::max(0.0, 1.0 - t / drives_.lower_time));
      forward_kinematics(model_, x_, data_);
      found.last_speed = (data_.com - before).norm() / kStep;
      found.fastest = std::max(found.fastest, found.last_speed);
      found.body_above = std::min(found.body_above, body_above_);
    }
    found.depth = height - data_.com.z();
    return found;
  }

 private:
  /// A v' = b gives the rates after the step; torques and contact forces are taken at its end.
  void step(double share) {
    gravity_torque(model_, data_, g_);
    mass_matrix(model_, data_, A_);
    b_ = A_ * v_ - kStep * g_;
    body_above_ = std::numeric_limits<double>::infinity();
    add_joints(share);
    for (const Feeler& feeler : feelers_) add_contacts(feeler);
    v_ = A_.ldlt().solve(b_);
    Configuration next;
    integrate(model_, x_, kStep * v_, next);
    x_ = next;
  }

  void add_joints(double share) {
    for (std::size_t i = 0; i < model_.joints.size(); ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      const Joint& joint = model_.joints[i];
      const double kp = share * joint.kp;
      add_spring(6 + j, kp, drives_.lower_damping + joint.damping, q_rest_[j] - x_.q[j],
                 share * tau_rest_[j]);
      const double beyond =
          std::max(0.0, x_.q[j] - joint.upper) + std::min(0.0, x_.q[j] - joint.lower);
      if (beyond != 0.0) add_spring(6 + j, kStopStiffness, kStopDamping, -beyond, 0.0);
    }
  }

  /// Torque k (stretch - h v') - d v' + tau on coordinate i.
  void add_spring(Eigen::Index i, double k, double d, double stretch, double tau) {
    A_(i, i) += kStep * (d + kStep * k);
    b_[i] += kStep * (tau + k * stretch);
  }

  void add_contacts(const Feeler& feeler) {
    const Solid solid = place(feeler.shape, data_.X_WB[static_cast<std::size_t>(feeler.body)]);
    add_contact(feeler, distance_to_floor(solid, 0.0));
    for (const Solid& obstacle : obstacles_)
      if (distance_at_least(solid, obstacle) < kNear)
        add_contact(feeler, signed_distance(solid, obstacle));
  }

  void add_contact(const Feeler& feeler, const Distance& gap) {
    if (feeler.forbidden) body_above_ = std::min(body_above_, gap.value);
    if (gap.value >= 0.0) return;
    Jacobian3 J;
    point_jacobian(model_, data_, feeler.body, gap.on_a, J);
    const Eigen::Vector3d rate = J * v_;
    const double normal_rate = gap.normal.dot(rate);
    const double force = -kStiffness * gap.value - (kDamping + kStep * kStiffness) * normal_rate;
    if (force <= 0.0) return;
    const auto row = gap.normal.transpose() * J;
    A_ += kStep * (kDamping + kStep * kStiffness) * row.transpose() * row;
    b_ -= kStep * kStiffness * gap.value * row.transpose();
    // Sliding: as much grip as gives mu times the normal force at the rate it slides with.
    const Eigen::Vector3d slide = rate - normal_rate * gap.normal;
    const double grip = std::min(kGrip, friction_ * force / std::max(slide.norm(), 1e-9));
    const Jacobian3 along = J - gap.normal * row;
    A_ += kStep * grip * along.transpose() * along;
  }

  const RobotModel& model_;
  double friction_;
  DrivesAlone drives_;
  std::vector<Feeler> feelers_;
  std::vector<Solid> obstacles_;
  Configuration x_;
  JointVector q_rest_, tau_rest_;
  VelocityVector v_;
  RobotData data_;
  MassMatrix A_;
  VelocityVector b_, g_;
  double body_above_ = 0.0;
};

}  // namespace

Sinking foresee_sinking(const RobotModel& model, const Scenario& scenario, const Configuration& x,
                        const JointVector& tau, const DrivesAlone& drives) {
  return Descent(model, scenario, x, tau, drives).run();
}

}  // namespace clamber
