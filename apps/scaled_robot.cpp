#include "apps/scaled_robot.hpp"

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <cmath>
#include <initializer_list>
#include <pugixml.hpp>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "apps/options.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

std::string shortest(double value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value);
  return {text, end.ptr};
}

/// Every number of the attribute times `factor`. (load_robot() has read them before.)
void scale(pugi::xml_node node, const char* attribute, double factor) {
  pugi::xml_attribute found = node.attribute(attribute);
  if (found.empty()) return;
  std::istringstream numbers(found.value());
  std::string scaled;
  for (double value = 0.0; numbers >> value;)
    scaled += (scaled.empty() ? "" : " ") + shortest(value * factor);
  found.set_value(scaled.c_str());
}

struct Factors {
  double length, mass, inertia, torque, stiffness, damping, integral, speed;

  Factors(double s, ScaledTorque choice)
      : length(s),
        mass(std::pow(s, 3)),
        inertia(std::pow(s, 5)),
        torque(choice == ScaledTorque::kKept ? 1.0 : std::pow(s, 3)),
        stiffness(std::pow(s, 4)),
        damping(std::pow(s, 4.5)),
        integral(std::pow(s, 3.5)),
        speed(std::pow(s, -0.5)) {}
};

void scale_tree(pugi::xml_node node, const Factors& by) {
  const std::string name = node.name();
  if (name == "origin") scale(node, "xyz", by.length);
  if (name == "box") scale(node, "size", by.length);
  if (name == "mass") scale(node, "value", by.mass);
  if (name == "sphere" || name == "cylinder")
    for (const char* key : {"radius", "length"}) scale(node, key, by.length);
  if (name == "inertia")
    for (const char* key : {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}) scale(node, key, by.inertia);
  if (name == "limit") {
    scale(node, "effort", by.torque);
    scale(node, "velocity", by.speed);
  }
  if (name == "dynamics") {
    scale(node, "damping", by.damping);
    scale(node, "friction", by.torque);
  }
  for (const pugi::xml_node child : node.children()) scale_tree(child, by);
}

std::string scaled_urdf(const fs::path& file, const Factors& by, const std::string& remark) {
  pugi::xml_document urdf;
  const std::string text = read_file(file);
  const pugi::xml_parse_result parsed = urdf.load_buffer(text.data(), text.size());
  if (!parsed) throw InputError(file.string() + ": " + parsed.description());
  scale_tree(urdf, by);
  urdf.prepend_child(pugi::node_comment).set_value((" " + remark + " ").c_str());
  std::ostringstream out;
  urdf.save(out, "  ");
  return out.str();
}

void scale(YAML::Node map, const char* key, double factor) {
  if (map[key]) map[key] = shortest(map[key].as<double>() * factor);
}

void scale_gains(const YAML::Node& gains, const Factors& by) {
  scale(gains, "kp", by.stiffness);
  scale(gains, "ki", by.integral);
  scale(gains, "kd", by.damping);
}

void scale_drives(const YAML::Node& drives, const Factors& by) {
  scale(drives, "torque_limit", by.torque);
  scale(drives, "reflected_inertia", by.inertia);
  scale(drives, "spring_stiffness", by.stiffness);
  scale(drives, "spring_damping", by.damping);
  scale_gains(drives, by);
}

std::string text_of(const YAML::Node& root, const std::string& remark) {
  std::ostringstream out;
  out << "# " << remark << '\n' << root << '\n';
  return out.str();
}

}  // namespace

void write_scaled_robot(const fs::path& robot, double s, ScaledTorque torque,
                        const fs::path& folder) {
  if (!(s >= 0.1 && s <= 10.0)) throw InputError("scale: expected 0.1 to 10");
  const RobotModel original = load_robot(robot);  // complains about what is wrong
  const fs::path from = robot.parent_path();
  const Factors by(s, torque);
  const std::string remark = original.name + " scaled by " + shortest(s) + ", torque limits " +
                             (torque == ScaledTorque::kKept ? "kept" : "by its cube") +
                             ", made by clamber scale-robot";
  YAML::Node root = YAML::Load(read_file(robot));
  const fs::path urdf = from / root["urdf"].as<std::string>();
  root["name"] = original.name + "_x" + shortest(s);
  root["urdf"] = urdf.filename().string();
  scale_drives(root["drives"]["default"], by);
  for (YAML::Node group : root["drives"]["groups"]) scale_drives(group, by);
  for (YAML::Node entry : root["ballast"]) scale(entry, "mass", by.mass);
  const auto write = [&folder](const fs::path& name, const std::string& text) {
    write_text((folder / name).string(), text);
  };
  write(urdf.filename(), scaled_urdf(urdf, by, remark));
  write("robot.yaml", text_of(root, remark));
  std::error_code error;
  if (fs::exists(from / "retarget.yaml", error))
    write("retarget.yaml", read_file(from / "retarget.yaml"));
  if (fs::exists(from / "control.yaml", error)) {
    YAML::Node control = YAML::Load(read_file(from / "control.yaml"));
    for (const char* key : {"gains", "feed_forward_gains"})
      for (YAML::Node group : control[key]) scale_gains(group, by);
    write("control.yaml", text_of(control, remark));
  }
}

}  // namespace clamber
