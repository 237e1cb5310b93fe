// Kinematics and dynamics against Orocos KDL, on a tree built here straight from the URDF. The
// floating base is three sliding and three turning joints in a chain above the root link.
#include <gtest/gtest.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cstdio>
#include <kdl/tree.hpp>
#include <kdl/treefksolverpos_recursive.hpp>
#include <kdl/treeidsolver_recursive_newton_euler.hpp>
#include <kdl/treejnttojacsolver.hpp>

#include "robot_model/read_file.hpp"
#include "tests/robot_model/test_robots.hpp"

namespace clamber {
namespace {

constexpr int kStates = 100;

KDL::Vector to_kdl(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

KDL::Frame to_kdl(const urdf::Pose& pose) {
  const urdf::Rotation& r = pose.rotation;
  return {KDL::Rotation::Quaternion(r.x, r.y, r.z, r.w), to_kdl(pose.position)};
}

Eigen::Vector3d to_eigen(const KDL::Vector& v) { return {v.x(), v.y(), v.z()}; }

KDL::RigidBodyInertia to_kdl(const urdf::InertialSharedPtr& inertial) {
  if (!inertial) {
    return KDL::RigidBodyInertia::Zero();
  }
  const KDL::RotationalInertia I(inertial->ixx, inertial->iyy, inertial->izz, inertial->ixy,
                                 inertial->ixz, inertial->iyz);
  return to_kdl(inertial->origin) * KDL::RigidBodyInertia(inertial->mass, KDL::Vector::Zero(), I);
}

void add_children(KDL::Tree& tree, const urdf::Link& link) {
  for (const auto& child : link.child_links) {
    const urdf::Joint& joint = *child->parent_joint;
    const KDL::Frame F = to_kdl(joint.parent_to_joint_origin_transform);
    const KDL::Joint turning =
        joint.type == urdf::Joint::FIXED
            ? KDL::Joint(joint.name, KDL::Joint::None)
            : KDL::Joint(joint.name, F.p, F.M * to_kdl(joint.axis), KDL::Joint::RotAxis);
    tree.addSegment(KDL::Segment(child->name, turning, F, to_kdl(child->inertial)), link.name);
    add_children(tree, *child);
  }
}

KDL::Tree floating_tree(const std::filesystem::path& urdf_file) {
  const auto document = urdf::parseURDF(read_file(urdf_file));
  KDL::Tree tree("world");
  const std::array<KDL::Joint::JointType, 6> types = {KDL::Joint::TransX, KDL::Joint::TransY,
                                                      KDL::Joint::TransZ, KDL::Joint::RotX,
                                                      KDL::Joint::RotY,   KDL::Joint::RotZ};
  std::string above = "world";
  for (std::size_t i = 0; i < types.size(); ++i) {
    const bool is_last = i + 1 == types.size();
    const std::string name = is_last ? document->getRoot()->name : "float" + std::to_string(i);
    tree.addSegment(
        KDL::Segment(
            name, KDL::Joint("base" + std::to_string(i), types[i]), KDL::Frame::Identity(),
            is_last ? to_kdl(document->getRoot()->inertial) : KDL::RigidBodyInertia::Zero()),
        above);
    above = name;
  }
  add_children(tree, *document->getRoot());
  return tree;
}

// Rates of the X-Y-Z base angles to world angular velocity, w = E rates, and its time derivative.
struct BaseAngles {
  Eigen::Vector3d angles;
  Eigen::Matrix3d E;

  explicit BaseAngles(const Eigen::Matrix3d& R) : angles(R.eulerAngles(0, 1, 2)) {
    const Eigen::Matrix3d Rx =
        Eigen::AngleAxisd(angles[0], Eigen::Vector3d::UnitX()).toRotationMatrix();
    const Eigen::Matrix3d Ry =
        Eigen::AngleAxisd(angles[1], Eigen::Vector3d::UnitY()).toRotationMatrix();
    E << Eigen::Vector3d::UnitX(), Rx.col(1), (Rx * Ry).col(2);
  }

  [[nodiscard]] Eigen::Matrix3d derivative(const Eigen::Vector3d& rates) const {
    Eigen::Matrix3d E_dot;
    const Eigen::Vector3d w1 = rates[0] * E.col(0);
    const Eigen::Vector3d w2 = w1 + rates[1] * E.col(1);
    E_dot << Eigen::Vector3d::Zero(), w1.cross(E.col(1)), w2.cross(E.col(2));
    return E_dot;
  }
};

class Kdl : public testing::TestWithParam<const char*> {
 protected:
  Kdl()
      : model_(load_test_robot(GetParam())),
        tree_(floating_tree(robot_folder(GetParam()) / (std::string(GetParam()) + ".urdf"))),
        size_(tree_.getNrOfJoints()) {
    for (unsigned i = 0; i < 6; ++i) {
      column_.push_back(kdl_index("base" + std::to_string(i)));
    }
    for (const Joint& joint : model_.joints) {
      column_.push_back(kdl_index(joint.name));
    }
  }

  // Index in KDL's joint arrays of a joint's name.
  [[nodiscard]] unsigned kdl_index(const std::string& joint) const {
    for (const auto& [name, element] : tree_.getSegments()) {
      if (element.segment.getJoint().getName() == joint) {
        return element.q_nr;
      }
    }
    ADD_FAILURE() << "KDL has no joint " << joint;
    return 0;
  }

  // Our vector (base part as given) in KDL's order.
  [[nodiscard]] KDL::JntArray ordered(const Eigen::VectorXd& ours) const {
    KDL::JntArray result(size_);
    for (std::size_t i = 0; i < column_.size(); ++i) {
      result(column_[i]) = ours[static_cast<Eigen::Index>(i)];
    }
    return result;
  }

  [[nodiscard]] Eigen::VectorXd positions(const State& state, const BaseAngles& base) const {
    Eigen::VectorXd q(size_);
    q << state.x.X_WB.p, base.angles, state.x.q;
    return q;
  }

  RobotModel model_;
  KDL::Tree tree_;
  unsigned size_;
  std::vector<unsigned> column_;  // our velocity index -> KDL's joint index
};

TEST_P(Kdl, PosesAndJacobiansAgree) {
  ASSERT_EQ(static_cast<int>(size_), model_.velocity_count());
  KDL::TreeFkSolverPos_recursive fk(tree_);
  KDL::TreeJntToJacSolver jacobian(tree_);
  StateSampler sampler(model_, 21);
  double worst = 0.0;
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler.next();
    const BaseAngles base(state.x.X_WB.R);
    const KDL::JntArray q = ordered(positions(state, base));
    RobotData data;
    forward_kinematics(model_, state.x, data);
    for (const Frame& frame : model_.frames) {
      KDL::Frame F;
      ASSERT_GE(fk.JntToCart(q, F, frame.name), 0);
      const Pose X = data.X_WB[static_cast<std::size_t>(frame.body)] * frame.X_BF;
      worst = std::max(worst, (X.p - to_eigen(F.p)).norm());
      worst = std::max(worst, (X.R.col(0) - to_eigen(F.M.UnitX())).norm());
      worst = std::max(worst, (X.R.col(1) - to_eigen(F.M.UnitY())).norm());

      KDL::Jacobian J_kdl(size_);
      ASSERT_GE(jacobian.JntToJac(q, J_kdl, frame.name), 0);
      Jacobian6 J;
      frame_jacobian(model_, data, frame.body, X.p, J);
      Eigen::MatrixXd expected(6, size_);
      for (std::size_t i = 0; i < column_.size(); ++i) {
        expected.col(static_cast<Eigen::Index>(i)) =
            J_kdl.data.col(static_cast<Eigen::Index>(column_[i]));
      }
      expected.middleCols(3, 3) *= base.E.inverse();  // from angle rates to angular velocity
      worst = std::max(worst, (J - expected).cwiseAbs().maxCoeff());
    }
  }
  EXPECT_LT(worst, 1e-8);
  std::printf("largest difference: %.1e\n", worst);
}

TEST_P(Kdl, InverseDynamicsGravityAndMassMatrixAgree) {
  KDL::TreeIdSolver_RNE solver(tree_, KDL::Vector(0.0, 0.0, -kGravity));
  StateSampler sampler(model_, 22);
  double worst = 0.0;
  // KDL's torques in our coordinates; its tree knows no reflected inertia.
  const auto kdl_dynamics = [&](const State& state, const VelocityVector& v,
                                const VelocityVector& a) {
    const BaseAngles base(state.x.X_WB.R);
    Eigen::VectorXd rates = v;
    rates.segment<3>(3) = base.E.inverse() * v.segment<3>(3);
    Eigen::VectorXd accelerations = a;
    accelerations.segment<3>(3) =
        base.E.inverse() *
        (a.segment<3>(3) - base.derivative(rates.segment<3>(3)) * rates.segment<3>(3));
    KDL::JntArray torques(size_);
    EXPECT_EQ(solver.CartToJnt(ordered(positions(state, base)), ordered(rates),
                               ordered(accelerations), KDL::WrenchMap(), torques),
              0);
    VelocityVector result(static_cast<Eigen::Index>(size_));
    for (std::size_t i = 0; i < column_.size(); ++i) {
      result[static_cast<Eigen::Index>(i)] = torques(column_[i]);
    }
    result.segment<3>(3) = (base.E.transpose().inverse() * result.segment<3>(3)).eval();
    for (int i = 0; i < model_.joint_count(); ++i) {
      result[6 + i] += model_.joints[static_cast<std::size_t>(i)].reflected_inertia * a[6 + i];
    }
    return result;
  };
  const VelocityVector zero = VelocityVector::Zero(model_.velocity_count());
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler.next();
    RobotData data;
    forward_kinematics(model_, state.x, data);
    VelocityVector tau;
    inverse_dynamics(model_, data, state.v, state.a, tau);
    worst = std::max(worst, (tau - kdl_dynamics(state, state.v, state.a)).cwiseAbs().maxCoeff());
    gravity_torque(model_, data, tau);
    const VelocityVector g_kdl = kdl_dynamics(state, zero, zero);
    worst = std::max(worst, (tau - g_kdl).cwiseAbs().maxCoeff());
    MassMatrix M;
    mass_matrix(model_, data, M);
    for (int column = 0; column < model_.velocity_count(); ++column) {
      VelocityVector e = zero;
      e[column] = 1.0;
      const VelocityVector M_column = kdl_dynamics(state, zero, e) - g_kdl;
      worst = std::max(worst, (M.col(column) - M_column).cwiseAbs().maxCoeff());
    }
  }
  EXPECT_LT(worst, 1e-6);
  std::printf("largest difference: %.1e\n", worst);
}

INSTANTIATE_TEST_SUITE_P(Robots, Kdl, testing::Values("coman", "testbot"));

}  // namespace
}  // namespace clamber
