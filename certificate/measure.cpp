#include "certificate/measure.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "certificate/support_polygon.hpp"

namespace clamber {
namespace {

/// The plane through which weight is balanced when inertia counts: the floor, the farthest below
/// the centre of mass and so the one where inertia shifts most.
constexpr double kReferenceHeight = 0.0;

/// Newtons below which a sole has no centre of pressure worth the name.
constexpr double kIdle = 1.0;

template <class Visit>
void for_each_bit(TouchMask mask, Visit&& visit) {
  for (std::size_t n = 0; mask != 0; mask &= mask - 1, ++n)
    visit(static_cast<std::size_t>(std::countr_zero(mask)), n);
}

/// Largest |velocity| over an inflated core's points: convex in the point, so at a corner.
double fastest_point(const InflatedCore& core, const Twist& twist) {
  double fastest = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d p = core.centre;
    bool repeated = false;
    for (int i = 0; i < 3; ++i) {
      const bool up = ((corner >> i) & 1) != 0;
      if (core.half_extents[i] == 0.0) {
        repeated |= up;
        continue;
      }
      p += (up ? core.half_extents[i] : -core.half_extents[i]) * core.axes.col(i);
    }
    if (!repeated) fastest = std::max(fastest, twist.at(p).norm());
  }
  return fastest + twist.w.norm() * core.radius;
}

}  // namespace

double force_rate(const SampleTime& sample, PointForces before, PointForces here,
                  PointForces after) noexcept {
  const auto towards = [&](PointForces there, double h) {
    double change = 0.0;
    for (std::size_t p = 0; p < here.size(); ++p) change += (there[p] - here[p]).norm();
    return change / h;
  };
  return std::max(sample.before > 0.0 ? towards(before, sample.before) : 0.0,
                  sample.after > 0.0 ? towards(after, sample.after) : 0.0);
}

void Measure::Lost::take(double distance, double loss) {
  value = std::min(value, distance);
  proven = std::min(proven, distance - loss);
}

Measure::Measure(const RobotModel& model, const Scenario& scenario, const PlannedMotion& motion,
                 const Uncertainty& uncertainty)
    : model_(model),
      scenario_(scenario),
      motion_(motion),
      uncertainty_(uncertainty),
      friction_(uncertainty.friction_share * scenario.friction),
      candidates_(touch_candidates(model)),
      geoms_(model.geoms.size()),
      pairs_(model.collision_pairs) {
  for (const Body& body : model.bodies) mass_ += body.mass;
  for (std::size_t g = 0; g < geoms_.size(); ++g) {
    const InflatedCore core = inflated_core(model.geoms[g], Pose());
    geoms_[g].reach = core.centre.norm() + core.reach();
  }
  for (std::size_t c = 0; c < model.contacts.size(); ++c)
    geoms_[static_cast<std::size_t>(model.contacts[c].geom)].own_link = static_cast<int>(c);
  for (const ObstacleBox& box : scenario.obstacles)
    obstacles_.push_back({box.center,
                          Eigen::AngleAxisd(box.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
                          box.half_extents, 0.0});
  for (const auto& pair : model.planner_pairs)
    if (std::find(pairs_.begin(), pairs_.end(), pair) == pairs_.end()) pairs_.push_back(pair);
}

void Measure::place(const SampleTime& sample) noexcept {
  sample_ = sample;
  h_ = std::max(sample.before, sample.after);
  motion_.evaluate(sample.time, sample.segment, state_);
  motion_bounds_ =
      motion_.bounds(sample.time - sample.before, sample.time + sample.after, sample.segment);
  forward_kinematics(model_, state_.x, data_);
  body_twists(model_, data_, state_.v, twists_);
  body_bounds(model_, motion_bounds_, bounds_);
  fastest_ = 0.0;
  for (std::size_t g = 0; g < geoms_.size(); ++g) {
    const auto body = static_cast<std::size_t>(model_.geoms[g].body);
    geoms_[g].core = inflated_core(model_.geoms[g], data_.X_WB[body]);
    geoms_[g].speed = fastest_point(geoms_[g].core, twists_[body]);
    fastest_ = std::max(fastest_, geoms_[g].speed);
  }
}

Eigen::Vector3d Measure::touch_point(std::size_t i) const noexcept {
  const TouchCandidate& c = candidates_[i];
  Eigen::Vector3d p = data_.X_WB[static_cast<std::size_t>(c.body)] * c.p_B;
  p.z() -= c.radius;
  return p;
}

double Measure::height(std::size_t i) const noexcept {
  const int surface =
      motion_.segments[sample_.segment].surface[static_cast<std::size_t>(candidates_[i].link)];
  return touch_point(i).z() -
         (surface < 0 ? 0.0 : scenario_.obstacles[static_cast<std::size_t>(surface)].top());
}

TouchMask Measure::resting() const noexcept {
  TouchMask mask = 0;
  for (std::size_t i = 0; i < candidates_.size(); ++i)
    if (motion_.segments[sample_.segment].surface[static_cast<std::size_t>(candidates_[i].link)] !=
        kNoSurface)
      mask |= TouchMask{1} << i;
  return mask;
}

void Measure::statics(TouchMask mask, PointForces forces, JointVector& tau, Eigen::Vector3d& force,
                      Eigen::Vector3d& moment) const noexcept {
  std::array<Eigen::Vector3d, kMaxBodies> F, N;  // on the body and all behind it, about the origin
  const std::size_t count = model_.bodies.size();
  for (std::size_t b = 0; b < count; ++b) {
    F[b] = Eigen::Vector3d(0.0, 0.0, -model_.bodies[b].mass * kGravity);
    N[b] = data_.com_W[b].cross(F[b]);
  }
  for_each_bit(mask, [&](std::size_t i, std::size_t n) {
    const auto b = static_cast<std::size_t>(candidates_[i].body);
    F[b] += forces[n];
    N[b] += touch_point(i).cross(forces[n]);
  });
  tau.resize(model_.joint_count());
  for (std::size_t b = count; b-- > 1;) {
    const auto parent = static_cast<std::size_t>(model_.bodies[b].parent);
    tau[static_cast<Eigen::Index>(b) - 1] =
        -data_.axis_W[b].dot(N[b] - data_.X_WB[b].p.cross(F[b]));
    F[parent] += F[b];
    N[parent] += N[b];
  }
  force = F[0];
  moment = N[0] - data_.com.cross(F[0]);
}

/// What a point may travel until half way to the neighbours.
double Measure::travel(double speed, double acceleration) const noexcept {
  return 0.5 * h_ * speed + 0.125 * h_ * h_ * acceleration;
}

Measured Measure::measure(TouchMask mask, PointForces forces, double force_rates) noexcept {
  Measured out;
  measure_statics(mask, forces, force_rates, out);
  measure_pressure(mask, forces, out);
  measure_joints(out);
  measure_support(mask, out);
  measure_contacts(mask, out);
  measure_surroundings(out);
  measure_self(out);
  measure_height_and_start(mask, out);
  measure_tilt(out);
  measure_masses(mask, forces, out);
  out.value[Quantity::kComX] = data_.com.x();
  out.value[Quantity::kComY] = data_.com.y();
  out.value[Quantity::kComZ] = data_.com.z();
  return out;
}

/// Between two samples the witness is the straight mix of theirs. Net force and friction cones are
/// linear or convex in the forces, so they hold in between. Moments are products of positions and
/// forces: they leave their chord by at most |second derivative| h^2 / 8, and
///   (a . (r x F))'' <= F (|a''| R + 2 |a'| V + A) + 2 F' (|a'| R + V)
/// for an axis a, lever r with |r| <= R, |r'| <= V, |r''| <= A, and a force F that changes at F'.
void Measure::measure_statics(TouchMask mask, PointForces forces, double force_rates,
                              Measured& out) noexcept {
  Eigen::Vector3d force, moment;
  statics(mask, forces, tau_, force, moment);
  motion_.feed_forward(sample_.time, sample_.segment, tau_ff_);
  out.value[Quantity::kResidualForce] = force.norm();
  out.value[Quantity::kResidualMoment] = moment.norm();
  double friction = std::numeric_limits<double>::infinity(), total = mass_ * kGravity;
  for_each_bit(mask, [&](std::size_t, std::size_t n) {
    friction = std::min(friction, friction_ * forces[n].z() - forces[n].head<2>().norm());
    total += forces[n].norm();
  });
  total += force_rates * h_;
  out.value[Quantity::kFrictionSlack] = mask == 0 ? -mass_ * kGravity : friction;
  double slack = std::numeric_limits<double>::infinity(), heavy = slack;
  double strongest = 0.0;
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    const double t = std::abs(tau_[static_cast<Eigen::Index>(j)]);
    slack = std::min(slack, model_.joints[j].torque_limit - t);
    heavy = std::min(heavy, model_.joints[j].torque_limit - (1.0 + uncertainty_.mass_share) * t);
    strongest = std::max(strongest, model_.joints[j].torque_limit);
  }
  out.value[Quantity::kTorqueSlack] = slack;
  out.value[Quantity::kTorqueSlackHeavy] = heavy;
  out.value[Quantity::kFeedForwardError] = (tau_ff_ - tau_).cwiseAbs().maxCoeff() / strongest;

  const double moment_bow = h_ * h_ / 8.0 * moment_curvature(mask, forces, force_rates);
  double turn = 0.0, turn_acceleration = 0.0, acceleration = 0.0, reach = 0.0;
  for (std::size_t g = 0; g < geoms_.size(); ++g) {
    const BodyBounds& b = bounds_[static_cast<std::size_t>(model_.geoms[g].body)];
    turn = std::max(turn, b.turn_rate);
    turn_acceleration = std::max(turn_acceleration, b.turn_acceleration);
    acceleration = std::max(acceleration, b.at(geoms_[g].reach));
    reach = std::max(reach, (geoms_[g].core.centre - data_.com).norm() + geoms_[g].core.reach());
  }
  const double lever = 2.0 * reach;  // both ends of a lever lie on the robot
  const double speed = 2.0 * (fastest_ + acceleration * h_);
  const double second = total * ((turn_acceleration + turn * turn) * lever + 2.0 * turn * speed +
                                 2.0 * acceleration) +
                        2.0 * force_rates * (turn * lever + speed);
  const double bow = second * h_ * h_ / 8.0;
  out.gap[Quantity::kResidualMoment] = moment_bow;
  out.gap[Quantity::kTorqueSlack] = bow;
  out.gap[Quantity::kTorqueSlackHeavy] = (1.0 + uncertainty_.mass_share) * bow;
  out.gap[Quantity::kFeedForwardError] = bow / strongest;
}

/// Bound on |second derivative| of the contact forces' moment about the centre of mass c:
/// sum (p - c) x f with |p''| and |c''| bounded, f changing evenly. Weight has no moment about c.
double Measure::moment_curvature(TouchMask mask, PointForces forces,
                                 double force_rates) const noexcept {
  // Plain names: a lambda may not capture a structured binding with every compiler.
  const auto motion = com_motion();
  const Eigen::Vector3d& com_velocity = motion.first;
  const double com_acceleration = motion.second;
  double curvature = 0.0, fastest = 0.0, most = 0.0;
  for_each_bit(mask, [&](std::size_t i, std::size_t n) {
    const auto body = static_cast<std::size_t>(candidates_[i].body);
    const Eigen::Vector3d centre = data_.X_WB[body] * candidates_[i].p_B;
    const double acceleration = bounds_[body].at(candidates_[i].p_B.norm()) + com_acceleration;
    fastest =
        std::max(fastest, (twists_[body].at(centre) - com_velocity).norm() + acceleration * h_);
    curvature += forces[n].norm() * acceleration;
    most = std::max(most, acceleration);
  });
  // A neighbour's forces may be larger by force_rates h.
  return curvature + force_rates * (h_ * most + 2.0 * fastest);
}

std::pair<Eigen::Vector3d, double> Measure::com_motion() const noexcept {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  double acceleration = 0.0;
  for (std::size_t b = 0; b < model_.bodies.size(); ++b) {
    const double share = model_.bodies[b].mass / mass_;
    velocity += share * twists_[b].at(data_.com_W[b]);
    acceleration += share * bounds_[b].at(model_.bodies[b].com.norm());
  }
  return {velocity, acceleration};
}

/// A sole's centre of pressure is inside what its loaded corners span as soon as none of them
/// pulls; in between the forces are mixed, and a mix of points on one side of an edge stays there.
void Measure::measure_pressure(TouchMask mask, PointForces forces, Measured& out) const noexcept {
  double least = kFar;
  for (std::size_t link = 0; link < model_.contacts.size(); ++link) {
    std::array<Eigen::Vector2d, 64> corners;
    std::size_t count = 0;
    Eigen::Vector2d weighted = Eigen::Vector2d::Zero();
    double normal = 0.0;
    for_each_bit(mask, [&](std::size_t i, std::size_t n) {
      if (static_cast<std::size_t>(candidates_[i].link) != link || !candidates_[i].of_patch) return;
      corners[count] = touch_point(i).head<2>();
      weighted += forces[n].z() * corners[count++];
      normal += forces[n].z();
    });
    if (count < 3 || normal < kIdle) continue;
    least =
        std::min(least, SupportPolygon(std::span(corners).first(count)).margin(weighted / normal));
  }
  out.value[Quantity::kCopSlack] = least;
}

void Measure::measure_joints(Measured& out) const noexcept {
  double slack = std::numeric_limits<double>::infinity(), velocity = slack;
  double bow = 0.0, velocity_gap = 0.0;
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    const Joint& joint = model_.joints[j];
    const double q = state_.x.q[static_cast<Eigen::Index>(j)];
    const double rate = std::abs(state_.v[6 + static_cast<Eigen::Index>(j)]);
    slack = std::min({slack, q - joint.lower, joint.upper - q});
    velocity = std::min(velocity, joint.velocity_limit - rate);
    bow = std::max(bow, motion_bounds_.acceleration_q[j] * h_ * h_ / 8.0);
    // The bound holds for both neighbouring intervals; what it adds to this sample's rate is lost.
    velocity_gap = std::max(velocity_gap, motion_bounds_.rate[j] - rate);
  }
  out.value[Quantity::kJointSlack] = slack;
  out.gap[Quantity::kJointSlack] = bow;
  out.value[Quantity::kVelocitySlack] = velocity;
  out.gap[Quantity::kVelocitySlack] = velocity_gap;
}

/// Where the ground reaction of all forces, inertia included, meets the reference plane.
Eigen::Vector2d Measure::zero_moment_point() const noexcept {
  VelocityVector needed;
  inverse_dynamics(model_, data_, state_.v, state_.a, needed);
  const Eigen::Vector3d F = needed.head<3>(), N = needed.segment<3>(3);
  const Eigen::Vector3d base = data_.X_WB[0].p;
  const double above = base.z() - kReferenceHeight;
  // N + above z x F is the moment about the base's foot point on the plane.
  return base.head<2>() + Eigen::Vector2d(-(N.y() + above * F.x()), N.x() - above * F.y()) / F.z();
}

/// When every corner and the centre of mass move by at most e1 and e2, the margin changes by at
/// most e1 + e2: the hull's support function does.
void Measure::measure_support(TouchMask mask, Measured& out) const noexcept {
  std::array<Eigen::Vector2d, 64> corners;
  std::size_t count = 0;
  double corner_travel = 0.0;
  for_each_bit(mask, [&](std::size_t i, std::size_t) {
    corners[count++] = touch_point(i).head<2>();
    const auto body = static_cast<std::size_t>(candidates_[i].body);
    const Eigen::Vector3d p = data_.X_WB[body] * candidates_[i].p_B;
    corner_travel = std::max(corner_travel, travel(twists_[body].at(p).head<2>().norm(),
                                                   bounds_[body].at(candidates_[i].p_B.norm())));
  });
  const SupportPolygon polygon{std::span(corners).first(count)};
  const double margin = polygon.margin(data_.com.head<2>());
  // Without an area there is no margin: a number all the same, for the file and the table.
  const auto finite = [](double x) { return std::max(x, -1.0); };
  const auto [com_velocity, com_acceleration] = com_motion();
  double shift = 0.0;
  for (std::size_t b = 0; b < model_.bodies.size(); ++b)
    shift += model_.bodies[b].mass / mass_ * (data_.com_W[b] - data_.com).head<2>().norm();
  shift *= uncertainty_.mass_share / (1.0 - uncertainty_.mass_share);
  const double lost = corner_travel + travel(com_velocity.head<2>().norm(), com_acceleration);
  out.value[Quantity::kSupportMargin] = finite(margin);
  out.value[Quantity::kSupportMarginMass] = finite(margin - shift);
  out.value[Quantity::kSupportMarginMoving] = finite(polygon.margin(zero_moment_point()));
  out.gap[Quantity::kSupportMargin] = lost;
  out.gap[Quantity::kSupportMarginMass] = lost;
}

double Measure::edge_distance(const Eigen::Vector3d& p, int surface) const noexcept {
  double least = kFar;
  for (std::size_t o = 0; o < obstacles_.size(); ++o) {
    const bool on = static_cast<int>(o) == surface;
    if (surface >= 0 && !on) continue;
    const Eigen::Vector3d local = obstacles_[o].axes.transpose() * (p - obstacles_[o].centre);
    const Eigen::Vector2d inside =
        obstacles_[o].half_extents.head<2>() - local.head<2>().cwiseAbs();
    least = std::min(least, on ? inside.minCoeff() : -inside.minCoeff());
  }
  return least;
}

void Measure::measure_contacts(TouchMask mask, Measured& out) noexcept {
  double& gap = out.value[Quantity::kContactGap];
  double& depth = out.value[Quantity::kContactDepth];
  double& slip = out.value[Quantity::kSlip];
  double& edge = out.value[Quantity::kEdgeDistance] = kFar;
  slipping_ &= mask;
  for_each_bit(resting() | mask, [&](std::size_t i, std::size_t) {
    const TouchCandidate& c = candidates_[i];
    const auto body = static_cast<std::size_t>(c.body);
    const Eigen::Vector3d at = touch_point(i), centre = data_.X_WB[body] * c.p_B;
    const Eigen::Vector3d velocity = twists_[body].at(centre);
    const double acceleration = bounds_[body].at(c.p_B.norm() + c.radius);
    const double rises = travel(std::abs(velocity.z()), acceleration);
    const double above = height(i);
    depth = std::max(depth, -above);
    out.gap[Quantity::kContactDepth] = std::max(out.gap[Quantity::kContactDepth], rises);
    const TouchMask bit = TouchMask{1} << i;
    if ((mask & bit) == 0) return;
    gap = std::max(gap, above);
    out.gap[Quantity::kContactGap] = std::max(out.gap[Quantity::kContactGap], rises);
    const int surface = motion_.segments[sample_.segment].surface[static_cast<std::size_t>(c.link)];
    edge = std::min(edge, edge_distance(at, surface));
    out.gap[Quantity::kEdgeDistance] =
        std::max(out.gap[Quantity::kEdgeDistance], travel(velocity.head<2>().norm(), acceleration));
    // The sphere rolls: what must not move is the material at its bottom.
    const Eigen::Vector3d rate = twists_[body].at(at);
    if ((slipping_ & bit) == 0) {
      slip_[i].setZero();
    } else {
      slip_[i] += 0.5 * sample_.before * (slip_rate_[i] + rate);
    }
    slip_rate_[i] = rate;
    slip = std::max(slip, slip_[i].head<2>().norm());
    out.gap[Quantity::kSlip] =
        std::max(out.gap[Quantity::kSlip], travel(rate.head<2>().norm(), acceleration));
  });
  slipping_ = mask;
}

/// A link in contact is judged by its touching points. One that lies on the surface beside a
/// contact of its body, or is about to touch or just came off, may be near; all others are free.
Measure::Class Measure::classify(std::size_t geom, int surface) const noexcept {
  const MotionSegment& segment = motion_.segments[sample_.segment];
  bool near = false, landing = false;
  for (std::size_t c = 0; c < model_.contacts.size(); ++c) {
    const bool own = geoms_[geom].own_link == static_cast<int>(c);
    if (!own && model_.contacts[c].body != model_.geoms[geom].body) continue;
    if (own && segment.surface[c] == surface) return Class::kIgnored;
    near |= segment.surface[c] == surface;
    landing |= segment.approach[c] == surface;
  }
  return near ? Class::kNear : landing ? Class::kLanding : Class::kFree;
}

void Measure::measure_surroundings(Measured& out) const noexcept {
  Lost obstacle, floor, near;
  for (std::size_t g = 0; g < geoms_.size(); ++g) {
    const GeomInfo& geom = geoms_[g];
    const BodyBounds& bounds = bounds_[static_cast<std::size_t>(model_.geoms[g].body)];
    const double lost = travel(geom.speed, bounds.at(geom.reach));
    const double height = lowest_height(geom.core);
    if (height < kFar) {
      const Class type = classify(g, kFloorSurface);
      if (type != Class::kIgnored) (type == Class::kFree ? floor : near).take(height, lost);
    }
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      // A sphere around the link against the box, first: most links are far away.
      const Eigen::Vector3d local =
          obstacles_[o].axes.transpose() * (geom.core.centre - obstacles_[o].centre);
      const double away =
          (local.cwiseAbs() - obstacles_[o].half_extents).cwiseMax(0.0).norm() - geom.core.reach();
      if (away > kFar) continue;
      const Class type = classify(g, static_cast<int>(o));
      if (type == Class::kIgnored) continue;
      (type == Class::kFree ? obstacle : near)
          .take(convex_distance(geom.core, obstacles_[o]), lost);
    }
  }
  const auto put = [&out](Quantity q, const Lost& lost) {
    out.value[q] = lost.value;
    out.gap[q] = lost.value - lost.proven;
  };
  put(Quantity::kObstacleClearance, obstacle);
  put(Quantity::kFloorClearance, floor);
  put(Quantity::kNearClearance, near);
}

/// Seen from one link the other moves with the difference of their twists.
void Measure::measure_self(Measured& out) const noexcept {
  Lost self;
  for (const auto& [first, second] : pairs_) {
    const auto a = static_cast<std::size_t>(first), b = static_cast<std::size_t>(second);
    const InflatedCore &A = geoms_[a].core, &B = geoms_[b].core;
    if ((A.centre - B.centre).norm() - A.reach() - B.reach() > kFar) continue;
    const double distance = convex_distance(A, B);
    if (distance > kFar) continue;
    const auto body_a = static_cast<std::size_t>(model_.geoms[a].body);
    const auto body_b = static_cast<std::size_t>(model_.geoms[b].body);
    const Twist &of_a = twists_[body_a], &of_b = twists_[body_b];
    const Twist relative{of_a.origin, of_a.v - of_b.at(of_a.origin), of_a.w - of_b.w};
    const double speed = std::min(fastest_point(A, relative), fastest_point(B, relative));
    // Accelerations seen from the other link: both links', and the Coriolis part.
    const double acceleration =
        bounds_[body_a].at(geoms_[a].reach) +
        bounds_[body_b].at((A.centre - data_.X_WB[body_b].p).norm() + A.reach() + geoms_[b].reach) +
        2.0 * bounds_[body_b].turn_rate * (speed + fastest_);
    self.take(distance, travel(speed, acceleration));
  }
  out.value[Quantity::kSelfClearance] = self.value;
  out.gap[Quantity::kSelfClearance] = self.value - self.proven;
}

}  // namespace clamber
