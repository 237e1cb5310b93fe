#include "planner_offline/certify/torque_relief.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace clamber {

double TorqueRelief::measure(const Configuration& x, const ContactSet& contacts) {
  forward_kinematics(model_, x, data_);
  const ForceSolution solution = forces_.solve(data_, contacts);
  if (solution.status == Equilibrium::kBalance) {
    return std::numeric_limits<double>::infinity();
  }
  double sum = 0.0;
  for (int i = 0; i < model_.joint_count(); ++i) {
    const double load = solution.tau[i] / model_.joints[static_cast<std::size_t>(i)].torque_limit;
    sum += load * load * load * load;
  }
  return sum;
}

JointVector TorqueRelief::direction(const Configuration& x, const ContactSet& contacts,
                                    double measure_here, double step) {
  constexpr double kProbe = 1e-3;  // rad
  JointVector gradient = JointVector::Zero(model_.joint_count());
  if (!std::isfinite(measure_here)) {
    return gradient;
  }
  for (int j = 0; j < model_.joint_count(); ++j) {
    Configuration probe = x;
    probe.q[j] += kProbe;
    const double there = measure(probe, contacts);
    if (std::isfinite(there)) {
      gradient[j] = (there - measure_here) / kProbe;
    }
  }
  return -gradient * (step / std::max(gradient.cwiseAbs().maxCoeff(), 1e-12));
}

}  // namespace clamber
