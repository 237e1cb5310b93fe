#include "robot_model/kinematics.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

Eigen::Matrix3d skew(const Eigen::Vector3d& v) noexcept {
  Eigen::Matrix3d S;
  S << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return S;
}

/// Mass, first moment and rotational inertia about one common point, world axes.
struct PointInertia {
  double mass = 0.0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();

  void add(const PointInertia& other) noexcept {
    mass += other.mass;
    moment += other.moment;
    inertia += other.inertia;
  }
};

PointInertia body_inertia_about(const Body& body, const Pose& X_WB, const Eigen::Vector3d& com_W,
                                const Eigen::Vector3d& origin) noexcept {
  const Eigen::Vector3d c = com_W - origin;
  PointInertia I;
  I.mass = body.mass;
  I.moment = body.mass * c;
  const Eigen::Matrix3d S = skew(c);
  I.inertia.noalias() = X_WB.R * body.inertia * X_WB.R.transpose() - body.mass * S * S;
  return I;
}

}  // namespace

Eigen::Matrix3d rotation_exp(const Eigen::Vector3d& w) noexcept {
  const double angle = w.norm();
  const Eigen::Matrix3d S = skew(w);
  if (angle < 1e-8) {
    return Eigen::Matrix3d::Identity() + S + 0.5 * S * S;
  }
  return Eigen::Matrix3d::Identity() + std::sin(angle) / angle * S +
         (1.0 - std::cos(angle)) / (angle * angle) * S * S;
}

Eigen::Vector3d rotation_log(const Eigen::Matrix3d& R) noexcept {
  // Through the quaternion: well conditioned at both ends of [0, pi].
  Eigen::Quaterniond quat(R);
  if (quat.w() < 0.0) {
    quat.coeffs() = -quat.coeffs();
  }
  const double sine = quat.vec().norm();
  if (sine < 1e-12) {
    return 2.0 * quat.vec();
  }
  return 2.0 * std::atan2(sine, quat.w()) / sine * quat.vec();
}

void forward_kinematics(const RobotModel& model, const Configuration& x, RobotData& data) noexcept {
  data.com.setZero();
  double mass = 0.0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    Pose& X = data.X_WB[b];
    if (body.parent < 0) {
      X = x.X_WB;
      data.axis_W[b].setZero();
    } else {
      const Pose& X_WP = data.X_WB[static_cast<std::size_t>(body.parent)];
      const Eigen::Matrix3d R_WJ = X_WP.R * body.X_PJ.R;
      X.p = X_WP * body.X_PJ.p;
      X.R.noalias() = R_WJ * rotation_exp(body.axis * x.q[static_cast<Eigen::Index>(b) - 1]);
      data.axis_W[b].noalias() = R_WJ * body.axis;
    }
    data.com_W[b] = X * body.com;
    data.com += body.mass * data.com_W[b];
    mass += body.mass;
  }
  data.com /= mass;
}

void point_jacobian(const RobotModel& model, const RobotData& data, int body,
                    const Eigen::Vector3d& p_W, Jacobian3& J) noexcept {
  J.setZero(3, model.velocity_count());
  J.leftCols<3>().setIdentity();
  J.middleCols<3>(3) = -skew(p_W - data.X_WB[0].p);
  for (int b = body; b > 0; b = model.bodies[static_cast<std::size_t>(b)].parent) {
    const auto i = static_cast<std::size_t>(b);
    J.col(5 + b) = data.axis_W[i].cross(p_W - data.X_WB[i].p);
  }
}

void frame_jacobian(const RobotModel& model, const RobotData& data, int body,
                    const Eigen::Vector3d& p_W, Jacobian6& J) noexcept {
  J.setZero(6, model.velocity_count());
  J.topLeftCorner<3, 3>().setIdentity();
  J.block<3, 3>(0, 3) = -skew(p_W - data.X_WB[0].p);
  J.block<3, 3>(3, 3).setIdentity();
  for (int b = body; b > 0; b = model.bodies[static_cast<std::size_t>(b)].parent) {
    const auto i = static_cast<std::size_t>(b);
    J.block<3, 1>(0, 5 + b) = data.axis_W[i].cross(p_W - data.X_WB[i].p);
    J.block<3, 1>(3, 5 + b) = data.axis_W[i];
  }
}

void com_jacobian(const RobotModel& model, const RobotData& data, Jacobian3& J) noexcept {
  // Mass and first moment of the subtree behind each joint, gathered from the leaves.
  std::array<double, kMaxBodies> mass;
  std::array<Eigen::Vector3d, kMaxBodies> moment;
  const auto count = model.bodies.size();
  for (std::size_t b = 0; b < count; ++b) {
    mass[b] = model.bodies[b].mass;
    moment[b] = mass[b] * data.com_W[b];
  }
  J.setZero(3, model.velocity_count());
  for (std::size_t b = count - 1; b > 0; --b) {
    const auto parent = static_cast<std::size_t>(model.bodies[b].parent);
    mass[parent] += mass[b];
    moment[parent] += moment[b];
    J.col(5 + static_cast<Eigen::Index>(b)) =
        data.axis_W[b].cross(moment[b] - mass[b] * data.X_WB[b].p);
  }
  J.rightCols(model.joint_count()) /= mass[0];
  J.leftCols<3>().setIdentity();
  J.middleCols<3>(3) = -skew(data.com - data.X_WB[0].p);
}

void gravity_torque(const RobotModel& model, const RobotData& data, VelocityVector& g) noexcept {
  Jacobian3 J;
  com_jacobian(model, data, J);
  double mass = 0.0;
  for (const Body& body : model.bodies) {
    mass += body.mass;
  }
  g = mass * kGravity * J.row(2).transpose();
}

void inverse_dynamics(const RobotModel& model, const RobotData& data, const VelocityVector& v,
                      const VelocityVector& a, VelocityVector& tau) noexcept {
  const auto count = model.bodies.size();
  std::array<Eigen::Vector3d, kMaxBodies> w, alpha, a_origin, force, moment;
  for (std::size_t b = 0; b < count; ++b) {
    const Body& body = model.bodies[b];
    if (body.parent < 0) {
      w[b] = v.segment<3>(3);
      alpha[b] = a.segment<3>(3);
      // Gravity as an upward acceleration of the base.
      a_origin[b] = a.head<3>() + Eigen::Vector3d(0, 0, kGravity);
    } else {
      const auto p = static_cast<std::size_t>(body.parent);
      const auto row = 5 + static_cast<Eigen::Index>(b);
      const Eigen::Vector3d arm = data.X_WB[b].p - data.X_WB[p].p;
      w[b] = w[p] + data.axis_W[b] * v[row];
      alpha[b] = alpha[p] + data.axis_W[b] * a[row] + w[p].cross(data.axis_W[b] * v[row]);
      a_origin[b] = a_origin[p] + alpha[p].cross(arm) + w[p].cross(w[p].cross(arm));
    }
    const Eigen::Vector3d c = data.com_W[b] - data.X_WB[b].p;
    const Eigen::Matrix3d I = data.X_WB[b].R * body.inertia * data.X_WB[b].R.transpose();
    force[b] = body.mass * (a_origin[b] + alpha[b].cross(c) + w[b].cross(w[b].cross(c)));
    moment[b] = I * alpha[b] + w[b].cross(I * w[b]) + c.cross(force[b]);
  }
  tau.setZero(model.velocity_count());
  for (std::size_t b = count; b-- > 0;) {
    if (b == 0) {
      tau.head<3>() = force[0];
      tau.segment<3>(3) = moment[0];
      break;
    }
    const auto row = 5 + static_cast<Eigen::Index>(b);
    tau[row] = data.axis_W[b].dot(moment[b]) + model.joints[b - 1].reflected_inertia * a[row];
    const auto p = static_cast<std::size_t>(model.bodies[b].parent);
    force[p] += force[b];
    moment[p] += moment[b] + (data.X_WB[b].p - data.X_WB[p].p).cross(force[b]);
  }
}

void mass_matrix(const RobotModel& model, const RobotData& data, MassMatrix& M) noexcept {
  const auto count = model.bodies.size();
  const Eigen::Vector3d origin = data.X_WB[0].p;
  std::array<PointInertia, kMaxBodies> composite;
  for (std::size_t b = 0; b < count; ++b) {
    composite[b] = body_inertia_about(model.bodies[b], data.X_WB[b], data.com_W[b], origin);
  }
  M.setZero(model.velocity_count(), model.velocity_count());
  for (std::size_t b = count - 1; b > 0; --b) {
    composite[static_cast<std::size_t>(model.bodies[b].parent)].add(composite[b]);
    // Twist of joint b at the base origin, and the momentum it gives the subtree behind it.
    const Eigen::Vector3d axis = data.axis_W[b];
    const Eigen::Vector3d linear = (data.X_WB[b].p - origin).cross(axis);
    const PointInertia& I = composite[b];
    const Eigen::Vector3d h_linear = I.mass * linear + axis.cross(I.moment);
    const Eigen::Vector3d h_angular = I.inertia * axis + I.moment.cross(linear);
    const auto col = 5 + static_cast<Eigen::Index>(b);
    for (std::size_t j = b; j > 0; j = static_cast<std::size_t>(model.bodies[j].parent)) {
      const auto row = 5 + static_cast<Eigen::Index>(j);
      const Eigen::Vector3d linear_j = (data.X_WB[j].p - origin).cross(data.axis_W[j]);
      M(row, col) = M(col, row) = data.axis_W[j].dot(h_angular) + linear_j.dot(h_linear);
    }
    M.block<3, 1>(0, col) = h_linear;
    M.block<3, 1>(3, col) = h_angular;
    M.block<1, 3>(col, 0) = h_linear.transpose();
    M.block<1, 3>(col, 3) = h_angular.transpose();
    M(col, col) += model.joints[b - 1].reflected_inertia;
  }
  M.block<3, 3>(0, 0) = composite[0].mass * Eigen::Matrix3d::Identity();
  M.block<3, 3>(0, 3) = -skew(composite[0].moment);
  M.block<3, 3>(3, 0) = skew(composite[0].moment);
  M.block<3, 3>(3, 3) = composite[0].inertia;
}

void integrate(const RobotModel& model, const Configuration& x, const VelocityVector& dv,
               Configuration& out) noexcept {
  out.X_WB.p = x.X_WB.p + dv.head<3>();
  // Re-orthonormalised so that long integrations stay on SO(3).
  const Eigen::Quaterniond rotated(rotation_exp(dv.segment<3>(3)) * x.X_WB.R);
  out.X_WB.R = rotated.normalized().toRotationMatrix();
  out.q = x.q + dv.tail(model.joint_count());
}

}  // namespace clamber
