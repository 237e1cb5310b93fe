// Between ODE's arrays and Eigen. Internal to sim_backend.
// Any thread; allocates: never; blocks: never.
#pragma once

#include <ode/ode.h>

#include <Eigen/Core>

namespace clamber {

inline Eigen::Vector3d to_eigen(const dReal* v) { return {v[0], v[1], v[2]}; }

inline void fill_vector(const Eigen::Vector3d& v, dReal* out) {
  for (int k = 0; k < 3; ++k) {
    out[k] = v[k];
  }
}

inline void fill_rotation(const Eigen::Matrix3d& R, dMatrix3 out) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      out[4 * r + c] = R(r, c);
    }
    out[4 * r + 3] = 0.0;
  }
}

inline Eigen::Matrix3d rotation_of(dBodyID body) {
  const dReal* R = dBodyGetRotation(body);
  Eigen::Matrix3d out;
  out << R[0], R[1], R[2], R[4], R[5], R[6], R[8], R[9], R[10];
  return out;
}

inline Eigen::Vector3d position_of(dBodyID body) { return to_eigen(dBodyGetPosition(body)); }

/// Velocity of the point of the body that is at p_W now.
inline Eigen::Vector3d velocity_at(dBodyID body, const Eigen::Vector3d& p_W) {
  return to_eigen(dBodyGetLinearVel(body)) +
         to_eigen(dBodyGetAngularVel(body)).cross(p_W - position_of(body));
}

/// A spring-damper as ODE's pair of error reduction and constraint force mixing: with the row's
/// velocity v' after the step, v' + cfm force = erp/step error (ODE manual, "soft constraints").
struct Softness {
  double erp;
  double cfm;
};
inline Softness soften(double stiffness, double damping, double step) {
  const double total = step * stiffness + damping;
  return {step * stiffness / total, 1.0 / total};
}

}  // namespace clamber
