#include "sim_backend/ode_world.hpp"

#include <ode/ode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "robot_model/kinematics.hpp"

namespace clamber {
namespace {

constexpr int kMaxPointsPerPair = 8;
constexpr std::size_t kMaxContactPoints = 512;
// 50 N m lean 1 mrad into a stop; the damping takes the bounce out of it.
constexpr double kStopStiffness = 5e4;  // N m/rad
constexpr double kStopDamping = 200.0;  // N m s/rad
constexpr double kSlipping = 5e-3;      // m/s: faster than this a contact counts as slipping
constexpr double kSamePoint = 0.01;     // m: contact points nearer than this are the same one
// Below this share of the friction bound the pyramid's direction cannot matter.
constexpr double kNegligibleFriction = 0.05;
constexpr double kWarmContact = 1.0;  // N
constexpr double kFrictionLeak = 0.98;

void initialise_ode_once() {
  // Never closed: worlds may live until the process ends.
  static const bool done = dInitODE2(0) != 0 && dAllocateODEDataForThread(dAllocateMaskAll) != 0;
  static_cast<void>(done);
}

Eigen::Vector3d to_eigen(const dReal* v) { return {v[0], v[1], v[2]}; }

Eigen::Matrix3d rotation_of(dBodyID body) {
  const dReal* R = dBodyGetRotation(body);
  Eigen::Matrix3d out;
  out << R[0], R[1], R[2], R[4], R[5], R[6], R[8], R[9], R[10];
  return out;
}

void fill_rotation(const Eigen::Matrix3d& R, dMatrix3 out) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      out[4 * r + c] = R(r, c);
    }
    out[4 * r + 3] = 0.0;
  }
}

double bounding_radius(const Geom& geom) {
  switch (geom.shape) {
    case Shape::kSphere:
      return geom.radius;
    case Shape::kCapsule:
      return geom.radius + 0.5 * geom.length;
    case Shape::kBox:
      return geom.half_extents.norm();
  }
  return 0.0;
}

dGeomID create_geom(const Geom& geom) {
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

/// Spring-damper as ODE's pair of error reduction and constraint force mixing.
struct Softness {
  double erp;
  double cfm;
};
Softness soften(double stiffness, double damping, double step) {
  const double total = step * stiffness + damping;
  return {step * stiffness / total, 1.0 / total};
}

/// Force and moment a joint transmits to its child at the anchor, kept in the parent's axes so that
/// it turns with the robot.
struct JointWrench {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
};

/// What is remembered of a contact point for the friction direction of the next step.
struct ContactMemory {
  int geom;
  Surface surface;
  int other;
  Eigen::Vector3d position;
  Eigen::Vector3d tangential_force;
  double normal_force;
  bool used = false;
};

}  // namespace

struct OdeWorld::Impl {
  Impl(const RobotModel& robot_model, const Scenario& world_scenario,
       const OdeOptions& ode_options);
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void create_bodies();
  void create_joints();
  void create_geoms();
  void create_scene();
  void create_guide();

  void place(const Configuration& x0, const VelocityVector& v0);
  void read_state();
  void drive_joints(const JointVector& command);
  void find_contacts();
  void collide(int geom, dGeomID other_geom, Surface surface, int other);
  void add_contact(const dContactGeom& point, int geom, Surface surface, int other);
  void add_relief(const dContactGeom& point, const ContactObservation& seen,
                  const Eigen::Vector3d& tangent, double guess, const Softness& soft);
  void push(int geom, Surface surface, int other, const Eigen::Vector3d& p,
            const Eigen::Vector3d& f);
  ContactMemory* recall(const ContactObservation& contact);
  Eigen::Vector3d friction_direction(const ContactObservation& contact,
                                     const ContactMemory* before) const;
  void apply_joint_wrenches();
  void read_joint_wrenches();
  void read_contact_forces();
  void move_guide();
  void advance(const JointVector& command);

  [[nodiscard]] Eigen::Vector3d velocity_at(dBodyID body, const Eigen::Vector3d& p_W) const;
  [[nodiscard]] Eigen::Vector3d anchor_of(std::size_t joint) const;

  const RobotModel model;
  const Scenario scenario;
  const OdeOptions options;

  dWorldID world = nullptr;
  dJointGroupID contact_group = nullptr;
  std::vector<dBodyID> bodies;
  std::vector<dJointID> hinges;
  std::vector<dJointFeedback> hinge_feedback;
  std::vector<dGeomID> geoms;
  std::vector<double> geom_radius;
  dGeomID floor = nullptr;
  std::vector<dGeomID> obstacles;
  dBodyID guide = nullptr;
  dJointID guide_joint = nullptr;
  dJointFeedback guide_feedback{};

  unsigned long random_state = 0;
  double time = 0.0;
  Configuration x;
  VelocityVector v;
  JointVector tau;
  std::vector<JointWrench> wrenches;
  std::vector<Eigen::Vector3d> geom_centers;
  std::vector<ContactObservation> contacts;
  std::vector<dJointFeedback> contact_feedback;
  std::vector<dJointFeedback> relief_feedback;
  std::vector<ContactMemory> memory;
  std::optional<Pose> guide_pose;
  std::optional<Pose> guide_previous;
  std::string floor_name = "floor";
};

OdeWorld::Impl::Impl(const RobotModel& robot_model, const Scenario& world_scenario,
                     const OdeOptions& ode_options)
    : model(robot_model), scenario(world_scenario), options(ode_options) {
  initialise_ode_once();
  world = dWorldCreate();
  dWorldSetGravity(world, options.gravity.x(), options.gravity.y(), options.gravity.z());
  dWorldSetERP(world, 0.2);
  dWorldSetCFM(world, 1e-9);  // the exact stepper needs it where contacts are redundant
  dWorldSetQuickStepNumIterations(world, options.iterations);
  contact_group = dJointGroupCreate(0);
  create_bodies();
  create_joints();
  create_geoms();
  create_scene();
  create_guide();
  contacts.reserve(kMaxContactPoints);
  relief_feedback.resize(kMaxContactPoints);
  contact_feedback.resize(kMaxContactPoints);  // ODE keeps pointers into it: never grows
}

OdeWorld::Impl::~Impl() {
  for (dGeomID geom : geoms) {
    dGeomDestroy(geom);
  }
  for (dGeomID obstacle : obstacles) {
    dGeomDestroy(obstacle);
  }
  dGeomDestroy(floor);
  dJointGroupDestroy(contact_group);
  dWorldDestroy(world);
}

void OdeWorld::Impl::create_bodies() {
  for (const Body& body : model.bodies) {
    dBodyID id = dBodyCreate(world);
    const Eigen::Matrix3d& I = body.inertia;
    dMass mass;
    dMassSetParameters(&mass, body.mass, 0, 0, 0, I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2),
                       I(1, 2));
    dBodySetMass(id, &mass);
    dBodySetAutoDisableFlag(id, 0);
    bodies.push_back(id);
  }
}

void OdeWorld::Impl::create_joints() {
  // Joints take their reference from the poses the bodies have now: q = 0, base at the origin.
  Configuration zero;
  zero.q = JointVector::Zero(model.joint_count());
  place(zero, VelocityVector::Zero(model.velocity_count()));
  RobotData data;
  forward_kinematics(model, zero, data);
  hinge_feedback.resize(model.joints.size());
  for (std::size_t i = 0; i < model.joints.size(); ++i) {
    const std::size_t child = i + 1;
    dJointID hinge = dJointCreateHinge(world, nullptr);
    dJointAttach(hinge, bodies[child],
                 bodies[static_cast<std::size_t>(model.bodies[child].parent)]);
    const Eigen::Vector3d& p = data.X_WB[child].p;
    const Eigen::Vector3d& a = data.axis_W[child];
    dJointSetHingeAnchor(hinge, p.x(), p.y(), p.z());
    dJointSetHingeAxis(hinge, a.x(), a.y(), a.z());
    dJointSetFeedback(hinge, &hinge_feedback[i]);
    hinges.push_back(hinge);
  }
}

void OdeWorld::Impl::create_geoms() {
  for (const Geom& geom : model.geoms) {
    dGeomID id = create_geom(geom);
    const auto body = static_cast<std::size_t>(geom.body);
    dGeomSetBody(id, bodies[body]);
    const Eigen::Vector3d p = geom.X_BG.p - model.bodies[body].com;
    dMatrix3 R;
    fill_rotation(geom.X_BG.R, R);
    dGeomSetOffsetPosition(id, p.x(), p.y(), p.z());
    dGeomSetOffsetRotation(id, R);
    geoms.push_back(id);
    geom_radius.push_back(bounding_radius(geom));
  }
  geom_centers.resize(geoms.size());
}

void OdeWorld::Impl::create_scene() {
  floor = dCreatePlane(nullptr, 0, 0, 1, 0);
  for (const ObstacleBox& box : scenario.obstacles) {
    const Eigen::Vector3d size = 2.0 * box.half_extents;
    dGeomID id = dCreateBox(nullptr, size.x(), size.y(), size.z());
    dMatrix3 R;
    fill_rotation(Eigen::AngleAxisd(box.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(), R);
    dGeomSetPosition(id, box.center.x(), box.center.y(), box.center.z());
    dGeomSetRotation(id, R);
    obstacles.push_back(id);
  }
}

void OdeWorld::Impl::create_guide() {
  guide = dBodyCreate(world);
  dBodySetKinematic(guide);
  guide_joint = dJointCreateFixed(world, nullptr);
  const Softness soft = soften(options.guide_stiffness, options.guide_damping, options.step);
  dJointSetFixedParam(guide_joint, dParamERP, soft.erp);
  dJointSetFixedParam(guide_joint, dParamCFM, soft.cfm);
  dJointSetFeedback(guide_joint, &guide_feedback);
}

void OdeWorld::Impl::place(const Configuration& x0, const VelocityVector& v0) {
  RobotData data;
  forward_kinematics(model, x0, data);
  std::vector<Eigen::Vector3d> omega(bodies.size());
  std::vector<Eigen::Vector3d> origin_velocity(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (b == 0) {
      omega[b] = v0.segment<3>(3);
      origin_velocity[b] = v0.head<3>();
    } else {
      const auto parent = static_cast<std::size_t>(model.bodies[b].parent);
      omega[b] = omega[parent] + data.axis_W[b] * v0[static_cast<Eigen::Index>(5 + b)];
      origin_velocity[b] =
          origin_velocity[parent] + omega[parent].cross(data.X_WB[b].p - data.X_WB[parent].p);
    }
    const Eigen::Vector3d& p = data.com_W[b];
    const Eigen::Vector3d velocity = origin_velocity[b] + omega[b].cross(p - data.X_WB[b].p);
    dMatrix3 R;
    fill_rotation(data.X_WB[b].R, R);
    dBodySetPosition(bodies[b], p.x(), p.y(), p.z());
    dBodySetRotation(bodies[b], R);
    dBodySetLinearVel(bodies[b], velocity.x(), velocity.y(), velocity.z());
    dBodySetAngularVel(bodies[b], omega[b].x(), omega[b].y(), omega[b].z());
    dBodySetForce(bodies[b], 0, 0, 0);
    dBodySetTorque(bodies[b], 0, 0, 0);
  }
  x = x0;
  v = v0;
  tau = JointVector::Zero(model.joint_count());
}

void OdeWorld::Impl::read_state() {
  const Eigen::Matrix3d R_base = rotation_of(bodies[0]);
  x.X_WB.R = R_base;
  x.X_WB.p = to_eigen(dBodyGetPosition(bodies[0])) - R_base * model.bodies[0].com;
  v.head<3>() = velocity_at(bodies[0], x.X_WB.p);
  v.segment<3>(3) = to_eigen(dBodyGetAngularVel(bodies[0]));
  for (std::size_t i = 0; i < hinges.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    // ODE's angle is folded into +-pi; joints range further (shoulder: -3.4 rad).
    constexpr double kTurn = 2.0 * std::numbers::pi;
    const double folded = dJointGetHingeAngle(hinges[i]);
    x.q[j] = folded + kTurn * std::round((x.q[j] - folded) / kTurn);
    v[6 + j] = dJointGetHingeAngleRate(hinges[i]);
  }
}

void OdeWorld::Impl::drive_joints(const JointVector& command) {
  const double h = options.step;
  for (std::size_t i = 0; i < hinges.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    const Joint& joint = model.joints[i];
    const double limit = options.saturate_at.value_or(joint.drive_torque_limit);
    tau[j] = std::clamp(command[j], -limit, limit);
    const double q = x.q[j];
    const double rate = v[6 + j];
    double resistance = joint.reflected_inertia / h + joint.damping;  // N m s/rad
    double drive = tau[j] + joint.reflected_inertia / h * rate;
    const double beyond = std::max(0.0, q - joint.upper) + std::min(0.0, q - joint.lower);
    if (beyond != 0.0) {
      drive -= kStopStiffness * beyond;
      resistance += h * kStopStiffness;
      if (beyond * rate > 0.0) {  // damping only on the way in: a stop does not hold back
        resistance += kStopDamping;
      }
    }
    if (resistance <= 0.0) {  // nothing implicit on this joint
      dJointSetHingeParam(hinges[i], dParamFMax, 0.0);
      dJointAddHingeTorque(hinges[i], drive);
      continue;
    }
    double already_applied = 0.0;
    if (options.stepper == OdeStepper::kQuick) {
      const auto parent = static_cast<std::size_t>(model.bodies[i + 1].parent);
      dVector3 axis;
      dJointGetHingeAxis(hinges[i], axis);
      already_applied = (rotation_of(bodies[parent]) * wrenches[i].moment).dot(to_eigen(axis));
    }
    dJointSetHingeParam(hinges[i], dParamFMax, dInfinity);
    dJointSetHingeParam(hinges[i], dParamVel, (drive - already_applied) / resistance);
    dJointSetHingeParam(hinges[i], dParamCFM, 1.0 / resistance);
  }
}

Eigen::Vector3d OdeWorld::Impl::velocity_at(dBodyID body, const Eigen::Vector3d& p_W) const {
  return to_eigen(dBodyGetLinearVel(body)) +
         to_eigen(dBodyGetAngularVel(body)).cross(p_W - to_eigen(dBodyGetPosition(body)));
}

Eigen::Vector3d OdeWorld::Impl::anchor_of(std::size_t joint) const {
  dVector3 anchor;
  dJointGetHingeAnchor(hinges[joint], anchor);
  return to_eigen(anchor);
}

void OdeWorld::Impl::find_contacts() {
  contacts.clear();
  for (std::size_t g = 0; g < geoms.size(); ++g) {
    const auto body = static_cast<std::size_t>(model.geoms[g].body);
    geom_centers[g] = to_eigen(dBodyGetPosition(bodies[body])) +
                      rotation_of(bodies[body]) * (model.geoms[g].X_BG.p - model.bodies[body].com);
  }
  for (std::size_t g = 0; g < geoms.size(); ++g) {
    const int geom = static_cast<int>(g);
    if (geom_centers[g].z() < geom_radius[g]) {
      collide(geom, floor, Surface::kFloor, 0);
    }
    for (std::size_t o = 0; o < obstacles.size(); ++o) {
      const ObstacleBox& box = scenario.obstacles[o];
      const double reach = geom_radius[g] + box.half_extents.norm();
      if ((geom_centers[g] - box.center).squaredNorm() < reach * reach) {
        collide(geom, obstacles[o], Surface::kObstacle, static_cast<int>(o));
      }
    }
  }
  for (const auto& [a, b] : model.collision_pairs) {
    const auto ga = static_cast<std::size_t>(a);
    const auto gb = static_cast<std::size_t>(b);
    const double reach = geom_radius[ga] + geom_radius[gb];
    if ((geom_centers[ga] - geom_centers[gb]).squaredNorm() < reach * reach) {
      collide(a, geoms[gb], Surface::kRobot, b);
    }
  }
}

void OdeWorld::Impl::collide(int geom, dGeomID other_geom, Surface surface, int other) {
  std::array<dContactGeom, kMaxPointsPerPair> points;
  const int count = dCollide(geoms[static_cast<std::size_t>(geom)], other_geom, kMaxPointsPerPair,
                             points.data(), sizeof(dContactGeom));
  for (int i = 0; i < count; ++i) {
    add_contact(points[static_cast<std::size_t>(i)], geom, surface, other);
  }
}

void OdeWorld::Impl::add_contact(const dContactGeom& point, int geom, Surface surface, int other) {
  if (contacts.size() >= kMaxContactPoints) {
    return;
  }
  ContactObservation seen;
  seen.geom = geom;
  seen.surface = surface;
  seen.other = other;
  seen.position = to_eigen(point.pos);
  seen.normal = to_eigen(point.normal);
  seen.depth = point.depth;

  const ContactMemory* before = recall(seen);
  const Eigen::Vector3d direction = friction_direction(seen, before);
  const Softness soft = soften(options.contact_stiffness, options.contact_damping, options.step);
  dContact contact{};
  contact.geom = point;
  contact.surface.mode = dContactSoftERP | dContactSoftCFM | dContactFDir1;
  contact.surface.soft_erp = soft.erp;
  contact.surface.soft_cfm = soft.cfm;
  for (int k = 0; k < 3; ++k) {
    contact.fdir1[k] = direction[k];
  }
  const double guess = before != nullptr ? before->normal_force : 0.0;
  const bool warm = options.stepper == OdeStepper::kQuick && guess > kWarmContact;
  if (warm) {
    const double bound = scenario.friction * guess;
    const double friction_guess =
        std::clamp(kFrictionLeak * before->tangential_force.dot(direction), 0.0, 0.5 * bound);
    contact.surface.mode |= dContactMu2 | dContactMotionN;
    contact.surface.mu = bound - friction_guess;
    contact.surface.mu2 = bound;
    contact.surface.motionN = -2.0 * soft.cfm * guess;
    seen.force = guess * seen.normal + friction_guess * direction;
    push(geom, surface, other, seen.position, seen.force);
    add_relief(point, seen, direction, guess, soft);
  } else {
    contact.surface.mode |= dContactApprox1_1 | dContactApprox1_2;
    contact.surface.mu = scenario.friction;
  }
  dJointID joint = dJointCreateContact(world, contact_group, &contact);
  dJointAttach(joint, dGeomGetBody(point.g1), dGeomGetBody(point.g2));
  dJointSetFeedback(joint, &contact_feedback[contacts.size()]);
  contacts.push_back(seen);
}

void OdeWorld::Impl::add_relief(const dContactGeom& point, const ContactObservation& seen,
                                const Eigen::Vector3d& tangent, double guess,
                                const Softness& soft) {
  dContact relief{};
  relief.geom = point;
  relief.geom.depth = 0.0;
  relief.surface.mode = dContactSoftERP | dContactSoftCFM | dContactFDir1 | dContactMu2 |
                        dContactMotion1 | dContactSlip1;
  relief.surface.soft_erp = 0.0;
  relief.surface.soft_cfm = 1e12;
  relief.surface.mu = guess;
  relief.surface.mu2 = 0.0;
  relief.surface.slip1 = soft.cfm;
  relief.surface.motion1 = soft.erp / options.step * seen.depth - soft.cfm * guess;
  for (int k = 0; k < 3; ++k) {
    relief.geom.normal[k] = tangent[k];
    relief.fdir1[k] = seen.normal[k];
  }
  dJointID joint = dJointCreateContact(world, contact_group, &relief);
  dJointAttach(joint, dGeomGetBody(point.g1), dGeomGetBody(point.g2));
  dJointSetFeedback(joint, &relief_feedback[contacts.size()]);
}

void OdeWorld::Impl::push(int geom, Surface surface, int other, const Eigen::Vector3d& p,
                          const Eigen::Vector3d& f) {
  const auto body_of = [this](int g) {
    return bodies[static_cast<std::size_t>(model.geoms[static_cast<std::size_t>(g)].body)];
  };
  dBodyAddForceAtPos(body_of(geom), f.x(), f.y(), f.z(), p.x(), p.y(), p.z());
  if (surface == Surface::kRobot) {
    dBodyAddForceAtPos(body_of(other), -f.x(), -f.y(), -f.z(), p.x(), p.y(), p.z());
  }
}

ContactMemory* OdeWorld::Impl::recall(const ContactObservation& contact) {
  ContactMemory* nearest = nullptr;
  double nearest_distance = kSamePoint;
  for (ContactMemory& old : memory) {
    if (!old.used && old.geom == contact.geom && old.surface == contact.surface &&
        old.other == contact.other) {
      const double distance = (old.position - contact.position).norm();
      if (distance < nearest_distance) {
        nearest_distance = distance;
        nearest = &old;
      }
    }
  }
  if (nearest != nullptr) {
    nearest->used = true;
  }
  return nearest;
}

Eigen::Vector3d OdeWorld::Impl::friction_direction(const ContactObservation& contact,
                                                   const ContactMemory* before) const {
  const Eigen::Vector3d& n = contact.normal;
  const auto body_of = [this](int geom) {
    return bodies[static_cast<std::size_t>(model.geoms[static_cast<std::size_t>(geom)].body)];
  };
  Eigen::Vector3d slip = velocity_at(body_of(contact.geom), contact.position);
  if (contact.surface == Surface::kRobot) {
    slip -= velocity_at(body_of(contact.other), contact.position);
  }
  slip -= n * n.dot(slip);
  if (slip.norm() > kSlipping) {
    return -slip.normalized();
  }
  if (before != nullptr) {
    const Eigen::Vector3d f = before->tangential_force - n * n.dot(before->tangential_force);
    if (f.norm() > kNegligibleFriction * scenario.friction * before->normal_force &&
        f.norm() > 1e-9) {
      return f.normalized();
    }
  }
  const Eigen::Vector3d reference =
      std::abs(n.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  return (reference - n * n.dot(reference)).normalized();
}

void OdeWorld::Impl::apply_joint_wrenches() {
  for (std::size_t i = 0; i < hinges.size(); ++i) {
    const auto parent = static_cast<std::size_t>(model.bodies[i + 1].parent);
    const Eigen::Matrix3d R = rotation_of(bodies[parent]);
    const Eigen::Vector3d f = R * wrenches[i].force;
    const Eigen::Vector3d m = R * wrenches[i].moment;
    const Eigen::Vector3d p = anchor_of(i);
    dBodyAddForceAtPos(bodies[i + 1], f.x(), f.y(), f.z(), p.x(), p.y(), p.z());
    dBodyAddTorque(bodies[i + 1], m.x(), m.y(), m.z());
    dBodyAddForceAtPos(bodies[parent], -f.x(), -f.y(), -f.z(), p.x(), p.y(), p.z());
    dBodyAddTorque(bodies[parent], -m.x(), -m.y(), -m.z());
  }
}

void OdeWorld::Impl::read_joint_wrenches() {
  for (std::size_t i = 0; i < hinges.size(); ++i) {
    const auto parent = static_cast<std::size_t>(model.bodies[i + 1].parent);
    const Eigen::Matrix3d R = rotation_of(bodies[parent]);
    const Eigen::Vector3d f = to_eigen(hinge_feedback[i].f1);
    const Eigen::Vector3d arm = anchor_of(i) - to_eigen(dBodyGetPosition(bodies[i + 1]));
    const Eigen::Vector3d m = to_eigen(hinge_feedback[i].t1) - arm.cross(f);
    wrenches[i].force += R.transpose() * f;
    wrenches[i].moment += R.transpose() * m;
  }
}

void OdeWorld::Impl::read_contact_forces() {
  memory.clear();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    ContactObservation& contact = contacts[i];
    if (contact.force != Eigen::Vector3d::Zero()) {
      contact.force += to_eigen(relief_feedback[i].f1);
    }
    contact.force += to_eigen(contact_feedback[i].f1);
    const double normal_force = contact.normal_force();
    memory.push_back({contact.geom, contact.surface, contact.other, contact.position,
                      contact.force - contact.normal * normal_force, normal_force});
  }
}

void OdeWorld::Impl::move_guide() {
  if (!guide_pose) {
    dJointAttach(guide_joint, nullptr, nullptr);
    guide_feedback = {};
    guide_previous.reset();
    return;
  }
  const Pose& target = *guide_pose;
  const Pose before = guide_previous.value_or(target);
  const Eigen::Vector3d linear = (target.p - before.p) / options.step;
  const Eigen::Vector3d angular = rotation_log(target.R * before.R.transpose()) / options.step;
  // The joint's reference is taken with base and guide in the same place.
  const Eigen::Vector3d com = target * model.bodies[0].com;
  if (!guide_previous) {
    const dReal* p = dBodyGetPosition(bodies[0]);
    dBodySetPosition(guide, p[0], p[1], p[2]);
    dBodySetRotation(guide, dBodyGetRotation(bodies[0]));
    dJointAttach(guide_joint, bodies[0], guide);
    dJointSetFixed(guide_joint);
  }
  dMatrix3 R;
  fill_rotation(target.R, R);
  const Eigen::Vector3d com_velocity = linear + angular.cross(com - target.p);
  dBodySetPosition(guide, com.x(), com.y(), com.z());
  dBodySetRotation(guide, R);
  dBodySetLinearVel(guide, com_velocity.x(), com_velocity.y(), com_velocity.z());
  dBodySetAngularVel(guide, angular.x(), angular.y(), angular.z());
  guide_previous = target;
}

void OdeWorld::Impl::advance(const JointVector& command) {
  dRandSetSeed(random_state);
  drive_joints(command);
  find_contacts();
  move_guide();
  if (options.stepper == OdeStepper::kQuick) {
    apply_joint_wrenches();
    dWorldQuickStep(world, options.step);
    read_joint_wrenches();
  } else {
    dWorldStep(world, options.step);
  }
  read_contact_forces();
  dJointGroupEmpty(contact_group);
  read_state();
  time += options.step;
  random_state = dRandGetSeed();
}

OdeWorld::OdeWorld(const RobotModel& model, const Scenario& scenario, const OdeOptions& options)
    : impl_(std::make_unique<Impl>(model, scenario, options)) {
  reset(start_configuration(model, scenario));
}

OdeWorld::~OdeWorld() = default;

void OdeWorld::reset(const Configuration& x) {
  reset(x, VelocityVector::Zero(impl_->model.velocity_count()));
}

void OdeWorld::reset(const Configuration& x, const VelocityVector& v) {
  Impl& w = *impl_;
  w.place(x, v);
  w.wrenches.assign(w.hinges.size(), JointWrench{});
  w.contacts.clear();
  w.memory.clear();
  w.guide_pose.reset();
  w.guide_previous.reset();
  w.guide_feedback = {};
  w.random_state = w.options.seed;
  w.time = 0.0;
}

void OdeWorld::step(const JointVector& tau) { impl_->advance(tau); }

void OdeWorld::set_base_guide(const std::optional<Pose>& X_WB) { impl_->guide_pose = X_WB; }

const RobotModel& OdeWorld::model() const { return impl_->model; }
const Scenario& OdeWorld::scenario() const { return impl_->scenario; }
const OdeOptions& OdeWorld::options() const { return impl_->options; }
double OdeWorld::time() const { return impl_->time; }
const Configuration& OdeWorld::configuration() const { return impl_->x; }
const VelocityVector& OdeWorld::velocity() const { return impl_->v; }
const JointVector& OdeWorld::drive_torque() const { return impl_->tau; }
std::span<const ContactObservation> OdeWorld::contacts() const { return impl_->contacts; }

const std::string& OdeWorld::surface_name(const ContactObservation& contact) const {
  const auto other = static_cast<std::size_t>(contact.other);
  switch (contact.surface) {
    case Surface::kObstacle:
      return impl_->scenario.obstacles[other].name;
    case Surface::kRobot:
      return impl_->model.geoms[other].name;
    case Surface::kFloor:
      break;
  }
  return impl_->floor_name;
}

Eigen::Vector3d OdeWorld::guide_force() const { return to_eigen(impl_->guide_feedback.f1); }

double OdeWorld::joint_separation() const {
  double worst = 0.0;
  for (dJointID hinge : impl_->hinges) {
    dVector3 a;
    dVector3 b;
    dJointGetHingeAnchor(hinge, a);
    dJointGetHingeAnchor2(hinge, b);
    worst = std::max(worst, (to_eigen(a) - to_eigen(b)).norm());
  }
  return worst;
}

}  // namespace clamber
