// Tasks of Eqs. (4)-(7): their operators, and their Jacobians against finite differences.
#include "planner_offline/ik/task.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "planner_offline/ik/posture_ik.hpp"
#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kProbe = 1e-6;

/// Central differences of `value` under integrate(), one column per velocity coordinate.
Eigen::MatrixXd differences(const Configuration& x,
                            const std::function<VectorXd(const Configuration&)>& value) {
  Eigen::MatrixXd J(value(x).size(), coman().velocity_count());
  for (int i = 0; i < coman().velocity_count(); ++i) {
    J.col(i) = (value(moved(x, unit_step(i, kProbe))) - value(moved(x, unit_step(i, -kProbe)))) /
               (2.0 * kProbe);
  }
  return J;
}

class Tasks : public testing::TestWithParam<int> {
 protected:
  Tasks() : generator_(static_cast<unsigned>(GetParam())), x_(random_posture(generator_)) {
    data_ = data_at(x_);
  }
  std::mt19937 generator_;
  Configuration x_;
  RobotData data_;
};

TEST_P(Tasks, PointFollowsItsBody) {
  const int body = coman().contacts[static_cast<std::size_t>(link_of("Lwrist"))].body;
  const Vector3d local(0.03, -0.02, -0.1);
  const auto place = [&](const Configuration& x) -> VectorXd {
    return data_at(x).X_WB[static_cast<std::size_t>(body)] * local;
  };
  const Task task = point_task(coman(), data_, body, place(x_), {0.1, 0.2, 0.3});
  EXPECT_LT((task.J - differences(x_, place)).cwiseAbs().maxCoeff(), 1e-7);
  EXPECT_EQ(task.e, VectorXd(Vector3d(0.1, 0.2, 0.3)));
}

TEST_P(Tasks, PoseErrorVanishesAlongItsJacobian) {
  const int body = coman().contacts[static_cast<std::size_t>(link_of("Rfoot"))].body;
  const Pose here = data_.X_WB[static_cast<std::size_t>(body)];
  const auto error = [&](const Configuration& x) -> VectorXd {
    return pose_task(coman(), data_at(x), body, here).e;
  };
  EXPECT_LT(error(x_).norm(), 1e-12);
  // e is what is left to do: it falls as the pose advances.
  const Task task = pose_task(coman(), data_, body, here);
  EXPECT_LT((task.J + differences(x_, error)).cwiseAbs().maxCoeff(), 1e-6);

  const Vector3d turn(0.1, -0.2, 0.15), shift(0.02, 0.03, -0.04);
  const VectorXd e =
      pose_task(coman(), data_, body, {rotation_exp(turn) * here.R, here.p + shift}).e;
  EXPECT_LT((e.head<3>() - shift).norm(), 1e-12);
  EXPECT_LT((e.tail<3>() - turn).norm(), 1e-9);
}

TEST_P(Tasks, RelativePointIsSeenFromTheSupport) {
  const int support = coman().contacts[static_cast<std::size_t>(link_of("Rfoot"))].body;
  const int body = coman().contacts[static_cast<std::size_t>(link_of("Lknee"))].body;
  const Vector3d local(0.02, 0.01, -0.05);
  const Eigen::Matrix3d R = data_.X_WB[static_cast<std::size_t>(support)].R;
  const auto place = [&](const Configuration& x) -> VectorXd {
    const RobotData data = data_at(x);
    return R * (data.X_WB[static_cast<std::size_t>(support)].inverse() *
                (data.X_WB[static_cast<std::size_t>(body)] * local));
  };
  const Vector3d p = data_.X_WB[static_cast<std::size_t>(body)] * local;
  const Task task = relative_point_task(coman(), data_, support, body, p, Vector3d::Zero());
  EXPECT_LT((task.J - differences(x_, place)).cwiseAbs().maxCoeff(), 1e-7);
  // The robot moved as a whole changes nothing.
  EXPECT_LT(task.J.leftCols<6>().cwiseAbs().maxCoeff(), 1e-12);
}

TEST_P(Tasks, CentreOfMassMovesHorizontally) {
  const auto com = [](const Configuration& x) -> VectorXd { return data_at(x).com.head<2>(); };
  const Task task = com_task(coman(), data_, {0.01, 0.02});
  ASSERT_EQ(task.J.rows(), 2);
  EXPECT_LT((task.J - differences(x_, com)).cwiseAbs().maxCoeff(), 1e-7);
}

TEST_P(Tasks, PostureIsWhatIsLeftToDo) {
  const JointVector wanted = x_.q + 0.1 * JointVector::Ones(coman().joint_count());
  JointVector weight = JointVector::LinSpaced(coman().joint_count(), 0.5, 2.0);
  const auto posture = [&](const Configuration& x) -> VectorXd {
    return posture_task(coman(), x.q, wanted, weight).e;
  };
  EXPECT_LT((posture_task(coman(), x_.q, wanted, weight).J + differences(x_, posture))
                .cwiseAbs()
                .maxCoeff(),
            1e-7);
}

TEST_P(Tasks, ARollingContactsMaterialPointStays) {
  const int link = link_of("Rknee");
  const ContactLink& knee = coman().contacts[static_cast<std::size_t>(link)];
  Contact contact = make_contact(coman(), box(), data_, link, 0);
  const Task task = contact_task(coman(), data_, contact);
  ASSERT_EQ(task.J.rows(), 3);
  // The material point that is lowest now, fixed to the body.
  const Pose X_WB = data_.X_WB[static_cast<std::size_t>(knee.body)];
  const Vector3d local = X_WB.inverse() * touch_point(coman(), data_, link);
  const auto material = [&](const Configuration& x) -> VectorXd {
    return data_at(x).X_WB[static_cast<std::size_t>(knee.body)] * local;
  };
  EXPECT_LT((task.J - differences(x_, material)).cwiseAbs().maxCoeff(), 1e-7);

  // Along the task's null space: the material point stands still to first order, the sphere's
  // centre goes on by radius times turn (it rolls), and the height stays.
  const Eigen::MatrixXd kernel = task.J.fullPivLu().kernel();
  double rolled = 0.0;
  for (Eigen::Index i = 0; i < kernel.cols(); ++i) {
    constexpr double kStep = 1e-4;
    const VelocityVector dv = kStep * kernel.col(i).normalized();
    const Configuration next = moved(x_, dv);
    EXPECT_LT((material(next) - material(x_)).norm(), 20.0 * kStep * kStep);
    const RobotData after = data_at(next);
    const Vector3d travel = touch_point(coman(), after, link) - touch_point(coman(), data_, link);
    const Vector3d turn =
        rotation_log(after.X_WB[static_cast<std::size_t>(knee.body)].R * X_WB.R.transpose());
    const Vector3d rolling = turn.cross(Vector3d(0.0, 0.0, knee.radius));
    EXPECT_LT((travel - rolling).norm(), 20.0 * kStep * kStep);
    EXPECT_LT(std::abs(travel.z()), 20.0 * kStep * kStep);
    rolled = std::max(rolled, travel.norm());
  }
  EXPECT_GT(rolled, 1e-6);
}

TEST_P(Tasks, AContactsHeightIsCorrected) {
  const Scenario scenario = box();
  const int link = link_of("Lelb");
  const Contact contact = make_contact(coman(), scenario, data_, link, 0);
  const Task task = contact_task(coman(), data_, contact);
  EXPECT_EQ(task.e[0], 0.0);
  EXPECT_EQ(task.e[1], 0.0);
  EXPECT_NEAR(touch_point(coman(), data_, link).z() + task.e[2], scenario.obstacles[0].top(),
              1e-12);
}

TEST_P(Tasks, ARelaxedFootKeepsItsFrontEdgeAndMayLiftItsHeel) {
  Contact toe = make_contact(coman(), box(), data_, link_of("Lfoot"), kFloor);
  toe.mode = ContactMode::kToe;
  const Task task = contact_task(coman(), data_, toe);
  ASSERT_EQ(task.J.rows(), 6);
  Contact patch = toe;
  patch.mode = ContactMode::kPatch;
  EXPECT_EQ(contact_task(coman(), data_, patch).J.fullPivLu().rank(), 6);
  Eigen::FullPivLU<Eigen::MatrixXd> edge(task.J);
  edge.setThreshold(1e-9);
  EXPECT_EQ(edge.rank(), 5);  // turning about the edge is free
  for (const Vector3d& front : contact_points(coman(), data_, toe)) {
    for (const Vector3d& any : contact_points(coman(), data_, patch)) {
      const Vector3d ahead = data_
                                 .X_WB[static_cast<std::size_t>(
                                     coman().contacts[static_cast<std::size_t>(toe.link)].body)]
                                 .R.col(0);
      EXPECT_GE(ahead.dot(front - any), -1e-9);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Postures, Tasks, testing::Range(1, 6));

Task numbered(int rows, double start) {
  Task task{Eigen::MatrixXd(rows, coman().velocity_count()), VectorXd(rows)};
  for (int r = 0; r < rows; ++r) {
    task.J.row(r).setConstant(start + r);
    task.e[r] = 10.0 * (start + r);
  }
  return task;
}

TEST(TaskOperators, SumConcatenatesRows) {
  const Task sum = numbered(2, 1.0) + numbered(3, 5.0);  // Eqs. (5), (6)
  ASSERT_EQ(sum.J.rows(), 5);
  for (int r = 0; r < 5; ++r) {
    const double expected = r < 2 ? 1.0 + r : 3.0 + r;
    EXPECT_EQ(sum.J(r, 7), expected);
    EXPECT_EQ(sum.e[r], 10.0 * expected);
  }
  EXPECT_EQ((empty_task(coman()) + numbered(2, 1.0)).e.size(), 2);
  EXPECT_EQ((numbered(2, 1.0) + empty_task(coman())).e.size(), 2);
}

TEST(TaskOperators, SlashIsPriority) {
  const TaskStack stack = (numbered(1, 1.0) + numbered(1, 2.0)) / numbered(3, 3.0);  // Eq. (7)
  ASSERT_EQ(stack.size(), 2U);
  EXPECT_EQ(stack[0].e.size(), 2);
  EXPECT_EQ(stack[1].e.size(), 3);
  const TaskStack three = stack / numbered(1, 9.0);
  ASSERT_EQ(three.size(), 3U);
  EXPECT_EQ(three[2].e[0], 90.0);
}

TEST(TaskOperators, WeightAndShortening) {
  const Task task = scaled(numbered(2, 1.0), 0.5);
  EXPECT_EQ(task.J(1, 0), 1.0);
  EXPECT_EQ(task.e[1], 10.0);
  VectorXd e(3);
  e << 0.4, -0.8, 0.2;
  EXPECT_LT((shortened(e, 0.1) - e / 8.0).norm(), 1e-15);
  EXPECT_EQ(shortened(e, 1.0), e);
  EXPECT_EQ(shortened(VectorXd(), 1.0).size(), 0);
}

/// Two tasks that contradict each other: the second level takes nothing from the first, one level
/// of both meets in the middle.
TEST(TaskOperators, TheSolverKeepsTheOrder) {
  const Scenario scenario = box();
  const Configuration x = standing(scenario);
  const RobotData data = data_at(x);
  const Clearance clearance(coman(), scenario, {});
  PostureIk ik(coman(), clearance, {});
  const ContactSet held = feet(scenario, x);
  IkConstraints constraints;
  constraints.contacts = &held;
  constraints.collisions = false;
  const auto up = com_task(coman(), data, {0.005, 0.0});
  const auto down = com_task(coman(), data, {-0.005, 0.0});
  VelocityVector dv;
  ASSERT_EQ(ik.step(x, data, up / down, constraints, dv), HqpStatus::optimal);
  EXPECT_NEAR((up.J * dv)[0], 0.005, 1e-6);
  ASSERT_EQ(ik.step(x, data, TaskStack{up + down}, constraints, dv), HqpStatus::optimal);
  EXPECT_NEAR((up.J * dv)[0], 0.0, 1e-6);
}

}  // namespace
}  // namespace clamber
