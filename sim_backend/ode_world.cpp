#include "sim_backend/ode_world.hpp"

#include <ode/ode.h>

#include <string>
#include <vector>

#include "robot_model/kinematics.hpp"
#include "sim_backend/ode_contacts.hpp"
#include "sim_backend/ode_conversions.hpp"
#include "sim_backend/ode_guide.hpp"
#include "sim_backend/ode_joints.hpp"

namespace clamber {
namespace {

// Share of a hinge's error that is taken back per step: with ODE's 0.2 few iterations pump energy
// into a swinging robot. The world's softness only keeps the exact stepper's matrix regular where
// contacts are redundant.
constexpr double kHingeErp = 0.05;
constexpr double kWorldCfm = 1e-9;

dWorldID create_world(const OdeOptions& options) {
  // Never closed: worlds may live until the process ends.
  static const bool initialised =
      dInitODE2(0) != 0 && dAllocateODEDataForThread(dAllocateMaskAll) != 0;
  static_cast<void>(initialised);
  dWorldID world = dWorldCreate();
  dWorldSetGravity(world, options.gravity.x(), options.gravity.y(), options.gravity.z());
  dWorldSetERP(world, kHingeErp);
  dWorldSetCFM(world, kWorldCfm);
  dWorldSetQuickStepNumIterations(world, options.iterations);
  return world;
}

std::vector<dBodyID> create_bodies(dWorldID world, const RobotModel& model) {
  std::vector<dBodyID> bodies;
  for (const Body& body : model.bodies) {
    dBodyID id = dBodyCreate(world);
    const Eigen::Matrix3d& I = body.inertia;
    dMass mass;
    dMassSetParameters(&mass, body.mass, 0, 0, 0, I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2),
                       I(1, 2));
    dBodySetMass(id, &mass);
    bodies.push_back(id);
  }
  return bodies;
}

/// Velocities of the bodies' frames for a generalised velocity.
struct BodyVelocity {
  Eigen::Vector3d linear;  ///< of the origin, m/s
  Eigen::Vector3d angular;
};
std::vector<BodyVelocity> body_velocities(const RobotModel& model, const RobotData& data,
                                          const VelocityVector& v) {
  std::vector<BodyVelocity> velocities{{v.head<3>(), v.segment<3>(3)}};
  for (std::size_t b = 1; b < model.bodies.size(); ++b) {
    const auto parent = static_cast<std::size_t>(model.bodies[b].parent);
    const Eigen::Vector3d& omega = velocities[parent].angular;
    velocities.push_back(
        {velocities[parent].linear + omega.cross(data.X_WB[b].p - data.X_WB[parent].p),
         omega + data.axis_W[b] * v[static_cast<Eigen::Index>(5 + b)]});
  }
  return velocities;
}

RobotData place_bodies(const std::vector<dBodyID>& bodies, const RobotModel& model,
                       const Configuration& x, const VelocityVector& v) {
  RobotData data;
  forward_kinematics(model, x, data);
  const std::vector<BodyVelocity> velocities = body_velocities(model, data, v);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const Eigen::Vector3d& p = data.com_W[b];
    const Eigen::Vector3d& omega = velocities[b].angular;
    const Eigen::Vector3d velocity = velocities[b].linear + omega.cross(p - data.X_WB[b].p);
    dMatrix3 R;
    fill_rotation(data.X_WB[b].R, R);
    dBodySetPosition(bodies[b], p.x(), p.y(), p.z());
    dBodySetRotation(bodies[b], R);
    dBodySetLinearVel(bodies[b], velocity.x(), velocity.y(), velocity.z());
    dBodySetAngularVel(bodies[b], omega.x(), omega.y(), omega.z());
    dBodySetForce(bodies[b], 0, 0, 0);
    dBodySetTorque(bodies[b], 0, 0, 0);
  }
  return data;
}

Configuration zero_configuration(const RobotModel& model) {
  Configuration x;
  x.q = JointVector::Zero(model.joint_count());
  return x;
}

}  // namespace

struct OdeWorld::Impl {
  Impl(const RobotModel& robot_model, const Scenario& world_scenario,
       const OdeOptions& ode_options);

  void reset(const Configuration& x0, const VelocityVector& v0);
  void advance(const JointVector& command);
  void read_state();

  const RobotModel model;
  const Scenario scenario;
  const OdeOptions options;

  /// Outlives everything below that is made in it.
  struct World {
    explicit World(const OdeOptions& options) : id(create_world(options)) {}
    ~World() { dWorldDestroy(id); }
    World(const World&) = delete;
    World& operator=(const World&) = delete;
    dWorldID id;
  } world;
  const std::vector<dBodyID> bodies;
  OdeJoints joints;
  OdeContacts contacts;
  OdeGuide guide;

  unsigned long random_state = 0;
  double time = 0.0;
  Configuration x;
  VelocityVector v;
  std::string floor_name = "floor";
};

OdeWorld::Impl::Impl(const RobotModel& robot_model, const Scenario& world_scenario,
                     const OdeOptions& ode_options)
    : model(robot_model),
      scenario(world_scenario),
      options(ode_options),
      world(options),
      bodies(create_bodies(world.id, model)),
      joints(model, options, world.id, bodies,
             place_bodies(bodies, model, zero_configuration(model),
                          VelocityVector::Zero(model.velocity_count()))),
      contacts(model, scenario, options, world.id, bodies),
      guide(world.id, bodies[0], model.bodies[0].com, options) {}

void OdeWorld::Impl::reset(const Configuration& x0, const VelocityVector& v0) {
  place_bodies(bodies, model, x0, v0);
  x = x0;
  v = v0;
  joints.forget(x0.q, v0);
  contacts.forget();
  guide.set_target(std::nullopt);
  guide.move();
  random_state = options.seed;
  time = 0.0;
}

void OdeWorld::Impl::advance(const JointVector& command) {
  // ODE's random numbers are global: each world goes on with its own.
  dRandSetSeed(random_state);
  joints.drive(command, x.q, v);
  contacts.detect();
  guide.move();
  if (options.stepper == OdeStepper::kQuick) {
    dWorldQuickStep(world.id, options.step);
  } else {
    dWorldStep(world.id, options.step);
  }
  joints.read();
  contacts.read_forces();
  guide.read();
  read_state();
  time += options.step;
  random_state = dRandGetSeed();
}

void OdeWorld::Impl::read_state() {
  x.X_WB.R = rotation_of(bodies[0]);
  x.X_WB.p = position_of(bodies[0]) - x.X_WB.R * model.bodies[0].com;
  v.head<3>() = velocity_at(bodies[0], x.X_WB.p);
  v.segment<3>(3) = to_eigen(dBodyGetAngularVel(bodies[0]));
  for (std::size_t i = 0; i < model.joints.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    x.q[j] = joints.angle(i, x.q[j]);
    v[6 + j] = joints.rate(i);
  }
}

OdeWorld::OdeWorld(const RobotModel& model, const Scenario& scenario, const Configuration& x,
                   const OdeOptions& options)
    : impl_(std::make_unique<Impl>(model, scenario, options)) {
  reset(x);
}

OdeWorld::OdeWorld(const RobotModel& model, const Scenario& scenario, const OdeOptions& options)
    : OdeWorld(model, scenario, start_configuration(model, scenario), options) {}

OdeWorld::~OdeWorld() = default;

void OdeWorld::reset(const Configuration& x) {
  impl_->reset(x, VelocityVector::Zero(impl_->model.velocity_count()));
}

void OdeWorld::reset(const Configuration& x, const VelocityVector& v) { impl_->reset(x, v); }

void OdeWorld::step(const JointVector& tau) { impl_->advance(tau); }

void OdeWorld::set_base_guide(const std::optional<Pose>& X_WB) { impl_->guide.set_target(X_WB); }

const RobotModel& OdeWorld::model() const { return impl_->model; }
const Scenario& OdeWorld::scenario() const { return impl_->scenario; }
const OdeOptions& OdeWorld::options() const { return impl_->options; }
double OdeWorld::time() const { return impl_->time; }
const Configuration& OdeWorld::configuration() const { return impl_->x; }
const VelocityVector& OdeWorld::velocity() const { return impl_->v; }
const JointVector& OdeWorld::drive_torque() const { return impl_->joints.torque(); }

JointVector OdeWorld::motor_position() const {
  return impl_->options.springs ? impl_->joints.motor_position() : impl_->x.q;
}

JointVector OdeWorld::motor_rate() const {
  return impl_->options.springs ? impl_->joints.motor_rate()
                                : JointVector(impl_->v.tail(impl_->x.q.size()));
}

std::span<const ContactObservation> OdeWorld::contacts() const {
  return impl_->contacts.observations();
}

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

Eigen::Vector3d OdeWorld::guide_force() const { return impl_->guide.force(); }

double OdeWorld::joint_separation() const { return impl_->joints.separation(); }

}  // namespace clamber
