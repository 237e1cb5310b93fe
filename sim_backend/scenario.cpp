#include "sim_backend/scenario.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/sha256.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

constexpr double kFlatSole = 2e-3;  // m: a home posture's soles may be this uneven

template <int N>
Eigen::Matrix<double, N, 1> read_vector(const YamlNode& node) {
  const std::vector<YamlNode> items = node.items();
  if (items.size() != N) {
    node.fail("expected a list of " + std::to_string(N) + " numbers, got " +
              std::to_string(items.size()));
  }
  Eigen::Matrix<double, N, 1> out;
  for (int i = 0; i < N; ++i) {
    out[i] = items[static_cast<std::size_t>(i)].number();
  }
  return out;
}

double read_yaw(const YamlNode& section) {
  const std::optional<YamlNode> yaw = section.find("yaw");
  return yaw ? yaw->number() : 0.0;
}

ObstacleBox read_obstacle(const YamlNode& section) {
  section.allow_only({"name", "position", "size", "yaw"});
  ObstacleBox box;
  box.name = section.at("name").text();
  if (box.name == "floor") {
    section.at("name").fail("the floor itself has this name, expected another one");
  }
  for (const YamlNode& extent : section.at("size").items()) {
    static_cast<void>(extent.positive());
  }
  const auto position = read_vector<2>(section.at("position"));
  box.half_extents = 0.5 * read_vector<3>(section.at("size"));
  box.center = {position.x(), position.y(), box.half_extents.z()};
  box.yaw = read_yaw(section);
  return box;
}

std::vector<ObstacleBox> read_obstacles(const YamlNode& list) {
  std::vector<ObstacleBox> obstacles;
  for (const YamlNode& entry : list.items()) {
    const ObstacleBox box = read_obstacle(entry);
    for (const ObstacleBox& other : obstacles) {
      if (other.name == box.name) {
        entry.at("name").fail("two obstacles have this name, expected different ones");
      }
    }
    obstacles.push_back(box);
  }
  if (obstacles.empty()) {
    list.fail("expected at least one obstacle");
  }
  return obstacles;
}

std::vector<std::string> read_goal_contacts(const YamlNode& list) {
  std::vector<std::string> contacts;
  for (const YamlNode& entry : list.items()) {
    if (std::find(contacts.begin(), contacts.end(), entry.text()) != contacts.end()) {
      entry.fail(entry.text() + " is given twice");
    }
    contacts.push_back(entry.text());
  }
  if (contacts.empty()) {
    list.fail("expected at least one contact link");
  }
  return contacts;
}

Goal read_goal(const YamlNode& posture) {
  for (const Goal goal : {Goal::kAllFours, Goal::kStandOnTop, Goal::kOver, Goal::kBackDown}) {
    if (posture.text() == to_string(goal)) {
      return goal;
    }
  }
  posture.fail("unknown goal, expected all_fours, stand_on_top, over or back_down");
}

Scenario read_scenario(const YamlNode& root) {
  root.allow_only({"name", "friction", "obstacles", "start", "goal"});
  Scenario scenario;
  scenario.name = root.at("name").text();
  scenario.friction = root.at("friction").positive();
  scenario.obstacles = read_obstacles(root.at("obstacles"));
  const YamlNode start = root.at("start");
  start.allow_only({"position", "yaw"});
  scenario.start_position << read_vector<2>(start.at("position")), 0.0;
  scenario.start_yaw = read_yaw(start);
  const YamlNode goal = root.at("goal");
  if (goal.is_map()) {
    goal.allow_only({"posture", "contacts"});
    scenario.goal = read_goal(goal.at("posture"));
    scenario.goal_contacts = read_goal_contacts(goal.at("contacts"));
  } else {
    scenario.goal = read_goal(goal);
  }
  return scenario;
}

/// Sole corners in the world, in the order of the model's patch contacts.
struct Soles {
  std::vector<Eigen::Vector3d> corners;
  std::array<Eigen::Vector3d, 2> centers{};
};

Soles find_soles(const RobotModel& model, const Configuration& x) {
  RobotData data;
  forward_kinematics(model, x, data);
  Soles soles;
  std::size_t feet = 0;
  for (const ContactLink& contact : model.contacts) {
    if (!contact.is_patch || contact.points.empty()) {
      continue;
    }
    if (feet == soles.centers.size()) {
      throw InputError(model.name + ": start pose: expected two feet, found more");
    }
    const Pose& X_WB = data.X_WB[static_cast<std::size_t>(contact.body)];
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : contact.points) {
      soles.corners.push_back(X_WB * point);
      center += soles.corners.back() / static_cast<double>(contact.points.size());
    }
    soles.centers[feet++] = center;
  }
  if (feet != soles.centers.size()) {
    throw InputError(model.name + ": start pose: expected two feet (patch contacts), found " +
                     std::to_string(feet));
  }
  return soles;
}

/// Normal of the plane that fits the points best (least squares), upwards.
Eigen::Vector3d plane_normal(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) {
    mean += p / static_cast<double>(points.size());
  }
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) {
    scatter += (p - mean) * (p - mean).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  const Eigen::Vector3d normal = solver.eigenvectors().col(0);
  return normal.z() < 0.0 ? Eigen::Vector3d(-normal) : normal;
}

}  // namespace

const char* to_string(Goal goal) {
  switch (goal) {
    case Goal::kAllFours:
      return "all_fours";
    case Goal::kStandOnTop:
      return "stand_on_top";
    case Goal::kOver:
      return "over";
    case Goal::kBackDown:
      return "back_down";
  }
  return "unknown";
}

const char* outcome(Goal goal) {
  switch (goal) {
    case Goal::kAllFours:
      return "on top of";
    case Goal::kStandOnTop:
      return "standing on top of";
    case Goal::kOver:
      return "over";
    case Goal::kBackDown:
      return "down again from";
  }
  return "somewhere near";
}

Scenario parse_scenario(const std::string& text, const std::string& file) {
  Scenario scenario = read_scenario(YamlNode::parse(text, file));
  scenario.hash = sha256_hex(text);
  return scenario;
}

Scenario load_scenario(const std::filesystem::path& file) {
  return parse_scenario(read_file(file), file.string());
}

Scenario with_height(Scenario scenario, double height) {
  if (!std::isfinite(height) || height <= 0.0) {
    throw InputError(scenario.name + ": obstacle height: expected a finite number > 0");
  }
  ObstacleBox& box = scenario.obstacles.at(0);
  box.half_extents.z() = 0.5 * height;
  box.center.z() = 0.5 * height;
  const std::string suffix = "@height=" + std::to_string(height);
  scenario.name += suffix;
  scenario.hash = sha256_hex(scenario.hash + suffix);
  return scenario;
}

Scenario with_goal(Scenario scenario, Goal goal) {
  if (goal == scenario.goal) {
    return scenario;
  }
  scenario.goal = goal;
  const std::string suffix = std::string("@goal=") + to_string(goal);
  scenario.name += suffix;
  scenario.hash = sha256_hex(scenario.hash + suffix);
  return scenario;
}

std::vector<std::string> all_fours_contacts(const RobotModel& model, const Scenario& scenario) {
  if (!scenario.goal_contacts.empty()) {
    return scenario.goal_contacts;
  }
  std::vector<std::string> names;
  for (const ContactLink& contact : model.contacts) {
    if (!contact.is_patch) {
      names.push_back(contact.name);
    }
  }
  return names;
}

Configuration start_configuration(const RobotModel& model, const Scenario& scenario) {
  Configuration x;
  x.q = model.home;
  const Eigen::Vector3d up = plane_normal(find_soles(model, x).corners);
  x.X_WB.R = Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d heading =
      x.X_WB.R.col(0);  // the base's x axis; a foot's may point anywhere
  const double turn = scenario.start_yaw - std::atan2(heading.y(), heading.x());
  x.X_WB.R = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix() * x.X_WB.R;
  const Soles soles = find_soles(model, x);
  const Eigen::Vector3d middle = 0.5 * (soles.centers[0] + soles.centers[1]);
  for (const Eigen::Vector3d& corner : soles.corners) {
    if (std::abs(corner.z() - middle.z()) > kFlatSole) {
      throw InputError(model.name + ": home posture: its soles are not flat on one floor (" +
                       std::to_string(1e3 * std::abs(corner.z() - middle.z())) + " mm)");
    }
  }
  x.X_WB.p = scenario.start_position - middle;
  return x;
}

}  // namespace clamber
