// Kinematics and dynamics against numeric differentiation and against the laws they must obey.
#include "robot_model/kinematics.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>

#include "tests/robot_model/test_robots.hpp"

namespace clamber {
namespace {

constexpr double kStep = 1e-6;
constexpr int kStates = 20;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

Eigen::Vector3d unskew(const Eigen::Matrix3d& S) {
  return 0.5 * Eigen::Vector3d(S(2, 1) - S(1, 2), S(0, 2) - S(2, 0), S(1, 0) - S(0, 1));
}

RobotData data_of(const RobotModel& model, const Configuration& x) {
  RobotData data;
  forward_kinematics(model, x, data);
  return data;
}

Configuration moved(const RobotModel& model, const Configuration& x, const VelocityVector& dv) {
  Configuration result;
  integrate(model, x, dv, result);
  return result;
}

double potential_energy(const RobotModel& model, const Configuration& x) {
  return model.total_mass * kGravity * data_of(model, x).com.z();
}

double kinetic_energy(const RobotModel& model, const Configuration& x, const VelocityVector& v) {
  MassMatrix M;
  mass_matrix(model, data_of(model, x), M);
  return 0.5 * v.dot(M * v);
}

class Kinematics : public testing::TestWithParam<const char*> {
 protected:
  Kinematics() : model_(load_test_robot(GetParam(), 1.0)), sampler_(model_, 11) {}

  VelocityVector unit(int column, double size) const {
    VelocityVector e = VelocityVector::Zero(model_.velocity_count());
    e[column] = size;
    return e;
  }

  RobotModel model_;
  StateSampler sampler_;
};

TEST_P(Kinematics, JacobiansAreTheDerivativesOfPoses) {
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler_.next();
    const RobotData data = data_of(model_, state.x);
    const int body = sampler_.body();
    const Eigen::Vector3d p_B = 0.2 * sampler_.vector(3);
    const Eigen::Vector3d p_W = data.X_WB[at(body)] * p_B;
    Jacobian6 J;
    Jacobian3 J_point;
    Jacobian3 J_com;
    frame_jacobian(model_, data, body, p_W, J);
    point_jacobian(model_, data, body, p_W, J_point);
    com_jacobian(model_, data, J_com);
    ASSERT_EQ(J.cols(), model_.velocity_count());
    EXPECT_LT((J.topRows<3>() - J_point).norm(), 1e-12);
    for (int column = 0; column < model_.velocity_count(); ++column) {
      const RobotData plus = data_of(model_, moved(model_, state.x, unit(column, kStep)));
      const RobotData minus = data_of(model_, moved(model_, state.x, unit(column, -kStep)));
      const Pose& X_plus = plus.X_WB[at(body)];
      const Pose& X_minus = minus.X_WB[at(body)];
      const Eigen::Vector3d linear = (X_plus * p_B - X_minus * p_B) / (2.0 * kStep);
      const Eigen::Vector3d angular = unskew(X_plus.R * X_minus.R.transpose()) / (2.0 * kStep);
      EXPECT_LT((J.col(column).head<3>() - linear).norm(), 1e-8) << column;
      EXPECT_LT((J.col(column).tail<3>() - angular).norm(), 1e-8) << column;
      EXPECT_LT((J_com.col(column) - (plus.com - minus.com) / (2.0 * kStep)).norm(), 1e-8);
    }
  }
}

TEST_P(Kinematics, GravityTorqueIsTheGradientOfPotentialEnergy) {
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler_.next();
    VelocityVector g;
    gravity_torque(model_, data_of(model_, state.x), g);
    ASSERT_EQ(g.size(), model_.velocity_count());
    for (int column = 0; column < model_.velocity_count(); ++column) {
      const double up = potential_energy(model_, moved(model_, state.x, unit(column, kStep)));
      const double down = potential_energy(model_, moved(model_, state.x, unit(column, -kStep)));
      EXPECT_NEAR(g[column], (up - down) / (2.0 * kStep), 1e-6) << column;
    }
    EXPECT_NEAR(g[2], model_.total_mass * kGravity, 1e-9);
  }
}

TEST_P(Kinematics, MassMatrixIsSymmetricPositiveAndMatchesInverseDynamics) {
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler_.next();
    const RobotData data = data_of(model_, state.x);
    MassMatrix M;
    mass_matrix(model_, data, M);
    EXPECT_LT((M - M.transpose()).norm(), 1e-12);
    EXPECT_EQ(Eigen::LLT<MassMatrix>(M).info(), Eigen::Success);
    VelocityVector tau;
    VelocityVector bias;
    const VelocityVector zero = VelocityVector::Zero(model_.velocity_count());
    inverse_dynamics(model_, data, state.v, state.a, tau);
    inverse_dynamics(model_, data, state.v, zero, bias);
    EXPECT_LT((tau - bias - M * state.a).norm(), 1e-9);
    VelocityVector g;
    gravity_torque(model_, data, g);
    inverse_dynamics(model_, data, zero, zero, bias);
    EXPECT_LT((g - bias).norm(), 1e-9);
  }
}

// The generalised force's power is the rate of the energy: catches any error in velocity terms.
TEST_P(Kinematics, PowerEqualsTheRateOfEnergy) {
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler_.next();
    VelocityVector tau;
    inverse_dynamics(model_, data_of(model_, state.x), state.v, state.a, tau);
    const auto energy = [&](double t) {
      const VelocityVector dv = t * state.v + 0.5 * t * t * state.a;
      const Configuration x = moved(model_, state.x, dv);
      return kinetic_energy(model_, x, state.v + t * state.a) + potential_energy(model_, x);
    };
    const double h = 1e-5;
    const double rate = (energy(h) - energy(-h)) / (2.0 * h);
    const double power = tau.dot(state.v);
    EXPECT_NEAR(power, rate, 1e-4 * std::max(1.0, std::abs(power)));
  }
}

// Newton: the base's linear part of M a + h is the rate of momentum plus the weight.
TEST_P(Kinematics, BaseForceIsTheRateOfMomentum) {
  for (int sample = 0; sample < kStates; ++sample) {
    const State state = sampler_.next();
    VelocityVector tau;
    inverse_dynamics(model_, data_of(model_, state.x), state.v, state.a, tau);
    const double h = 1e-4;
    const auto com = [&](double t) {
      const VelocityVector dv = t * state.v + 0.5 * t * t * state.a;
      return data_of(model_, moved(model_, state.x, dv)).com;
    };
    const Eigen::Vector3d acceleration = ((com(h) - 2.0 * com(0.0) + com(-h)) / (h * h)).eval();
    const Eigen::Vector3d expected =
        model_.total_mass * (acceleration + kGravity * Eigen::Vector3d::UnitZ());
    EXPECT_LT((tau.head<3>() - expected).norm(), 1e-3 * std::max(1.0, expected.norm()));
  }
}

INSTANTIATE_TEST_SUITE_P(Robots, Kinematics, testing::Values("coman", "testbot"));

TEST(Rotation, ExponentialAndLogarithmUndoEachOther) {
  for (const double angle : {0.0, 1e-12, 1e-9, 1e-7, 1e-4, 0.5, 2.0, 3.1, 3.1415926}) {
    const Eigen::Vector3d w = angle * Eigen::Vector3d(0.6, -0.48, 0.64);
    const Eigen::Matrix3d R = rotation_exp(w);
    EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14) << angle;
    EXPECT_LT((rotation_log(R) - w).norm(), 1e-9) << angle;
    EXPECT_LT(
        (R - Eigen::AngleAxisd(angle, w.norm() > 0 ? w.normalized() : Eigen::Vector3d::UnitX())
                 .toRotationMatrix())
            .norm(),
        1e-14)
        << angle;
  }
}

}  // namespace
}  // namespace clamber
