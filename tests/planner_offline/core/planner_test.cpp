// Whole climbs of a made-up contact sequence. Every keyframe is judged by this file's own
// mechanics, not by the planner's.
#include "planner_offline/planner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

void no_progress(double, const std::string&) {}

/// The first climb that is found will do: the steadiest is a matter of more time.
PlannerSettings quick() {
  PlannerSettings settings;
  settings.search.steady_margin = -1.0;
  return settings;
}

const PlanningResult& climb_of(double height) {
  static std::map<double, PlanningResult> plans;
  const auto known = plans.find(height);
  if (known != plans.end()) {
    return known->second;
  }
  return plans[height] = plan_climb(coman(), box(height), made_climb(), quick(), no_progress);
}

const ContactLink& contact_link(const std::string& name) {
  return coman().contacts[static_cast<std::size_t>(link_of(name))];
}

/// A foot's force acts anywhere in its sole: the turning moments about the soles' centres that
/// make keyframe.tau and the contact forces balance gravity, 3 per foot in the order of contacts.
struct Mechanics {
  VectorXd moments;
  double left_over = 0.0;  ///< N and N m that no moments explain
};

Mechanics mechanics_of(const Keyframe& keyframe, const RobotData& data) {
  VelocityVector g;
  gravity_torque(coman(), data, g);
  VectorXd left = g;
  left.tail(coman().joint_count()) -= keyframe.tau;
  std::vector<Eigen::MatrixXd> turning;
  for (const PlannedContact& contact : keyframe.contacts) {
    const ContactLink& link = contact_link(contact.link);
    Jacobian3 J;
    point_jacobian(coman(), data, link.body, contact.position, J);
    left -= J.transpose() * contact.force;
    if (link.is_patch) {
      // Angular velocity from two points' difference: w x r for r along each axis.
      Eigen::MatrixXd W(3, coman().velocity_count());
      std::array<Jacobian3, 3> ahead;
      for (int axis = 0; axis < 3; ++axis) {
        point_jacobian(coman(), data, link.body, contact.position + Vector3d::Unit(axis),
                       ahead[static_cast<std::size_t>(axis)]);
        ahead[static_cast<std::size_t>(axis)] -= J;
      }
      W.row(0) = ahead[1].row(2);
      W.row(1) = ahead[2].row(0);
      W.row(2) = ahead[0].row(1);
      turning.push_back(W);
    }
  }
  Mechanics mechanics;
  if (turning.empty()) {
    mechanics.left_over = left.norm();
    return mechanics;
  }
  Eigen::MatrixXd T(coman().velocity_count(), 3 * static_cast<Eigen::Index>(turning.size()));
  for (std::size_t i = 0; i < turning.size(); ++i) {
    T.middleCols<3>(3 * static_cast<Eigen::Index>(i)) = turning[i].transpose();
  }
  mechanics.moments = T.colPivHouseholderQr().solve(left);
  mechanics.left_over = (left - T * mechanics.moments).norm();
  return mechanics;
}

/// The moment about the sole's centre is one that forces within the sole can make.
void expect_within_sole(const PlannedContact& contact, const Vector3d& moment,
                        const RobotData& data, double friction) {
  const ContactLink& link = contact_link(contact.link);
  const Eigen::Matrix3d& R = data.X_WB[static_cast<std::size_t>(link.body)].R;
  const Vector3d f = R.transpose() * contact.force, m = R.transpose() * moment;
  Vector3d low = link.points.front(), high = low;
  for (const Vector3d& p : link.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Vector3d half = 0.5 * (high - low);
  constexpr double kTolerance = 1e-4;  // m
  EXPECT_LE(std::abs(m.y()), (half.x() + kTolerance) * f.z() + 1e-6) << contact.link;
  EXPECT_LE(std::abs(m.x()), (half.y() + kTolerance) * f.z() + 1e-6) << contact.link;
  EXPECT_LE(std::abs(m.z()), friction * half.norm() * contact.force.norm() + 1e-6) << contact.link;
}

class Climb : public testing::TestWithParam<double> {
 protected:
  Climb() : scenario_(box(GetParam())), result_(climb_of(GetParam())) {}
  template <typename Check>
  void every_keyframe(Check check) {
    ASSERT_GT(result_.plan.keyframes.size(), 100U);
    for (const Keyframe& keyframe : result_.plan.keyframes) {
      SCOPED_TRACE("keyframe at " + std::to_string(keyframe.time) + " s, " +
                   result_.plan.phases[static_cast<std::size_t>(keyframe.phase)].name);
      check(keyframe, data_at(keyframe.x));
      if (HasFailure()) {
        return;  // the first one says enough
      }
    }
  }
  Scenario scenario_;
  const PlanningResult& result_;
};

TEST_P(Climb, ForcesCarryTheWeightWithoutTurningTheRobot) {
  const double weight = coman().total_mass * kGravity;
  every_keyframe([&](const Keyframe& keyframe, const RobotData& data) {
    Vector3d sum = Vector3d::Zero(), moment = Vector3d::Zero();
    const Mechanics mechanics = mechanics_of(keyframe, data);
    Eigen::Index foot = 0;
    for (const PlannedContact& contact : keyframe.contacts) {
      sum += contact.force;
      moment += (contact.position - data.com).cross(contact.force);
      if (contact_link(contact.link).is_patch) {
        moment += mechanics.moments.segment<3>(3 * foot++);
      }
    }
    EXPECT_LT((sum - Vector3d(0.0, 0.0, weight)).norm(), 0.01 * weight);
    EXPECT_LT(moment.norm(), 1e-3);
  });
}

TEST_P(Climb, ForcesStayInTheFrictionConesAndTheSoles) {
  const double friction = PlannerSettings{}.friction_share * scenario_.friction;
  every_keyframe([&](const Keyframe& keyframe, const RobotData& data) {
    const Mechanics mechanics = mechanics_of(keyframe, data);
    Eigen::Index foot = 0;
    for (const PlannedContact& contact : keyframe.contacts) {
      EXPECT_GE(contact.force.z(), -1e-6) << contact.link;
      EXPECT_LE(contact.force.head<2>().norm(), friction * contact.force.z() + 1e-6)
          << contact.link;
      if (contact_link(contact.link).is_patch) {
        expect_within_sole(contact, mechanics.moments.segment<3>(3 * foot++), data, friction);
      }
    }
  });
}

TEST_P(Climb, TorquesAreThoseThatHoldThePostureAndWithinLimits) {
  every_keyframe([&](const Keyframe& keyframe, const RobotData& data) {
    EXPECT_LT(mechanics_of(keyframe, data).left_over, 1e-3);
    double margin = 1e9;
    for (int j = 0; j < coman().joint_count(); ++j) {
      const Joint& joint = coman().joints[static_cast<std::size_t>(j)];
      margin = std::min(margin, joint.torque_limit - std::abs(keyframe.tau[j]));
      EXPECT_GE(keyframe.x.q[j], joint.lower) << joint.name;
      EXPECT_LE(keyframe.x.q[j], joint.upper) << joint.name;
    }
    EXPECT_GE(margin, 0.0);
    EXPECT_NEAR(margin, keyframe.torque_margin, 1e-9);
  });
}

TEST_P(Climb, ContactsAreOnTheirSurfaces) {
  constexpr double kTolerance = 0.004;  // m
  every_keyframe([&](const Keyframe& keyframe, const RobotData& data) {
    EXPECT_GE(keyframe.contacts.size(), 2U);
    for (const PlannedContact& contact : keyframe.contacts) {
      const ContactLink& link = contact_link(contact.link);
      EXPECT_LT((contact.position - touch_point(coman(), data, link_of(contact.link))).norm(),
                1e-9);
      if (link.is_patch) {
        EXPECT_EQ(contact.surface, "floor");
        double lowest = 1e9;  // a relaxed foot stands on its front edge
        for (const Vector3d& p : link.points) {
          lowest = std::min(lowest, (data.X_WB[static_cast<std::size_t>(link.body)] * p).z());
        }
        EXPECT_NEAR(lowest, 0.0, kTolerance) << contact.link;
      } else {
        EXPECT_EQ(contact.surface, scenario_.obstacles.front().name);
        EXPECT_NEAR(contact.position.z(), GetParam(), kTolerance) << contact.link;
        const Vector3d local = (contact.position - scenario_.obstacles.front().center).cwiseAbs();
        EXPECT_LE(local.x(), scenario_.obstacles.front().half_extents.x()) << contact.link;
        EXPECT_LE(local.y(), scenario_.obstacles.front().half_extents.y()) << contact.link;
      }
    }
  });
}

/// Contacts slide nowhere: from one keyframe to the next a point contact moves by no more than its
/// sphere rolls.
TEST_P(Climb, ContactsRollAndDoNotSlide) {
  const auto& keyframes = result_.plan.keyframes;
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    const RobotData before = data_at(keyframes[i - 1].x), after = data_at(keyframes[i].x);
    for (const PlannedContact& was : keyframes[i - 1].contacts) {
      for (const PlannedContact& is : keyframes[i].contacts) {
        const ContactLink& link = contact_link(is.link);
        if (was.link != is.link || link.is_patch) {
          continue;
        }
        const auto body = static_cast<std::size_t>(link.body);
        const double turn =
            rotation_log(after.X_WB[body].R * before.X_WB[body].R.transpose()).norm();
        constexpr double kSlack = 0.002;  // m
        ASSERT_LE((is.position - was.position).norm(), link.radius * turn + kSlack)
            << is.link << " at " << keyframes[i].time << " s";
      }
    }
  }
}

TEST_P(Climb, RobotKeepsClearOfWhatItDoesNotTouch) {
  every_keyframe([&](const Keyframe& keyframe, const RobotData&) {
    EXPECT_GT(keyframe.self_clearance, 0.0);
    EXPECT_GT(keyframe.obstacle_clearance, -0.004);
    EXPECT_GT(keyframe.support_margin, 0.0);
  });
}

TEST_P(Climb, EndsOnTheGoalsContactsInThePapersOrder) {
  std::vector<std::string> links;
  for (const PlannedContact& contact : result_.plan.keyframes.back().contacts) {
    links.push_back(contact.link);
  }
  EXPECT_THAT(links, testing::UnorderedElementsAreArray(scenario_.goal_contacts));
  std::map<std::string, double> first;
  for (const Keyframe& keyframe : result_.plan.keyframes) {
    for (const PlannedContact& contact : keyframe.contacts) {
      first.try_emplace(contact.link, keyframe.time);
    }
  }
  EXPECT_LT(first.at("Lwrist"), first.at("Lelb"));
  EXPECT_LT(first.at("Rwrist"), first.at("Relb"));
  EXPECT_LT(first.at("Lelb"), first.at("Lknee"));
  EXPECT_LT(first.at("Lknee"), first.at("Rknee"));
}

TEST_P(Climb, TimeRunsAndNoJointRaces) {
  const TimingSettings timing;
  const auto& keyframes = result_.plan.keyframes;
  EXPECT_EQ(keyframes.front().time, 0.0);
  EXPECT_LT((keyframes.front().x.q - coman().home).norm(), 1e-12);
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    const double dt = keyframes[i].time - keyframes[i - 1].time;
    ASSERT_GT(dt, 0.0);
    const double step = (keyframes[i].x.q - keyframes[i - 1].x.q).cwiseAbs().maxCoeff();
    EXPECT_LE(step / dt, 1.05 * timing.joint_speed) << keyframes[i].time;
    EXPECT_LE(step, 0.1) << "a jump at " << keyframes[i].time;
  }
}

INSTANTIATE_TEST_SUITE_P(Heights, Climb, testing::Values(0.20, 0.275, 0.35),
                         [](const auto& height_info) {
                           return std::to_string(static_cast<int>(1000.0 * height_info.param)) +
                                  "mm";
                         });

TEST(Planner, TheSameInputsGiveTheSamePlan) {
  const PlanningResult& first = climb_of(0.20);
  const PlanningResult again = plan_climb(coman(), box(0.20), made_climb(), quick(), no_progress);
  ASSERT_EQ(first.plan.keyframes.size(), again.plan.keyframes.size());
  EXPECT_EQ(first.candidates, again.candidates);
  EXPECT_EQ(first.rejected, again.rejected);
  for (std::size_t i = 0; i < first.plan.keyframes.size(); ++i) {
    const Keyframe &a = first.plan.keyframes[i], &b = again.plan.keyframes[i];
    ASSERT_EQ(a.time, b.time);
    ASSERT_EQ(a.x.q, b.x.q);
    ASSERT_EQ(a.x.X_WB.p, b.x.X_WB.p);
    ASSERT_EQ(a.x.X_WB.R, b.x.X_WB.R);
    ASSERT_EQ(a.tau, b.tau);
    ASSERT_EQ(a.contacts.size(), b.contacts.size());
    for (std::size_t c = 0; c < a.contacts.size(); ++c) {
      ASSERT_EQ(a.contacts[c].force, b.contacts[c].force);
    }
  }
}

TEST(Planner, ABoxThatIsTooHighFailsAndSaysWhere) {
  PlannerSettings settings = quick();
  settings.search.most_candidates = 3;
  settings.search.most_candidates_in_all = 60;
  std::string message;
  try {
    (void)plan_climb(coman(), box(0.8), made_climb(), settings, no_progress);
  } catch (const PlanningFailed& e) {
    message = e.what();
    ASSERT_NE(e.log(), nullptr);
    EXPECT_GT(e.log()->candidates, 0U);
    EXPECT_FALSE(e.log()->costs.empty());
    EXPECT_THAT(e.log()->rejected, testing::Contains(testing::HasSubstr("wrist")));
  }
  EXPECT_THAT(message, testing::HasSubstr("wrist"));
  EXPECT_THAT(message, testing::HasSubstr("height=0.8"));
  EXPECT_THAT(message, testing::HasSubstr("sets of contact places"));
}

TEST(Planner, AStartThatDoesNotDoIsRefusedBeforeAnythingIsSearched) {
  int asked = 0;
  std::string message;
  try {
    (void)plan_climb(coman(), box(), made_climb(), quick(), no_progress, [&](const Plan& plan) {
      ++asked;
      EXPECT_EQ(plan.phases.size(), 1U);
      return std::string("toes too near");
    });
  } catch (const PlanningFailed& e) {
    message = e.what();
    ASSERT_NE(e.log(), nullptr);
    EXPECT_EQ(e.log()->candidates, 0U);
  }
  EXPECT_EQ(asked, 1);
  EXPECT_THAT(message, testing::HasSubstr("the start of box_0.275"));
  EXPECT_THAT(message, testing::HasSubstr("toes too near"));
}

TEST(Planner, APlanThatHoldsForLessThanIsStatedIsRefusedWhereThatIsAsked) {
  PlannerSettings settings = quick();
  settings.search.as_stated = true;
  const auto message_for = [&](const std::vector<CertifiedFor>& rows) -> std::string {
    try {
      (void)plan_climb(coman(), box(), made_climb(), settings, no_progress, [&](Plan& plan) {
        plan.certified_for = rows;
        return std::string();
      });
    } catch (const PlanningFailed& e) {
      return e.what();
    }
    return "no failure";
  };
  // Standing at the start is asked about first.
  const CertifiedFor held{"obstacle height", "m", 0.01, 0.01};
  EXPECT_THAT(message_for({held, {"start position", "m", 0.02, 0.013}}),
              testing::HasSubstr("holds for less than is stated: start position 0.013 of 0.02 m"));
  EXPECT_THAT(message_for({}), testing::HasSubstr("not certified for anything"));
}

TEST(Planner, ASequenceForAnotherRobotIsAnInputError) {
  ContactSequence sequence = made_climb();
  sequence.reduced[0].obstacle[0].link = "Tail";
  EXPECT_THROW((void)plan_climb(coman(), box(), sequence, quick(), no_progress), InputError);
}

}  // namespace
}  // namespace clamber
