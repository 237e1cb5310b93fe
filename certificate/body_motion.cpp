#include "certificate/body_motion.hpp"

namespace clamber {

void body_twists(const RobotModel& model, const RobotData& data, const VelocityVector& v,
                 std::array<Twist, kMaxBodies>& twists) noexcept {
  twists[0] = {data.X_WB[0].p, v.head<3>(), v.segment<3>(3)};
  for (std::size_t b = 1; b < model.bodies.size(); ++b) {
    const Twist& parent = twists[static_cast<std::size_t>(model.bodies[b].parent)];
    const double rate = v[5 + static_cast<Eigen::Index>(b)];
    twists[b] = {data.X_WB[b].p, parent.at(data.X_WB[b].p), parent.w + rate * data.axis_W[b]};
  }
}

void body_bounds(const RobotModel& model, const MotionBounds& motion,
                 std::array<BodyBounds, kMaxBodies>& bounds) noexcept {
  bounds[0] = {motion.turn_rate, motion.turn_acceleration, motion.acceleration};
  for (std::size_t b = 1; b < model.bodies.size(); ++b) {
    const BodyBounds& parent = bounds[static_cast<std::size_t>(model.bodies[b].parent)];
    const double rate = motion.rate[b - 1];
    bounds[b] = {parent.turn_rate + rate,
                 parent.turn_acceleration + motion.acceleration_q[b - 1] + parent.turn_rate * rate,
                 parent.at(model.bodies[b].X_PJ.p.norm())};
  }
}

}  // namespace clamber
