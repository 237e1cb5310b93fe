#include "report/scene_json.hpp"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "report/scene.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

Json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json numbers(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  return {q.w(), q.x(), q.y(), q.z()};
}

const char* name_of(Shape shape) {
  switch (shape) {
    case Shape::kSphere:
      return "sphere";
    case Shape::kCapsule:
      return "capsule";
    case Shape::kBox:
      return "box";
  }
  return "";
}

std::string hexadecimal(Rgb colour) {
  char text[8];
  std::snprintf(text, sizeof text, "#%02x%02x%02x", colour.r, colour.g, colour.b);
  return text;
}

Json geoms(const RobotModel& model) {
  Json list = Json::array();
  for (std::size_t i = 0; i < model.geoms.size(); ++i) {
    const Geom& geom = model.geoms[i];
    list.push_back({{"body", geom.body},
                    {"shape", name_of(geom.shape)},
                    {"p", numbers(geom.X_BG.p)},
                    {"R", numbers(geom.X_BG.R)},
                    {"radius", geom.radius},
                    {"length", geom.length},
                    {"half", numbers(geom.half_extents)},
                    {"colour", hexadecimal(geom_colour(model, static_cast<int>(i)))}});
  }
  return list;
}

Json bodies(const RobotModel& model) {
  Json list = Json::array();
  for (const Body& body : model.bodies) {
    const bool base = body.parent < 0;
    list.push_back({{"parent", body.parent},
                    {"p", numbers(body.X_PJ.p)},
                    {"R", numbers(body.X_PJ.R)},
                    {"axis", numbers(base ? Eigen::Vector3d::UnitZ() : body.axis)}});
  }
  return list;
}

Json contacts(const RobotModel& model) {
  Json list = Json::array();
  for (const ContactLink& contact : model.contacts) {
    Json points = Json::array();
    for (const Eigen::Vector3d& point : contact.points) points.push_back(numbers(point));
    list.push_back({{"name", contact.name},
                    {"body", contact.body},
                    {"points", points},
                    {"radius", contact.radius}});
  }
  return list;
}

}  // namespace

std::string scene_json(const RobotModel& model, const Scenario& scenario) {
  Json json = {{"robot", model.name},         {"height", standing_height(model)},
               {"yaw", scenario.start_yaw},   {"joints", Json::array()},
               {"bodies", bodies(model)},     {"geoms", geoms(model)},
               {"contacts", contacts(model)}, {"obstacles", Json::array()}};
  for (const Joint& joint : model.joints)
    json["joints"].push_back({{"name", joint.name}, {"limit", joint.torque_limit}});
  for (const ObstacleBox& box : scenario.obstacles)
    json["obstacles"].push_back(
        {{"center", numbers(box.center)}, {"half", numbers(box.half_extents)}, {"yaw", box.yaw}});
  return json.dump();
}

}  // namespace clamber
