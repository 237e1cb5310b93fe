// FCL's distances against simple geometry, and which touches count as contacts.
#include "planner_offline/contacts/contact_sampler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

const std::filesystem::path kSource = CLAMBER_SOURCE_DIR;

ObstacleBox box_of(double depth, double width, double height) {
  ObstacleBox box;
  box.name = "box";
  box.half_extents = 0.5 * Eigen::Vector3d(depth, width, height);
  box.center = {0.5 * depth, 0.0, 0.5 * height};
  return box;
}

class Sampler : public testing::Test {
 protected:
  RobotModel model_ = load_robot(kSource / "configs/robots/coman/robot.yaml");
  std::mt19937 random_{7};

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  Configuration random_posture(const Eigen::Vector3d& position) {
    Configuration x;
    x.X_WB.p = position;
    x.X_WB.R = Eigen::Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1))
                   .normalized()
                   .toRotationMatrix();
    x.q = model_.home;
    for (int j = 0; j < model_.joint_count(); ++j) {
      const Joint& joint = model_.joints[static_cast<std::size_t>(j)];
      x.q[j] = uniform(joint.lower, joint.upper);
    }
    return x;
  }

  /// How far the geom reaches along `direction` (unit).
  double reach(const Geom& geom, const RobotData& data, const Eigen::Vector3d& direction) const {
    const Pose X = data.X_WB[static_cast<std::size_t>(geom.body)] * geom.X_BG;
    const Eigen::Vector3d d = X.R.transpose() * direction;
    const double centre = X.p.dot(direction);
    if (geom.shape == Shape::kBox) {
      return centre + geom.half_extents.dot(d.cwiseAbs());
    }
    return centre + 0.5 * geom.length * std::abs(d.z()) + geom.radius;
  }

  const ContactLink& link(const std::string& name) const {
    return model_.contacts[static_cast<std::size_t>(*model_.find_contact(name))];
  }

  /// A posture whose `name` point is at p (world); everything else hangs where it may.
  Configuration with_point_at(const std::string& name, const Eigen::Vector3d& p) const {
    Configuration x{Pose{}, model_.home};
    RobotData data;
    forward_kinematics(model_, x, data);
    const ContactLink& contact = link(name);
    x.X_WB.p += p - data.X_WB[static_cast<std::size_t>(contact.body)] * contact.points.front();
    return x;
  }
};

TEST_F(Sampler, FclDistancesAboveALargeTopAndBeforeALargeFront) {
  const ObstacleBox box = box_of(20.0, 20.0, 2.0);
  const ContactSampler sampler(model_, box, {});
  for (int i = 0; i < 200; ++i) {
    const bool above = i % 2 == 0;
    const Configuration x = random_posture(above ? Eigen::Vector3d(10.0, uniform(-1, 1), 3.2)
                                                 : Eigen::Vector3d(-1.2, uniform(-1, 1), 1.0));
    RobotData data;
    forward_kinematics(model_, x, data);
    const Eigen::Vector3d towards = above ? Eigen::Vector3d(0, 0, -1) : Eigen::Vector3d(1, 0, 0);
    for (std::size_t g = 0; g < model_.geoms.size(); ++g) {
      const double expected = above ? -reach(model_.geoms[g], data, towards) - 2.0
                                    : -reach(model_.geoms[g], data, towards);
      ASSERT_NEAR(sampler.distance(static_cast<int>(g), data), std::max(expected, 0.0), 2e-5)
          << model_.geoms[g].name << (above ? " above" : " before");
    }
  }
}

TEST_F(Sampler, FclDistanceToAnEdgeAndInPenetration) {
  const ContactSampler sampler(model_, box_of(0.9, 1.0, 0.275), {});
  const double radius = link("Lwrist").radius;
  RobotData data;
  const auto distance = [&](const Eigen::Vector3d& p) {
    forward_kinematics(model_, with_point_at("Lwrist", p), data);
    return sampler.distance(link("Lwrist").geom, data);
  };
  EXPECT_NEAR(distance({-0.3, 0.1, 0.275 + 0.4}), 0.5 - radius, 1e-6);
  EXPECT_NEAR(distance({0.3, 0.1, 0.275 + radius + 0.05}), 0.05, 1e-6);
  EXPECT_EQ(distance({0.3, 0.1, 0.275 + 0.5 * radius}), 0.0);
  EXPECT_EQ(distance({0.3, 0.1, 0.1}), 0.0);
}

TEST_F(Sampler, CountsOnlyTheTopFace) {
  const ContactSampler sampler(model_, box_of(0.9, 1.0, 0.275), {});
  const double radius = link("Lwrist").radius;
  const auto touches = [&](const Eigen::Vector3d& p) {
    const ContactSample sample = sampler.sample(0.0, with_point_at("Lwrist", p));
    return std::any_of(sample.obstacle.begin(), sample.obstacle.end(),
                       [](const ContactReference& c) { return c.link == "Lwrist"; });
  };
  EXPECT_TRUE(touches({0.3, 0.1, 0.275 + radius + 0.011}));
  EXPECT_FALSE(touches({0.3, 0.1, 0.275 + radius + 0.013}));
  EXPECT_TRUE(touches({0.3, 0.1, 0.275 + radius - 0.02})) << "pressed into the top";
  EXPECT_TRUE(touches({0.3, 0.1, 0.275 - 0.01})) << "centre below the top";
  EXPECT_TRUE(touches({-0.01, 0.1, 0.275 + 0.02})) << "over the edge";
  EXPECT_FALSE(touches({-0.02, 0.1, 0.275 + 0.01})) << "round the edge";
  EXPECT_FALSE(touches({-radius - 0.005, 0.1, 0.15})) << "against the front";
  EXPECT_FALSE(touches({0.02, 0.1, 0.15})) << "through the front";
}

TEST_F(Sampler, HoldsAContactUntilItsReleaseDistance) {
  const ContactSampler sampler(model_, box_of(0.9, 1.0, 0.275), {});
  const double radius = link("Lwrist").radius;
  const auto touches = [&](double gap, const ContactSample* before) {
    const ContactSample sample =
        sampler.sample(0.0, with_point_at("Lwrist", {0.3, 0.1, 0.275 + radius + gap}), before);
    return std::any_of(sample.obstacle.begin(), sample.obstacle.end(),
                       [](const ContactReference& c) { return c.link == "Lwrist"; });
  };
  const ContactSample away;
  ContactSample held;
  held.obstacle.push_back({"Lwrist", "box", Eigen::Vector3d::Zero(), 0.0});
  EXPECT_TRUE(touches(0.013, &held));
  EXPECT_TRUE(touches(0.017, &held));
  EXPECT_FALSE(touches(0.019, &held));
  EXPECT_FALSE(touches(0.013, &away)) << "no touch begins beyond the threshold";
  held.obstacle.front().link = "Rwrist";
  EXPECT_FALSE(touches(0.013, &held)) << "another link's contact does not hold this one";
}

TEST_F(Sampler, AKneeBeforeTheEdgeIsNoContactWhileItsLegStands) {
  Configuration x{Pose{}, model_.home};
  RobotData data;
  forward_kinematics(model_, x, data);
  const auto height_of = [&](const char* name) {
    const ContactLink& contact = link(name);
    return (data.X_WB[static_cast<std::size_t>(contact.body)] * contact.points.front()).z() -
           contact.radius;
  };
  const double shank = height_of("Lknee") - height_of("Lfoot");
  const auto touches = [&](double raised) {
    const ContactSampler sampler(model_, box_of(0.9, 1.0, shank + raised), {});
    const double z = shank + raised + link("Lknee").radius + 0.005;
    const ContactSample sample = sampler.sample(0.0, with_point_at("Lknee", {0.01, 0.1, z}));
    return std::any_of(sample.obstacle.begin(), sample.obstacle.end(),
                       [](const ContactReference& c) { return c.link == "Lknee"; });
  };
  EXPECT_FALSE(touches(0.0)) << "the foot is on the floor";
  EXPECT_TRUE(touches(0.10)) << "the foot hangs";
}

TEST_F(Sampler, GivesPositionsInTheEdgeFrameOfATurnedObstacle) {
  ObstacleBox box = box_of(0.9, 1.0, 0.275);
  box.yaw = 0.5;
  box.center = {2.0, -1.0, 0.1375};
  const ContactSampler sampler(model_, box, {});
  const Pose X_WE = edge_frame(box);
  const Eigen::Vector3d p_E(0.2, 0.15, 0.0);
  const double radius = link("Lwrist").radius;
  const Configuration x =
      with_point_at("Lwrist", X_WE * (p_E + Eigen::Vector3d(0, 0, radius + 0.005)));
  const ContactSample sample = sampler.sample(1.25, x);
  ASSERT_FALSE(sample.obstacle.empty());
  EXPECT_EQ(sample.obstacle.front().link, "Lwrist");
  EXPECT_EQ(sample.obstacle.front().surface, "box");
  EXPECT_TRUE(sample.obstacle.front().position.isApprox(p_E, 1e-9));
  EXPECT_EQ(sample.time, 1.25);
}

TEST_F(Sampler, SeesTheFeetOfAStandingRobotOnTheFloor) {
  Scenario scenario;
  scenario.obstacles = {box_of(0.9, 1.0, 0.275)};
  scenario.start_position = {-0.5, 0.0, 0.0};
  const ContactSampler sampler(model_, scenario.obstacles.front(), {});
  const ContactSample sample = sampler.sample(0.0, start_configuration(model_, scenario));
  EXPECT_TRUE(sample.obstacle.empty());
  EXPECT_TRUE(sample.others.empty());
  ASSERT_EQ(sample.floor.size(), 2u);
  EXPECT_NEAR(sample.floor[0].position.z(), -0.275, 1e-6);
  EXPECT_EQ(sample.stability, 0.0) << "no limb on the obstacle, centre of mass over the feet";
}

}  // namespace
}  // namespace clamber
