// Static equilibrium with friction cones and joint-torque limits: contact forces by a quadratic
// program. Any thread (one ContactForces each); allocates; never blocks.
#pragma once

#include <vector>

#include "planner_offline/contacts/contact.hpp"
#include "planner_offline/ik/dense_qp.hpp"

namespace clamber {

struct ForceSettings {
  double friction = 0.5;       ///< coefficient counted on (the planner's share of the scenario's)
  double torque_share = 0.95;  ///< share of each joint's torque limit a posture may use
  double least_normal = 0.0;   ///< N, least normal force of each contact (0: may be idle)
};

enum class Equilibrium {
  kFeasible,
  kTorque,   ///< the forces balance, but some joint torque exceeds its limit
  kBalance,  ///< no forces within the friction cones balance gravity
};

struct ForceSolution {
  Equilibrium status = Equilibrium::kBalance;
  std::vector<Eigen::Vector3d> forces;  ///< per contact (its points summed), world, N, on the robot
  JointVector tau;                      ///< N m, what the joints supply
  int peak_joint = 0;                   ///< the joint nearest to its limit, or farthest beyond
  double peak_torque = 0.0;             ///< its torque, N m
  double peak_share = 0.0;              ///< and the share of its limit
  double torque_margin = 0.0;           ///< N m, smallest limit - |tau| (full limit)
  double least_friction_slack = 0.0;    ///< N, smallest mu f_z - |f_t| over the contact points
  double residual = 0.0;                ///< N and N m, norm of the balance's remainder
};

/// Minimises sum (tau_i / limit_i)^2 over contact forces f in the friction pyramids
/// |f_x|, |f_y| <= mu / sqrt(2) f_z (inside the cone) with S^T tau + J^T f = g(x), |tau| <= limits.
class ContactForces {
 public:
  ContactForces(const RobotModel& model, const ForceSettings& settings)
      : model_(model), settings_(settings) {}

  [[nodiscard]] ForceSolution solve(const RobotData& data, const ContactSet& contacts);

 private:
  [[nodiscard]] bool solve_program(const VelocityVector& g, double torque_share,
                                   double least_normal, Eigen::VectorXd& f);
  void gather_points(const RobotData& data, const ContactSet& contacts);

  const RobotModel& model_;
  ForceSettings settings_;
  DenseQp qp_;
  Eigen::MatrixXd J_;  // 3 m x nv, all contact points
  std::vector<int> contact_of_point_;
  std::vector<bool> is_point_;  // of a point contact, not a patch's corner
};

}  // namespace clamber
