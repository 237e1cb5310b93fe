#include "planner_offline/contacts/contact_sampler.hpp"

#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "planner_offline/contacts/standing_leg.hpp"

namespace clamber {
namespace {

using FclShape = std::shared_ptr<fcl::CollisionGeometryd>;

FclShape make_shape(const Geom& geom) {
  switch (geom.shape) {
    case Shape::kSphere:
      return std::make_shared<fcl::Sphered>(geom.radius);
    case Shape::kCapsule:
      return std::make_shared<fcl::Capsuled>(geom.radius, geom.length);
    case Shape::kBox:
      break;
  }
  return std::make_shared<fcl::Boxd>(2.0 * geom.half_extents);
}

fcl::Transform3d fcl_pose(const Pose& X) {
  fcl::Transform3d T = fcl::Transform3d::Identity();
  T.linear() = X.R;
  T.translation() = X.p;
  return T;
}

/// Where a sphere's centre meets the box's top face, or nothing when it meets another face.
/// All in the edge frame of a box of size (depth, width, height).
std::optional<Eigen::Vector3d> meets_top(const Eigen::Vector3d& centre,
                                         const Eigen::Vector3d& size) {
  const Eigen::Vector3d low(0.0, -0.5 * size.y(), -size.z());
  const Eigen::Vector3d high(size.x(), 0.5 * size.y(), 0.0);
  const Eigen::Vector3d nearest = centre.cwiseMax(low).cwiseMin(high);
  const Eigen::Vector3d off = centre - nearest;
  const double distance = off.norm();
  if (distance > 0.0) {
    return off.z() > distance * std::numbers::sqrt2 / 2.0 ? std::optional(nearest) : std::nullopt;
  }
  // The centre itself is inside: the face it is nearest to pushes it out.
  const double sides =
      std::min((centre - low).head<2>().minCoeff(), (high - centre).head<2>().minCoeff());
  if (high.z() - centre.z() > sides) {
    return std::nullopt;
  }
  return Eigen::Vector3d(centre.x(), centre.y(), 0.0);
}

Eigen::Vector3d mean(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) {
    sum += point;
  }
  return sum / static_cast<double>(points.size());
}

bool contains(const std::vector<ContactReference>& contacts, const std::string& link) {
  return std::any_of(contacts.begin(), contacts.end(),
                     [&](const ContactReference& contact) { return contact.link == link; });
}

/// What the stability measure needs of one posture's contacts, edge frame.
struct Touches {
  std::vector<LimbContact> loaded;
  std::vector<Eigen::Vector3d> support_points;
};

}  // namespace

Pose edge_frame(const ObstacleBox& box) {
  Pose X_WE;
  X_WE.R = Eigen::AngleAxisd(box.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  X_WE.p = box.center + X_WE.R * Eigen::Vector3d(-box.half_extents.x(), 0.0, box.half_extents.z());
  return X_WE;
}

struct ContactSampler::Impl {
  const RobotModel& model;
  ObstacleBox box;
  SamplerConfig config;
  Pose X_EW;
  fcl::CollisionObjectd obstacle;
  std::vector<fcl::CollisionObjectd> geoms;

  Impl(const RobotModel& robot, const ObstacleBox& obstacle_box, const SamplerConfig& settings)
      : model(robot),
        box(obstacle_box),
        config(settings),
        X_EW(edge_frame(obstacle_box).inverse()),
        obstacle(std::make_shared<fcl::Boxd>(2.0 * obstacle_box.half_extents),
                 fcl_pose({edge_frame(obstacle_box).R, obstacle_box.center})) {
    for (const Geom& geom : robot.geoms) {
      geoms.emplace_back(make_shape(geom));
    }
  }

  [[nodiscard]] double distance(int index, const RobotData& data) {
    const Geom& geom = model.geoms[static_cast<std::size_t>(index)];
    fcl::CollisionObjectd& object = geoms[static_cast<std::size_t>(index)];
    object.setTransform(fcl_pose(data.X_WB[static_cast<std::size_t>(geom.body)] * geom.X_BG));
    fcl::DistanceRequestd request;
    request.gjk_solver_type = fcl::GST_INDEP;
    request.enable_signed_distance = false;
    fcl::DistanceResultd result;
    fcl::distance(&object, &obstacle, request, result);
    return std::max(result.min_distance, 0.0);
  }

  [[nodiscard]] Eigen::Vector3d support_of(const ContactLink& link, const RobotData& data) const {
    return X_EW * (data.X_WB[static_cast<std::size_t>(link.support_body)] * link.support_point);
  }

  /// Points at which the link touches the floor, edge frame: a sphere's lowest point, the corners
  /// of a sole that are near.
  [[nodiscard]] std::vector<Eigen::Vector3d> on_floor(const ContactLink& link,
                                                      const RobotData& data) const {
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector3d& p_B : link.points) {
      Eigen::Vector3d p = data.X_WB[static_cast<std::size_t>(link.body)] * p_B;
      p.z() -= link.radius;
      if (p.z() <= config.threshold) {
        points.push_back(X_EW * p);
      }
    }
    return points;
  }

  /// Points at which the link meets the obstacle's top face, edge frame.
  [[nodiscard]] std::vector<Eigen::Vector3d> on_top(const ContactLink& link, const RobotData& data,
                                                    double reach) const {
    const Eigen::Vector3d size = 2.0 * box.half_extents;
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector3d& p_B : link.points) {
      const Eigen::Vector3d p = X_EW * (data.X_WB[static_cast<std::size_t>(link.body)] * p_B);
      if (p.z() - link.radius > reach) {
        continue;
      }
      // A sole's corner beside the obstacle is not on it: the sole overhangs the edge.
      const bool beside =
          link.is_patch && (p.x() < 0.0 || p.x() > size.x() || std::abs(p.y()) > 0.5 * size.y());
      if (const auto point = meets_top(p, size); point && !beside) {
        points.push_back(*point);
      }
    }
    return points;
  }

  /// The shank of a person who stands before a low obstacle leans on its edge; nobody kneels there.
  [[nodiscard]] bool stands(const ContactLink& link, const RobotData& data) const {
    return upright_over_foot(model, link, data) && !on_floor(*foot_of(model, link), data).empty();
  }

  bool touch_obstacle(const ContactLink& link, const RobotData& data, bool held,
                      ContactSample& sample, Touches& touches) {
    if (stands(link, data)) {
      return false;
    }
    const double reach = held ? config.release : config.threshold;
    if (distance(link.geom, data) > reach) {
      return false;
    }
    const std::vector<Eigen::Vector3d> points = on_top(link, data, reach);
    if (points.empty()) {
      return false;
    }
    const Eigen::Vector3d p = mean(points);
    const Eigen::Vector3d support = support_of(link, data);
    sample.obstacle.push_back({link.name, box.name, p, contact_stability(p, support)});
    touches.loaded.push_back({link.limb, p, support});
    touches.support_points.insert(touches.support_points.end(), points.begin(), points.end());
    return true;
  }

  void touch_floor(const ContactLink& link, const RobotData& data, ContactSample& sample,
                   Touches& touches) const {
    const std::vector<Eigen::Vector3d> points = on_floor(link, data);
    if (points.empty()) {
      return;
    }
    touches.support_points.insert(touches.support_points.end(), points.begin(), points.end());
    const bool limb_on_obstacle =
        std::any_of(touches.loaded.begin(), touches.loaded.end(),
                    [&](const LimbContact& contact) { return contact.limb == link.limb; });
    if (!limb_on_obstacle) {
      const Eigen::Vector3d p = mean(points);
      sample.floor.push_back({link.name, "floor", p, contact_stability(p, support_of(link, data))});
    }
  }
};

ContactSampler::ContactSampler(const RobotModel& model, const ObstacleBox& box,
                               const SamplerConfig& config)
    : impl_(std::make_unique<Impl>(model, box, config)) {}
ContactSampler::~ContactSampler() = default;

double ContactSampler::distance(int geom, const RobotData& data) const {
  return impl_->distance(geom, data);
}

ContactSample ContactSampler::sample(double time, const Configuration& x,
                                     const ContactSample* before) const {
  Impl& self = *impl_;
  RobotData data;
  forward_kinematics(self.model, x, data);
  Touches touches;
  ContactSample sample;
  sample.time = time;
  sample.posture = x;
  std::vector<bool> explained(self.model.geoms.size(), false);
  for (const ContactLink& link : self.model.contacts) {
    const bool held = before != nullptr && contains(before->obstacle, link.name);
    if (self.touch_obstacle(link, data, held, sample, touches)) {
      explained[static_cast<std::size_t>(link.geom)] = true;
    }
  }
  for (const ContactLink& link : self.model.contacts) {
    if (!contains(sample.obstacle, link.name)) {
      self.touch_floor(link, data, sample, touches);
    }
  }
  for (std::size_t g = 0; g < self.model.geoms.size(); ++g) {
    if (!explained[g] && self.distance(static_cast<int>(g), data) <= self.config.threshold) {
      sample.others.push_back(self.model.geoms[g].name);
    }
  }
  sample.stability = state_stability(touches.loaded, touches.support_points, self.X_EW * data.com,
                                     self.config.stability);
  return sample;
}

}  // namespace clamber
