#include "report/scene.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "report/run_data.hpp"
#include "robot_model/kinematics.hpp"

namespace clamber {

namespace {

constexpr double kMetresPerNewton = 0.0014;
constexpr double kShownForce = 2.0;  // N

bool leads_to(const RobotModel& model, int body, int descendant) {
  while (descendant > body) {
    descendant = model.bodies[static_cast<std::size_t>(descendant)].parent;
  }
  return descendant == body;
}

// The limb that all contact links beyond `body` belong to, or "" for the trunk.
std::string limb_of(const RobotModel& model, int body) {
  std::string limb;
  for (const ContactLink& contact : model.contacts) {
    if (!leads_to(model, body, contact.body)) {
      continue;
    }
    if (!limb.empty() && limb != contact.limb) {
      return {};
    }
    limb = contact.limb;
  }
  return limb;
}

bool mentions(const std::string& text, const char* word) {
  return text.find(word) != std::string::npos;
}

Rgb limb_colour(const std::string& limb) {
  const bool arm = mentions(limb, "arm");
  if (mentions(limb, "left")) {
    return arm ? kLeftArm : kLeftLeg;
  }
  if (mentions(limb, "right")) {
    return arm ? kRightArm : kRightLeg;
  }
  return kTrunk;
}

Rgb scaled(Rgb c, double factor) {
  const auto channel = [factor](std::uint8_t v) {
    return static_cast<std::uint8_t>(std::clamp(std::lround(v * factor), 0L, 255L));
  };
  return {channel(c.r), channel(c.g), channel(c.b)};
}

ScenePrimitive obstacle_primitive(const ObstacleBox& box) {
  ScenePrimitive p;
  p.shape = Shape::kBox;
  p.X_WP.R = Eigen::AngleAxisd(box.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  p.X_WP.p = box.center;
  p.half_extents = box.half_extents;
  p.colour = kWood;
  p.material = Material::kWood;
  return p;
}

// Where a contact link touches from above: below its sphere, or the middle of its sole.
Eigen::Vector3d touch_point(const ContactLink& contact, const RobotData& data) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : contact.points) {
    sum += data.X_WB[static_cast<std::size_t>(contact.body)] * point;
  }
  sum /= std::max(1.0, static_cast<double>(contact.points.size()));
  return sum - contact.radius * Eigen::Vector3d::UnitZ();
}

}  // namespace

Camera make_camera(const Scenario& scenario, const RobotModel& model, View view) {
  // The robot's height standing, from its home posture on an unplaced base.
  RobotData data;
  Configuration home;
  home.q = model.home;
  forward_kinematics(model, home, data);
  double low = std::numeric_limits<double>::max();
  double high = std::numeric_limits<double>::lowest();
  for (const Geom& geom : model.geoms) {
    const Eigen::Vector3d p = data.X_WB[static_cast<std::size_t>(geom.body)] * geom.X_BG.p;
    low = std::min(low, p.z());
    high = std::max(high, p.z());
  }
  const double height = std::max(0.3, high - low);

  // The robot stands at one end of the picture, most of the box at the other.
  const Eigen::Rotation2Dd heading(scenario.start_yaw);
  const Eigen::Vector2d forward = heading * Eigen::Vector2d::UnitX();
  double back = -0.25 * height;
  double front = 0.4 * height;
  if (!scenario.obstacles.empty()) {
    const ObstacleBox& box = scenario.obstacles.front();
    const double centre =
        forward.dot(box.center.head<2>() - scenario.start_position.head<2>());
    front = std::max(front, std::min(centre + box.half_extents.x(), 0.95 * height));
  }
  const Eigen::Vector2d middle =
      scenario.start_position.head<2>() + forward * (0.5 * (back + front));

  Camera camera;
  const double top = 1.15 * height;
  camera.target = {middle.x(), middle.y(), 0.45 * top};
  camera.field_of_view = 0.42;
  const double half = std::max(0.5 * top, 0.5 * (front - back) * 0.85);
  const double distance = 1.16 * half / std::tan(0.5 * camera.field_of_view);
  const double azimuth = view == View::kSide ? 1.5708 : 1.02;
  const double elevation = view == View::kSide ? 0.06 : 0.36;
  const Eigen::Vector2d out = heading * Eigen::Vector2d(std::cos(azimuth), std::sin(azimuth));
  camera.eye = camera.target + distance * Eigen::Vector3d(out.x() * std::cos(elevation),
                                                          out.y() * std::cos(elevation),
                                                          std::sin(elevation));
  return camera;
}

Rgb geom_colour(const RobotModel& model, int geom) {
  for (const ContactLink& contact : model.contacts) {
    if (contact.geom == geom) {
      return kContactPoint;
    }
  }
  const int body = model.geoms[static_cast<std::size_t>(geom)].body;
  const std::string limb = limb_of(model, body);
  if (limb.empty()) {
    return body == 0 ? kPelvis : kTrunk;
  }
  // Neighbouring links differ a little, so that joints show.
  return scaled(limb_colour(limb), body % 2 == 0 ? 1.0 : 0.88);
}

Scene make_scene(const RobotModel& model, const Configuration& x, const Scenario& scenario) {
  RobotData data;
  forward_kinematics(model, x, data);
  Scene scene;
  for (const ObstacleBox& box : scenario.obstacles) {
    scene.primitives.push_back(obstacle_primitive(box));
  }
  for (std::size_t i = 0; i < model.geoms.size(); ++i) {
    const Geom& geom = model.geoms[i];
    ScenePrimitive p;
    p.shape = geom.shape;
    p.X_WP = data.X_WB[static_cast<std::size_t>(geom.body)] * geom.X_BG;
    p.radius = geom.radius;
    p.length = geom.length;
    p.half_extents = geom.half_extents;
    p.colour = geom_colour(model, static_cast<int>(i));
    scene.primitives.push_back(p);
  }
  return scene;
}

void add_contact_forces(const RobotModel& model, const TelemetryFrame& frame, Scene& scene) {
  RobotData data;
  forward_kinematics(model, measured_configuration(frame), data);
  const std::size_t count =
      std::min({model.contacts.size(), static_cast<std::size_t>(frame.contact_count),
                static_cast<std::size_t>(kMaxContacts)});
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d from = touch_point(model.contacts[i], data);
    for (const bool floor : {false, true}) {
      const double force = floor ? frame.force_floor[i] : frame.force_obstacle[i];
      if (force > kShownForce) {
        scene.arrows.push_back({from, kMetresPerNewton * force * Eigen::Vector3d::UnitZ(),
                                floor ? kForceFloor : kForceObstacle});
      }
    }
  }
}

}  // namespace clamber
