#include "robot_model/tree_builder.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "robot_model/collision_shapes.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/urdf_pose.hpp"

namespace clamber {
namespace {

// A continuous joint has no stops; planners and controllers want finite bounds. One turn each way.
constexpr double kContinuousRange = 2.0 * std::numbers::pi;

bool is_fixed(const urdf::Joint& joint) { return joint.type == urdf::Joint::FIXED; }

class TreeBuilder {
 public:
  TreeBuilder(const urdf::ModelInterface& document, const TreeOptions& options, RobotModel& model)
      : document_(document), options_(options), model_(model) {}

  void build() {
    check_added_mass_links();
    add_body(document_.getRoot(), -1, Pose{}, Eigen::Vector3d::UnitZ());
    for (const std::string& name : joint_order()) {
      add_joint(*document_.getJoint(name));
    }
    for (Body& body : model_.bodies) {
      finish_body(body);
    }
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(options_.file + ": " + what);
  }

  [[noreturn]] void fail_order(const std::string& what) const {
    throw InputError(options_.order_source + ": " + what);
  }

  void check_added_mass_links() const {
    for (const auto& [name, mass] : options_.added_mass) {
      const auto link = document_.getLink(name);
      if (!link || !link->inertial) {
        fail("link '" + name + "' takes ballast but has no <inertial> (or does not exist)");
      }
    }
  }

  void collect_joints(const urdf::Link& link, std::vector<std::string>& names) const {
    for (const auto& joint : link.child_joints) {
      if (!is_fixed(*joint)) {
        names.push_back(joint->name);
      }
      collect_joints(*document_.getLink(joint->child_link_name), names);
    }
  }

  [[nodiscard]] std::vector<std::string> joint_order() const {
    std::vector<std::string> in_tree;
    collect_joints(*document_.getRoot(), in_tree);
    if (static_cast<int>(in_tree.size()) > kMaxJoints) {
      fail(std::to_string(in_tree.size()) + " movable joints: expected at most " +
           std::to_string(kMaxJoints));
    }
    if (!options_.joint_order) {
      return in_tree;
    }
    const std::set<std::string> expected(in_tree.begin(), in_tree.end());
    std::set<std::string> listed;
    for (const std::string& name : *options_.joint_order) {
      if (!expected.contains(name)) {
        fail_order("the URDF has no movable joint '" + name + "'");
      }
      if (!listed.insert(name).second) {
        fail_order("joint '" + name + "' is listed twice");
      }
    }
    for (const std::string& name : in_tree) {
      if (!listed.contains(name)) {
        fail_order("the URDF's movable joint '" + name + "' is missing");
      }
    }
    return *options_.joint_order;
  }

  void add_joint(const urdf::Joint& joint) {
    const auto parent = X_BL_.find(joint.parent_link_name);
    if (parent == X_BL_.end()) {
      fail_order("joint '" + joint.name + "' comes before the joints that carry its parent link '" +
                 joint.parent_link_name + "': expected parents first");
    }
    model_.joints.push_back(read_joint(joint));
    const Eigen::Vector3d axis = from_urdf(joint.axis);
    const Pose X_PJ = parent->second.X_BF * from_urdf(joint.parent_to_joint_origin_transform);
    add_body(document_.getLink(joint.child_link_name), parent->second.body, X_PJ,
             axis.normalized());
  }

  [[nodiscard]] Joint read_joint(const urdf::Joint& joint) const {
    const std::string where = "joint '" + joint.name + "' ";
    if (joint.type != urdf::Joint::REVOLUTE && joint.type != urdf::Joint::CONTINUOUS) {
      fail(where +
           "is of a type that does not turn about one axis: expected revolute, continuous "
           "or fixed");
    }
    if (joint.mimic) {
      fail(where + "mimics another: expected independent joints");
    }
    if (!(from_urdf(joint.axis).norm() > 1e-6)) {
      fail(where + "has a zero axis");
    }
    if (!joint.limits) {
      fail(where + "has no <limit>: expected effort and velocity");
    }
    Joint result;
    result.name = joint.name;
    const bool turns_freely = joint.type == urdf::Joint::CONTINUOUS;
    result.lower = turns_freely ? -kContinuousRange : joint.limits->lower;
    result.upper = turns_freely ? kContinuousRange : joint.limits->upper;
    if (!(result.lower < result.upper)) {
      fail(where + "has lower limit " + std::to_string(result.lower) + " not below its upper " +
           std::to_string(result.upper));
    }
    result.velocity_limit = joint.limits->velocity;
    result.drive_torque_limit = joint.limits->effort;
    result.damping = joint.dynamics ? joint.dynamics->damping : 0.0;
    if (!(result.velocity_limit > 0.0) || !(result.drive_torque_limit > 0.0)) {
      fail(where + "has effort or velocity limit 0: expected both > 0");
    }
    if (!(result.damping >= 0.0)) {
      fail(where + "has negative damping");
    }
    return result;
  }

  void add_body(const urdf::LinkConstSharedPtr& link, int parent, const Pose& X_PJ,
                const Eigen::Vector3d& axis) {
    Body body;
    body.name = link->name;
    body.parent = parent;
    body.X_PJ = X_PJ;
    body.axis = axis;
    model_.bodies.push_back(body);
    add_link(*link, static_cast<int>(model_.bodies.size()) - 1, Pose{});
  }

  // Adds a link to a body, then everything that is fixed to the link.
  void add_link(const urdf::Link& link, int body, const Pose& X_BL) {
    const Frame frame{link.name, body, X_BL};
    X_BL_.emplace(link.name, frame);
    model_.frames.push_back(frame);
    add_inertia(link, model_.bodies[static_cast<std::size_t>(body)], X_BL);
    for (Geom geom : collision_shapes(link, options_.file)) {
      if (model_.find_geom(geom.name)) {
        fail("link '" + link.name + "': another collision is also named '" + geom.name + "'");
      }
      geom.body = body;
      geom.X_BG = X_BL * geom.X_BG;
      model_.geoms.push_back(geom);
    }
    for (const auto& joint : link.child_joints) {
      if (is_fixed(*joint)) {
        add_link(*document_.getLink(joint->child_link_name), body,
                 X_BL * from_urdf(joint->parent_to_joint_origin_transform));
      }
    }
  }

  // Until finish_body(), Body::com holds the first moment of mass and Body::inertia the inertia
  // about the body's origin: both add up over links.
  void add_inertia(const urdf::Link& link, Body& body, const Pose& X_BL) const {
    if (!link.inertial) {
      return;
    }
    const urdf::Inertial& inertial = *link.inertial;
    const auto ballast = options_.added_mass.find(link.name);
    const double added = ballast == options_.added_mass.end() ? 0.0 : ballast->second;
    const double mass = inertial.mass + added;
    if (!(inertial.mass > 0.0) || !(mass > 0.0)) {
      fail("link '" + link.name + "' has mass " + std::to_string(mass) +
           ": expected > 0 (leave <inertial> out for a frame)");
    }
    Eigen::Matrix3d I;
    I << inertial.ixx, inertial.ixy, inertial.ixz,  //
        inertial.ixy, inertial.iyy, inertial.iyz,   //
        inertial.ixz, inertial.iyz, inertial.izz;
    if (Eigen::LLT<Eigen::Matrix3d>(I).info() != Eigen::Success) {
      fail("link '" + link.name + "' has an inertia that is not positive definite");
    }
    const Pose X_BC = X_BL * from_urdf(inertial.origin);
    body.mass += mass;
    body.com += mass * X_BC.p;
    body.inertia +=
        (mass / inertial.mass) * (X_BC.R * I * X_BC.R.transpose()) + point_inertia(mass, X_BC.p);
  }

  [[nodiscard]] static Eigen::Matrix3d point_inertia(double mass, const Eigen::Vector3d& p) {
    return mass * (p.squaredNorm() * Eigen::Matrix3d::Identity() - p * p.transpose());
  }

  void finish_body(Body& body) {
    if (!(body.mass > 0.0)) {
      fail("body '" + body.name + "' moves but has no mass, nor has anything fixed to it");
    }
    body.com /= body.mass;
    body.inertia -= point_inertia(body.mass, body.com);
    body.inertia = (0.5 * (body.inertia + body.inertia.transpose())).eval();
    model_.total_mass += body.mass;
  }

  const urdf::ModelInterface& document_;
  const TreeOptions& options_;
  RobotModel& model_;
  std::map<std::string, Frame> X_BL_;  ///< links placed so far
};

}  // namespace

void build_tree(const urdf::ModelInterface& document, const TreeOptions& options,
                RobotModel& model) {
  TreeBuilder(document, options, model).build();
}

}  // namespace clamber
