// Static equilibrium: what the contact forces balance, keep and minimise, and when they cannot.
#include "planner_offline/certify/contact_forces.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "planner_offline/certify/support_region.hpp"
#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

const double kWeight = coman().total_mass * kGravity;

/// Hands, elbows and knees down, the back level.
Configuration on_all_fours() {
  JointVector q = on_forearms();
  kneel("L", q);
  kneel("R", q);
  return {{rotation_exp({0.0, 1.5, 0.0}), {0.1, 0.0, 0.55}}, q};
}

ContactSet points_of(const Configuration& x, const std::vector<std::string>& links) {
  const Scenario scenario = box();
  const RobotData data = data_at(x);
  ContactSet contacts;
  for (const std::string& link : links) {
    contacts.push_back(make_contact(coman(), scenario, data, link_of(link), 0));
  }
  return contacts;
}

ContactSet all_six(const Configuration& x) {
  return points_of(x, {"Lwrist", "Rwrist", "Lelb", "Relb", "Lknee", "Rknee"});
}

/// What is left of S' tau + sum J' f = g, by this test's own sum. Point contacts only.
VectorXd balance_left(const RobotData& data, const ContactSet& contacts,
                      const ForceSolution& solution) {
  VelocityVector g;
  gravity_torque(coman(), data, g);
  VectorXd left = g;
  left.tail(coman().joint_count()) -= solution.tau;
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    Jacobian3 J;
    point_jacobian(coman(), data, coman().contacts[static_cast<std::size_t>(contacts[c].link)].body,
                   touch_point(coman(), data, contacts[c].link), J);
    left -= J.transpose() * solution.forces[c];
  }
  return left;
}

TEST(ContactForces, BalanceTheRobotOnItsFeet) {
  const Scenario scenario = box();
  const Configuration x = standing(scenario);
  const RobotData data = data_at(x);
  ContactForces program(coman(), {});
  const ForceSolution solution = program.solve(data, feet(scenario, x));
  ASSERT_EQ(solution.status, Equilibrium::kFeasible);
  EXPECT_LT(solution.residual, 1e-6);
  const Vector3d sum = solution.forces[0] + solution.forces[1];
  EXPECT_LT((sum - Vector3d(0.0, 0.0, kWeight)).norm(), 1e-6);
  EXPECT_NEAR(solution.forces[0].z(), solution.forces[1].z(), 2.0);  // the posture is symmetric
  EXPECT_GE(solution.least_friction_slack, -1e-9);
}

TEST(ContactForces, BalanceTheRobotOnAllFours) {
  const Configuration x = on_all_fours();
  const RobotData data = data_at(x);
  const ForceSettings settings{.friction = 0.48};
  ContactForces program(coman(), settings);
  const ContactSet contacts = all_six(x);
  const ForceSolution solution = program.solve(data, contacts);
  ASSERT_EQ(solution.status, Equilibrium::kFeasible);
  EXPECT_LT(solution.residual, 1e-6);
  EXPECT_LT(balance_left(data, contacts, solution).norm(), 1e-6);

  Vector3d sum = Vector3d::Zero();
  double slack = 1e9;
  for (const Vector3d& f : solution.forces) {
    sum += f;
    slack = std::min(slack, settings.friction * f.z() - f.head<2>().norm());
    EXPECT_LE(std::max(std::abs(f.x()), std::abs(f.y())),
              settings.friction / std::sqrt(2.0) * f.z() + 1e-6);
  }
  EXPECT_LT((sum - Vector3d(0.0, 0.0, kWeight)).norm(), 1e-6);
  EXPECT_GE(slack, -1e-6);
  EXPECT_NEAR(solution.least_friction_slack, slack, 1e-9);

  double peak = 0.0, margin = 1e9;
  for (int j = 0; j < coman().joint_count(); ++j) {
    const double limit = coman().joints[static_cast<std::size_t>(j)].torque_limit;
    EXPECT_LE(std::abs(solution.tau[j]), settings.torque_share * limit + 1e-6);
    peak = std::max(peak, std::abs(solution.tau[j]));
    margin = std::min(margin, limit - std::abs(solution.tau[j]));
  }
  EXPECT_EQ(solution.peak_torque, peak);
  EXPECT_EQ(std::abs(solution.tau[solution.peak_joint]), peak);
  EXPECT_EQ(solution.torque_margin, margin);
}

/// Sum of squared load shares, and the small pull towards an even distribution.
double cost_of(const RobotData& data, const ContactSet& contacts, ForceSolution solution,
               const VectorXd& f, bool& feasible, const ForceSettings& settings) {
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    solution.forces[c] = f.segment<3>(3 * static_cast<Eigen::Index>(c));
    const Vector3d& fc = solution.forces[c];
    feasible = feasible && std::max(std::abs(fc.x()), std::abs(fc.y())) <=
                               settings.friction / std::sqrt(2.0) * fc.z() + 1e-9;
  }
  solution.tau.setZero();
  const VectorXd tau = balance_left(data, contacts, solution).tail(coman().joint_count());
  double cost = 1e-6 * f.squaredNorm();
  for (int j = 0; j < coman().joint_count(); ++j) {
    const double share = tau[j] / coman().joints[static_cast<std::size_t>(j)].torque_limit;
    feasible = feasible && std::abs(share) <= settings.torque_share + 1e-9;
    cost += share * share;
  }
  return cost;
}

TEST(ContactForces, NoOtherFeasibleForcesNeedLessTorque) {
  const Configuration x = on_all_fours();
  const RobotData data = data_at(x);
  const ForceSettings settings{.friction = 0.48};
  ContactForces program(coman(), settings);
  const ContactSet contacts = all_six(x);
  const ForceSolution solution = program.solve(data, contacts);
  ASSERT_EQ(solution.status, Equilibrium::kFeasible);
  VectorXd f(18);
  Eigen::MatrixXd G(6, 18);  // forces to wrench on the base
  for (std::size_t c = 0; c < 6; ++c) {
    f.segment<3>(3 * static_cast<Eigen::Index>(c)) = solution.forces[c];
    Jacobian3 J;
    point_jacobian(coman(), data, coman().contacts[static_cast<std::size_t>(contacts[c].link)].body,
                   touch_point(coman(), data, contacts[c].link), J);
    G.middleCols<3>(3 * static_cast<Eigen::Index>(c)) = J.leftCols<6>().transpose();
  }
  bool feasible = true;
  const double best = cost_of(data, contacts, solution, f, feasible, settings);
  EXPECT_TRUE(feasible);
  const Eigen::MatrixXd kernel = G.fullPivLu().kernel();
  ASSERT_EQ(kernel.cols(), 12);
  // Feasible points from tighter programs, shaken; the program is convex, so no step towards any of
  // them may lower the cost.
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  int compared = 0;
  for (const double friction : {0.1, 0.25, 0.4}) {
    for (const double least : {0.0, 8.0, 16.0}) {
      ContactForces tighter(coman(),
                            {.friction = friction, .torque_share = 0.9, .least_normal = least});
      const ForceSolution other = tighter.solve(data, contacts);
      ASSERT_EQ(other.status, Equilibrium::kFeasible);
      VectorXd there(18);
      for (std::size_t c = 0; c < 6; ++c) {
        there.segment<3>(3 * static_cast<Eigen::Index>(c)) = other.forces[c];
      }
      for (int i = 0; i < 500; ++i) {
        VectorXd shaken = there;
        for (Eigen::Index k = 0; i > 0 && k < kernel.cols(); ++k) {
          shaken += 0.5 * normal(generator) * kernel.col(k).normalized();
        }
        for (const double way : {1e-3, 0.1, 1.0}) {
          feasible = true;
          const double cost =
              cost_of(data, contacts, solution, f + way * (shaken - f), feasible, settings);
          if (feasible) {
            EXPECT_GE(cost, best - 1e-9) << "friction " << friction << " least " << least;
            ++compared;
          }
        }
      }
    }
  }
  EXPECT_GT(compared, 500);
}

/// The ankles turned by `lean`, the soles where they were.
Configuration leaning(const Configuration& upright, double lean) {
  Configuration x = upright;
  x.q[joint_of("LAnkSag")] += lean;
  x.q[joint_of("RAnkSag")] += lean;
  const auto foot =
      static_cast<std::size_t>(coman().contacts[static_cast<std::size_t>(link_of("Lfoot"))].body);
  x.X_WB = data_at(upright).X_WB[foot] * (data_at(x).X_WB[foot].inverse() * x.X_WB);
  return x;
}

/// On level feet the forces balance exactly where the centre of mass is above the soles.
TEST(ContactForces, LeaningOutOfTheSolesIsABalanceProblem) {
  const Scenario scenario = box();
  const Configuration upright = standing(scenario);
  ContactForces program(coman(), {.friction = 0.5, .torque_share = 100.0});
  int inside = 0, outside = 0;
  for (double lean = -0.4; lean <= 0.4; lean += 0.02) {
    const Configuration x = leaning(upright, lean);
    const RobotData data = data_at(x);
    const ContactSet contacts = feet(scenario, x);
    const double margin =
        SupportRegion(contact_points(coman(), data, contacts)).margin(data.com.head<2>());
    if (std::abs(margin) < 1e-4) {
      continue;
    }
    const ForceSolution solution = program.solve(data, contacts);
    EXPECT_EQ(solution.status, margin > 0.0 ? Equilibrium::kFeasible : Equilibrium::kBalance)
        << "lean " << lean << " margin " << margin;
    (margin > 0.0 ? inside : outside) += 1;
  }
  EXPECT_GT(inside, 10);
  EXPECT_GT(outside, 10);
}

TEST(ContactForces, TooLittleTorqueIsSaidToBeThat) {
  const Configuration x = on_all_fours();
  const RobotData data = data_at(x);
  ContactForces weak(coman(), {.friction = 0.48, .torque_share = 0.05});
  const ForceSolution solution = weak.solve(data, all_six(x));
  EXPECT_EQ(solution.status, Equilibrium::kTorque);
  EXPECT_GT(solution.peak_torque, 0.05 * 30.0);  // the forces that come nearest are told
  EXPECT_LT(solution.residual, 1e-6);

  ContactForces none(coman(), {});
  EXPECT_EQ(none.solve(data, {}).status, Equilibrium::kBalance);
}

TEST(ContactForces, FrictionThatIsNotThereIsNotUsed) {
  const Configuration x = on_all_fours();
  const RobotData data = data_at(x);
  ContactForces slippery(coman(), {.friction = 1e-4, .torque_share = 100.0});
  const ForceSolution solution = slippery.solve(data, all_six(x));
  ASSERT_EQ(solution.status, Equilibrium::kFeasible);
  for (const Vector3d& f : solution.forces) {
    EXPECT_LE(f.head<2>().norm(), 1e-4 * f.z() + 1e-6);
    EXPECT_GE(f.z(), -1e-9);
  }
}

TEST(ContactForces, EveryPointContactCarriesTheLeastForceAskedFor) {
  const Configuration x = on_all_fours();
  const RobotData data = data_at(x);
  ContactForces free(coman(), {.friction = 0.48, .torque_share = 100.0});
  ContactForces loaded(coman(), {.friction = 0.48, .torque_share = 100.0, .least_normal = 12.0});
  const auto least = [](const ForceSolution& solution) {
    double z = 1e9;
    for (const Vector3d& f : solution.forces) {
      z = std::min(z, f.z());
    }
    return z;
  };
  const ForceSolution without = free.solve(data, all_six(x)), with = loaded.solve(data, all_six(x));
  ASSERT_EQ(with.status, Equilibrium::kFeasible);
  EXPECT_LT(least(without), 12.0);  // or this test says nothing
  EXPECT_GE(least(with), 12.0 - 1e-6);
}

}  // namespace
}  // namespace clamber
