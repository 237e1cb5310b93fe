// Kinematics and dynamics against MuJoCo, which reads the same URDF text; only a floating joint
// above the root link is written into it.
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <memory>

#include "robot_model/read_file.hpp"
#include "tests/robot_model/test_robots.hpp"

namespace clamber {
namespace {

constexpr int kStates = 100;

struct MujocoDelete {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using MujocoModel = std::unique_ptr<mjModel, MujocoDelete>;
using MujocoData = std::unique_ptr<mjData, MujocoDelete>;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

MujocoModel load_mujoco(const std::string& robot, const std::string& root_link) {
  std::string text = read_file(robot_folder(robot) / (robot + ".urdf"));
  const std::string end = "</robot>";
  text.insert(text.rfind(end),
              "<link name=\"the_world\"/><joint name=\"the_base\" type=\"floating\">"
              "<parent link=\"the_world\"/><child link=\"" +
                  root_link + "\"/></joint>");
  const auto file =
      std::filesystem::path(testing::TempDir()) / ("clamber_mujoco_" + robot + ".urdf");
  std::ofstream(file) << text;
  std::array<char, 1000> error{};
  MujocoModel model(
      mj_loadXML(file.c_str(), nullptr, error.data(), static_cast<int>(error.size())));
  EXPECT_NE(model, nullptr) << error.data();
  return model;
}

class Mujoco : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    model_ = load_test_robot(GetParam());
    oracle_ = load_mujoco(GetParam(), model_.bodies[0].name);
    ASSERT_NE(oracle_, nullptr);
    ASSERT_EQ(oracle_->nv, model_.velocity_count());
    ASSERT_EQ(oracle_->nq, model_.velocity_count() + 1);
    ASSERT_EQ(oracle_->jnt_type[0], mjJNT_FREE);
    oracle_->opt.disableflags |= mjDSBL_CONSTRAINT;
    for (int i = 0; i < oracle_->nv; ++i) {
      oracle_->dof_damping[i] = 0.0;
      oracle_->dof_armature[i] = 0.0;
    }
    dof_ = {0, 1, 2, 3, 4, 5};
    body_ = {oracle_->jnt_bodyid[0]};
    for (const Joint& joint : model_.joints) {
      const int id = mj_name2id(oracle_.get(), mjOBJ_JOINT, joint.name.c_str());
      ASSERT_GE(id, 0) << joint.name;
      dof_.push_back(oracle_->jnt_dofadr[id]);
      body_.push_back(oracle_->jnt_bodyid[id]);
      oracle_->dof_armature[dof_.back()] = joint.reflected_inertia;
    }
    data_.reset(mj_makeData(oracle_.get()));
  }

  // MuJoCo's angular base velocity is in the base's frame: v_mujoco = T v, T = diag(1, R^T, 1).
  [[nodiscard]] Eigen::VectorXd to_oracle(const State& state, const VelocityVector& v) const {
    Eigen::VectorXd result(oracle_->nv);
    VelocityVector turned = v;
    turned.segment<3>(3) = state.x.X_WB.R.transpose() * v.segment<3>(3);
    for (std::size_t i = 0; i < dof_.size(); ++i) {
      result[dof_[i]] = turned[static_cast<Eigen::Index>(i)];
    }
    return result;
  }

  // Columns (of a Jacobian or a transposed force) from MuJoCo's coordinates to ours.
  [[nodiscard]] Eigen::MatrixXd columns_from_oracle(const State& state,
                                                    const Eigen::MatrixXd& theirs) const {
    Eigen::MatrixXd result(theirs.rows(), theirs.cols());
    for (std::size_t i = 0; i < dof_.size(); ++i) {
      result.col(static_cast<Eigen::Index>(i)) = theirs.col(dof_[i]);
    }
    result.middleCols(3, 3) = (result.middleCols(3, 3) * state.x.X_WB.R.transpose()).eval();
    return result;
  }

  void set_state(const State& state, const VelocityVector& v) {
    const Eigen::Quaterniond quat(state.x.X_WB.R);
    const std::array<double, 7> base = {state.x.X_WB.p.x(),
                                        state.x.X_WB.p.y(),
                                        state.x.X_WB.p.z(),
                                        quat.w(),
                                        quat.x(),
                                        quat.y(),
                                        quat.z()};
    std::copy(base.begin(), base.end(), data_->qpos);
    for (int i = 0; i < model_.joint_count(); ++i) {
      data_->qpos[1 + dof_[static_cast<std::size_t>(6 + i)]] = state.x.q[i];
    }
    const Eigen::VectorXd velocity = to_oracle(state, v);
    std::copy(velocity.begin(), velocity.end(), data_->qvel);
    mj_forward(oracle_.get(), data_.get());
  }

  [[nodiscard]] VelocityVector oracle_inverse_dynamics(const State& state, const VelocityVector& v,
                                                       const VelocityVector& a) {
    set_state(state, v);
    const Eigen::VectorXd acceleration = to_oracle(state, a);
    std::copy(acceleration.begin(), acceleration.end(), data_->qacc);
    mj_inverse(oracle_.get(), data_.get());
    const Eigen::Map<const Eigen::RowVectorXd> force(data_->qfrc_inverse, oracle_->nv);
    return columns_from_oracle(state, force).transpose();
  }

  RobotModel model_;
  MujocoModel oracle_;
  MujocoData data_;
  std::vector<int> dof_;   // our velocity index -> MuJoCo's
  std::vector<int> body_;  // our body index -> MuJoCo's
};

TEST_P(Mujoco, TotalMassAgrees) {
  EXPECT_NEAR(mj_getTotalmass(oracle_.get()), model_.total_mass, 1e-9);
}

TEST_P(Mujoco, PosesJacobiansAndCentreOfMassAgree) {
  StateSampler sampler(model_, 31);
  double worst = 0.0;
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler.next();
    set_state(state, state.v);
    RobotData data;
    forward_kinematics(model_, state.x, data);
    for (std::size_t b = 0; b < body_.size(); ++b) {
      const Eigen::Map<const Eigen::Vector3d> p(data_->xpos + 3 * body_[b]);
      const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(data_->xmat +
                                                                             9 * body_[b]);
      worst = std::max(worst, (data.X_WB[b].p - p).norm());
      worst = std::max(worst, (data.X_WB[b].R - R).norm());

      const Eigen::Vector3d point = data.X_WB[b] * Eigen::Vector3d(0.1, -0.2, 0.05);
      RowMajor linear(3, oracle_->nv);
      RowMajor angular(3, oracle_->nv);
      mj_jac(oracle_.get(), data_.get(), linear.data(), angular.data(), point.data(), body_[b]);
      Eigen::MatrixXd both(6, oracle_->nv);
      both << linear, angular;
      Jacobian6 J;
      frame_jacobian(model_, data, static_cast<int>(b), point, J);
      worst = std::max(worst, (J - columns_from_oracle(state, both)).cwiseAbs().maxCoeff());
    }
    const Eigen::Map<const Eigen::Vector3d> com(data_->subtree_com + 3 * body_[0]);
    worst = std::max(worst, (data.com - com).norm());
    RowMajor J_com_oracle(3, oracle_->nv);
    mj_jacSubtreeCom(oracle_.get(), data_.get(), J_com_oracle.data(), body_[0]);
    Jacobian3 J_com;
    com_jacobian(model_, data, J_com);
    worst =
        std::max(worst, (J_com - columns_from_oracle(state, J_com_oracle)).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(worst, 1e-8);
  std::printf("largest difference: %.1e\n", worst);
}

TEST_P(Mujoco, GravityInverseDynamicsAndMassMatrixAgree) {
  StateSampler sampler(model_, 32);
  double worst = 0.0;
  const VelocityVector zero = VelocityVector::Zero(model_.velocity_count());
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler.next();
    RobotData data;
    forward_kinematics(model_, state.x, data);
    VelocityVector tau;
    gravity_torque(model_, data, tau);
    worst =
        std::max(worst, (tau - oracle_inverse_dynamics(state, zero, zero)).cwiseAbs().maxCoeff());
    inverse_dynamics(model_, data, state.v, state.a, tau);
    worst = std::max(
        worst, (tau - oracle_inverse_dynamics(state, state.v, state.a)).cwiseAbs().maxCoeff());

    RowMajor M_oracle(oracle_->nv, oracle_->nv);
    mj_fullM(oracle_.get(), M_oracle.data(), data_->qM);
    MassMatrix M;
    mass_matrix(model_, data, M);
    const Eigen::MatrixXd half = columns_from_oracle(state, M_oracle);
    const Eigen::MatrixXd expected = columns_from_oracle(state, half.transpose());
    worst = std::max(worst, (M - expected).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(worst, 1e-6);
  std::printf("largest difference: %.1e\n", worst);
}

INSTANTIATE_TEST_SUITE_P(Robots, Mujoco, testing::Values("coman", "testbot"));

}  // namespace
}  // namespace clamber
