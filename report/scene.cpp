#include "report/scene.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "report/run_data.hpp"
#include "robot_model/kinematics.hpp"

namespace clamber {

namespace {

constexpr double kMetresPerNewton = 0.0018;
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

// Half the extent of a geom along the world's z.
double vertical_reach(const Geom& geom, const Pose& X_WG) {
  const Eigen::Vector3d up = X_WG.R.row(2).transpose().cwiseAbs();
  return geom.radius + 0.5 * geom.length * up.z() + geom.half_extents.dot(up);
}

// Corners of the room the standing robot takes and of the box, as far as the robot reaches on it.
std::vector<Eigen::Vector3d> points_to_show(const Scenario& scenario, double height) {
  std::vector<Eigen::Vector3d> points;
  const Eigen::AngleAxisd heading(scenario.start_yaw, Eigen::Vector3d::UnitZ());
  for (const double x : {-0.16, 0.16}) {
    for (const double y : {-0.2, 0.2}) {
      for (const double z : {0.0, 1.0}) {
        points.emplace_back(scenario.start_position + heading * Eigen::Vector3d(x, y, z) * height);
      }
    }
  }
  if (!scenario.obstacles.empty()) {
    const ObstacleBox& box = scenario.obstacles.front();
    const Eigen::AngleAxisd yaw(box.yaw, Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d half = box.half_extents.cwiseMin(0.5 * height);
    for (const double x : {-1.0, 1.0}) {
      for (const double y : {-1.0, 1.0}) {
        for (const double z : {-1.0, 1.0}) {
          points.emplace_back(box.center + yaw * half.cwiseProduct(Eigen::Vector3d(x, y, z)));
        }
      }
    }
  }
  return points;
}

// Moves a camera that looks along -back until all points lie inside a 4:3 picture.
Camera fit_camera(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& back) {
  constexpr double kAspect = 4.0 / 3.0;
  constexpr double kMargin = 1.05;
  constexpr int kRounds = 8;  // perspective makes centring and distance depend on each other
  const Eigen::Vector3d right = Eigen::Vector3d::UnitZ().cross(back).normalized();
  const Eigen::Vector3d up = back.cross(right);
  Camera camera;
  camera.field_of_view = 0.42;
  const double slope = std::tan(0.5 * camera.field_of_view);
  double distance = 4.0;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::max());
    Eigen::Array2d high = -low;
    double needed = 0.0;
    for (const Eigen::Vector3d& p : points) {
      const Eigen::Vector3d d = p - camera.target;
      const double depth = std::max(0.1, distance - d.dot(back));
      const Eigen::Array2d seen(d.dot(right) / depth, d.dot(up) / depth);
      low = low.min(seen);
      high = high.max(seen);
      const double reach = std::max(std::abs(d.dot(right)) / kAspect, std::abs(d.dot(up)));
      needed = std::max(needed, kMargin * reach / slope + d.dot(back));
    }
    const Eigen::Array2d middle = 0.5 * (low + high) * distance;
    camera.target += middle.x() * right + middle.y() * up;
    distance = needed;
  }
  camera.eye = camera.target + distance * back;
  return camera;
}

}  // namespace

double standing_height(const RobotModel& model) {
  RobotData data;
  Configuration home;
  home.q = model.home;
  forward_kinematics(model, home, data);
  double low = std::numeric_limits<double>::max();
  double high = std::numeric_limits<double>::lowest();
  for (const Geom& geom : model.geoms) {
    const Pose X_WG = data.X_WB[static_cast<std::size_t>(geom.body)] * geom.X_BG;
    const double reach = vertical_reach(geom, X_WG);
    low = std::min(low, X_WG.p.z() - reach);
    high = std::max(high, X_WG.p.z() + reach);
  }
  return std::max(0.3, high - low);
}

Camera make_camera(const Scenario& scenario, const RobotModel& model, View view) {
  const double azimuth = scenario.start_yaw + (view == View::kSide ? 1.5708 : 1.9);
  const double elevation = view == View::kSide ? 0.06 : 0.30;
  const Eigen::Vector3d back(std::cos(azimuth) * std::cos(elevation),
                             std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
  return fit_camera(points_to_show(scenario, standing_height(model)), back);
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
