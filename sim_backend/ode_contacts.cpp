#include "sim_backend/ode_contacts.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace clamber {
namespace {

constexpr int kMaxPointsPerPair = 8;
// ODE keeps pointers to the feedback of each point, so the arrays must not grow.
constexpr std::size_t kMaxPoints = 512;
constexpr double kSlipping = 5e-3;   // m/s: faster than this a contact counts as slipping
constexpr double kSamePoint = 0.01;  // m: points of a pair nearer than this are the same one
// Below this share of the friction bound the bound's direction cannot matter.
constexpr double kNegligibleFriction = 0.05;
constexpr double kWarmForce = 1.0;  // N: weaker contacts start cold
// Friction forces of several points may cancel each other; without a leak such a set would be kept.
constexpr double kFrictionKept = 0.98;
constexpr double kLeastAcross = 0.1;   // of the friction bound
constexpr double kNeverActive = 1e12;  // m/(N s): softness of a row that shall do nothing

double bounding_radius(const Geom& geom) {
  switch (geom.shape) {
    case Shape::kSphere:
      return geom.radius;
    case Shape::kCapsule:
      return geom.radius + 0.5 * geom.length;
    case Shape::kBox:
      break;
  }
  return geom.half_extents.norm();
}

dGeomID create_shape(const Geom& geom) {
  switch (geom.shape) {
    case Shape::kSphere:
      return dCreateSphere(nullptr, geom.radius);
    case Shape::kCapsule:
      return dCreateCapsule(nullptr, geom.radius, geom.length);
    case Shape::kBox:
      break;
  }
  const Eigen::Vector3d size = 2.0 * geom.half_extents;
  return dCreateBox(nullptr, size.x(), size.y(), size.z());
}

dGeomID create_obstacle(const ObstacleBox& box) {
  const Eigen::Vector3d size = 2.0 * box.half_extents;
  dGeomID id = dCreateBox(nullptr, size.x(), size.y(), size.z());
  dMatrix3 R;
  fill_rotation(Eigen::AngleAxisd(box.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(), R);
  dGeomSetPosition(id, box.center.x(), box.center.y(), box.center.z());
  dGeomSetRotation(id, R);
  return id;
}

Eigen::Vector3d tangential(const Eigen::Vector3d& v, const Eigen::Vector3d& n) {
  return v - n * n.dot(v);
}

}  // namespace

OdeContacts::OdeContacts(const RobotModel& model, const Scenario& scenario,
                         const OdeOptions& options, dWorldID world,
                         const std::vector<dBodyID>& bodies)
    : model_(model),
      scenario_(scenario),
      options_(options),
      bodies_(bodies),
      world_(world),
      soft_(soften(options.contact_stiffness, options.contact_damping, options.step)),
      joints_(dJointGroupCreate(0)),
      feedback_(kMaxPoints),
      relief_feedback_(kMaxPoints) {
  contacts_.reserve(kMaxPoints);
  memory_.reserve(kMaxPoints);
  floor_ = dCreatePlane(nullptr, 0, 0, 1, 0);
  for (const ObstacleBox& box : scenario_.obstacles) {
    obstacles_.push_back(create_obstacle(box));
  }
  create_geoms();
}

OdeContacts::~OdeContacts() {
  for (dGeomID geom : geoms_) {
    dGeomDestroy(geom);
  }
  for (dGeomID obstacle : obstacles_) {
    dGeomDestroy(obstacle);
  }
  dGeomDestroy(floor_);
  dJointGroupDestroy(joints_);
}

void OdeContacts::create_geoms() {
  for (const Geom& geom : model_.geoms) {
    dGeomID id = create_shape(geom);
    const auto body = static_cast<std::size_t>(geom.body);
    dGeomSetBody(id, bodies_[body]);
    const Eigen::Vector3d p = geom.X_BG.p - model_.bodies[body].com;
    dMatrix3 R;
    fill_rotation(geom.X_BG.R, R);
    dGeomSetOffsetPosition(id, p.x(), p.y(), p.z());
    dGeomSetOffsetRotation(id, R);
    geoms_.push_back(id);
    radii_.push_back(bounding_radius(geom));
  }
  centers_.resize(geoms_.size());
}

dBodyID OdeContacts::body_of(int geom) const {
  return bodies_[static_cast<std::size_t>(model_.geoms[static_cast<std::size_t>(geom)].body)];
}

void OdeContacts::forget() {
  contacts_.clear();
  memory_.clear();
}

void OdeContacts::detect() {
  contacts_.clear();
  for (std::size_t g = 0; g < geoms_.size(); ++g) {
    centers_[g] = to_eigen(dGeomGetPosition(geoms_[g]));
  }
  for (std::size_t g = 0; g < geoms_.size(); ++g) {
    const int geom = static_cast<int>(g);
    if (centers_[g].z() < radii_[g]) {
      collide(geom, floor_, Surface::kFloor, 0);
    }
    for (std::size_t o = 0; o < obstacles_.size(); ++o) {
      const ObstacleBox& box = scenario_.obstacles[o];
      const double reach = radii_[g] + box.half_extents.norm();
      if ((centers_[g] - box.center).squaredNorm() < reach * reach) {
        collide(geom, obstacles_[o], Surface::kObstacle, static_cast<int>(o));
      }
    }
  }
  for (const auto& [a, b] : model_.collision_pairs) {
    const auto ga = static_cast<std::size_t>(a);
    const auto gb = static_cast<std::size_t>(b);
    const double reach = radii_[ga] + radii_[gb];
    if ((centers_[ga] - centers_[gb]).squaredNorm() < reach * reach) {
      collide(a, geoms_[gb], Surface::kRobot, b);
    }
  }
}

void OdeContacts::collide(int geom, dGeomID other_geom, Surface surface, int other) {
  std::array<dContactGeom, kMaxPointsPerPair> points;
  const int count = dCollide(geoms_[static_cast<std::size_t>(geom)], other_geom, kMaxPointsPerPair,
                             points.data(), sizeof(dContactGeom));
  for (int i = 0; i < count && contacts_.size() < kMaxPoints; ++i) {
    const dContactGeom& point = points[static_cast<std::size_t>(i)];
    ContactObservation contact;
    contact.geom = geom;
    contact.surface = surface;
    contact.other = other;
    contact.position = to_eigen(point.pos);
    contact.normal = to_eigen(point.normal);
    contact.depth = point.depth;
    add(point, contact);
  }
}

void OdeContacts::add(const dContactGeom& point, ContactObservation contact) {
  const ContactObservation* before = recall(contact);
  const Eigen::Vector3d slip = slip_velocity(contact);
  // Across the slip nothing holds: a bound there would keep the slip from turning with the load.
  const bool slipping = slip.norm() > kSlipping;
  const Eigen::Vector3d direction =
      slipping ? Eigen::Vector3d(-slip.normalized()) : sticking_direction(contact, before);
  dContact joint{};
  joint.geom = point;
  joint.surface.mode = dContactSoftERP | dContactSoftCFM | dContactFDir1;
  joint.surface.soft_erp = soft_.erp;
  joint.surface.soft_cfm = soft_.cfm;
  fill_vector(direction, joint.fdir1);
  relief_feedback_[contacts_.size()] = {};
  const double guess = before != nullptr ? before->normal_force() : 0.0;
  if (options_.stepper == OdeStepper::kQuick && guess > kWarmForce) {
    const double bound = scenario_.friction * guess;
    // Half the bound at most, so that the change may take the sum from zero to the bound.
    const double along = std::clamp(before->force.dot(direction), 0.0, bound);
    const double friction = std::min(kFrictionKept * along, 0.5 * bound);
    joint.surface.mode |= dContactMu2 | dContactMotionN;  // without Approx1 mu is a force, N
    joint.surface.mu = bound - friction;
    // What the cone leaves across; never nothing, or the direction could not turn with the load.
    joint.surface.mu2 =
        slipping ? 0.0 : std::max(std::sqrt(bound * bound - along * along), kLeastAcross * bound);
    joint.surface.motionN = -2.0 * soft_.cfm * guess;
    contact.force = guess * contact.normal + friction * direction;
    push(contact);
    add_relief(point, contact, direction, guess);
  } else {
    joint.surface.mode |= dContactMu2 | dContactApprox1_1 | dContactApprox1_2;
    joint.surface.mu = scenario_.friction;
    joint.surface.mu2 = slipping ? 0.0 : scenario_.friction;
  }
  attach(joint, feedback_[contacts_.size()]);
  contacts_.push_back(contact);
}

void OdeContacts::add_relief(const dContactGeom& point, const ContactObservation& contact,
                             const Eigen::Vector3d& tangent, double guess) {
  dContact relief{};
  relief.geom = point;
  relief.geom.depth = 0.0;
  relief.surface.mode = dContactSoftERP | dContactSoftCFM | dContactFDir1 | dContactMu2 |
                        dContactMotion1 | dContactSlip1;
  relief.surface.soft_erp = 0.0;
  relief.surface.soft_cfm = kNeverActive;
  relief.surface.mu = guess;
  relief.surface.mu2 = 0.0;
  relief.surface.slip1 = soft_.cfm;
  relief.surface.motion1 = soft_.erp / options_.step * contact.depth - soft_.cfm * guess;
  fill_vector(tangent, relief.geom.normal);
  fill_vector(contact.normal, relief.fdir1);
  attach(relief, relief_feedback_[contacts_.size()]);
}

void OdeContacts::attach(const dContact& contact, dJointFeedback& feedback) {
  dJointID joint = dJointCreateContact(world_, joints_, &contact);
  dJointAttach(joint, dGeomGetBody(contact.geom.g1), dGeomGetBody(contact.geom.g2));
  dJointSetFeedback(joint, &feedback);
}

void OdeContacts::push(const ContactObservation& contact) {
  const Eigen::Vector3d& f = contact.force;
  const Eigen::Vector3d& p = contact.position;
  dBodyAddForceAtPos(body_of(contact.geom), f.x(), f.y(), f.z(), p.x(), p.y(), p.z());
  if (contact.surface == Surface::kRobot) {
    dBodyAddForceAtPos(body_of(contact.other), -f.x(), -f.y(), -f.z(), p.x(), p.y(), p.z());
  }
}

const ContactObservation* OdeContacts::recall(const ContactObservation& contact) {
  Memory* nearest = nullptr;
  double nearest_distance = kSamePoint;
  for (Memory& old : memory_) {
    if (!old.used && old.contact.geom == contact.geom && old.contact.surface == contact.surface &&
        old.contact.other == contact.other) {
      const double distance = (old.contact.position - contact.position).norm();
      if (distance < nearest_distance) {
        nearest_distance = distance;
        nearest = &old;
      }
    }
  }
  if (nearest == nullptr) {
    return nullptr;
  }
  nearest->used = true;
  return &nearest->contact;
}

Eigen::Vector3d OdeContacts::slip_velocity(const ContactObservation& contact) const {
  Eigen::Vector3d velocity = velocity_at(body_of(contact.geom), contact.position);
  if (contact.surface == Surface::kRobot) {
    velocity -= velocity_at(body_of(contact.other), contact.position);
  }
  return tangential(velocity, contact.normal);
}

Eigen::Vector3d OdeContacts::sticking_direction(const ContactObservation& contact,
                                                const ContactObservation* before) const {
  const Eigen::Vector3d& n = contact.normal;
  if (before != nullptr) {
    const Eigen::Vector3d friction = tangential(before->force, n);
    if (friction.norm() > kNegligibleFriction * scenario_.friction * before->normal_force() &&
        friction.norm() > 1e-9) {
      return friction.normalized();
    }
  }
  const bool along_x = std::abs(n.x()) > 0.7;
  return tangential(along_x ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX(), n).normalized();
}

void OdeContacts::read_forces() {
  memory_.clear();
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    contacts_[i].force += to_eigen(feedback_[i].f1) + to_eigen(relief_feedback_[i].f1);
    memory_.push_back({contacts_[i]});
  }
  dJointGroupEmpty(joints_);
}

}  // namespace clamber
