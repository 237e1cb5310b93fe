#include "robot_model/loader.hpp"

#include <array>
#include <charconv>
#include <map>
#include <set>

#include "robot_model/read_file.hpp"
#include "robot_model/sha256.hpp"
#include "robot_model/tree_builder.hpp"
#include "robot_model/urdf_document.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

struct DriveKey {
  const char* name;
  double Joint::*member;
  bool may_be_zero;
};
/// The first five must be in `default`; a robot without springs need not name them.
constexpr std::size_t kNeededKeys = 5;
constexpr std::array<DriveKey, 7> kDriveKeys = {{
    {"torque_limit", &Joint::torque_limit, false},
    {"reflected_inertia", &Joint::reflected_inertia, true},
    {"kp", &Joint::kp, false},
    {"ki", &Joint::ki, true},
    {"kd", &Joint::kd, true},
    {"spring_stiffness", &Joint::spring_stiffness, true},
    {"spring_damping", &Joint::spring_damping, true},
}};

std::size_t index(int i) { return static_cast<std::size_t>(i); }

std::string quoted(const std::string& name) {
  std::string result = "'";
  result += name;
  result += "'";
  return result;
}

int require_geom(const RobotModel& model, const YamlNode& node) {
  const auto geom = model.find_geom(node.text());
  if (!geom) {
    node.fail("the robot has no collision primitive '" + node.text() + "'");
  }
  return *geom;
}

Joint& require_joint(RobotModel& model, const YamlNode& node, const std::string& name) {
  const auto joint = model.find_joint(name);
  if (!joint) {
    node.fail("the robot has no movable joint '" + name + "'");
  }
  return model.joints[index(*joint)];
}

void read_drive(const YamlNode& node, Joint& joint) {
  for (const DriveKey& key : kDriveKeys) {
    if (const auto value = node.find(key.name)) {
      joint.*key.member = key.may_be_zero ? value->non_negative() : value->positive();
    }
  }
}

void read_drives(const YamlNode& drives, RobotModel& model) {
  drives.allow_only({"default", "groups"});
  const YamlNode defaults = drives.at("default");
  defaults.allow_only({"torque_limit", "reflected_inertia", "kp", "ki", "kd", "spring_stiffness",
                       "spring_damping"});
  for (std::size_t k = 0; k < kNeededKeys; ++k) {
    (void)defaults.at(kDriveKeys[k].name);  // each of them must be there
  }
  for (Joint& joint : model.joints) {
    read_drive(defaults, joint);
  }
  if (const auto groups = drives.find("groups")) {
    for (const YamlNode& group : groups->items()) {
      group.allow_only({"joints", "torque_limit", "reflected_inertia", "kp", "ki", "kd",
                        "spring_stiffness", "spring_damping"});
      for (const YamlNode& joint : group.at("joints").items()) {
        read_drive(group, require_joint(model, joint, joint.text()));
      }
    }
  }
  for (const Joint& joint : model.joints) {
    if (joint.torque_limit > joint.drive_torque_limit) {
      drives.fail("joint '" + joint.name + "': torque_limit " + std::to_string(joint.torque_limit) +
                  " is above the effort of the URDF, " + std::to_string(joint.drive_torque_limit));
    }
  }
}

// Sum of the straight pieces from the contact up to the support point: the limb stretched out.
double limb_length(const RobotModel& model, const ContactLink& contact,
                   const Eigen::Vector3d& contact_point) {
  double length = 0.0;
  Eigen::Vector3d p = contact_point;
  for (int body = contact.body; body != contact.support_body;
       body = model.bodies[index(body)].parent) {
    length += p.norm();
    p = model.bodies[index(body)].X_PJ.p;
  }
  return length + (p - contact.support_point).norm();
}

bool is_ancestor(const RobotModel& model, int ancestor, int body) {
  while (body > ancestor) {
    body = model.bodies[index(body)].parent;
  }
  return body == ancestor;
}

// The sole is the face of the box towards -z of its own frame, corners counter-clockwise.
std::vector<Eigen::Vector3d> sole_corners(const Geom& box) {
  std::vector<Eigen::Vector3d> corners;
  corners.reserve(4);
  constexpr std::array<std::array<double, 2>, 4> kSigns = {{{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
  for (const auto& sign : kSigns) {
    corners.push_back(box.X_BG * Eigen::Vector3d(sign[0] * box.half_extents.x(),
                                                 sign[1] * box.half_extents.y(),
                                                 -box.half_extents.z()));
  }
  return corners;
}

ContactLink read_contact(const YamlNode& node, const RobotModel& model) {
  node.allow_only({"name", "limb", "geom", "support"});
  ContactLink contact;
  contact.name = node.at("name").text();
  contact.limb = node.at("limb").text();
  contact.geom = require_geom(model, node.at("geom"));
  const Geom& geom = model.geoms[index(contact.geom)];
  contact.body = geom.body;
  if (geom.shape == Shape::kCapsule) {
    node.at("geom").fail("'" + geom.name + "' is a capsule: expected a sphere or a box");
  }
  contact.is_patch = geom.shape == Shape::kBox;
  contact.points = contact.is_patch ? sole_corners(geom) : std::vector{geom.X_BG.p};
  contact.radius = geom.radius;

  const YamlNode support = node.at("support");
  const auto frame = model.find_frame(support.text());
  if (!frame) {
    support.fail("the robot has no link '" + support.text() + "'");
  }
  contact.support_body = model.frames[index(*frame)].body;
  contact.support_point = model.frames[index(*frame)].X_BF.p;
  if (!is_ancestor(model, contact.support_body, contact.body)) {
    support.fail("link '" + support.text() + "' does not carry '" + geom.name + "'");
  }
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : contact.points) {
    centre += point / static_cast<double>(contact.points.size());
  }
  contact.support_length = limb_length(model, contact, centre);
  return contact;
}

void read_contacts(const YamlNode& list, RobotModel& model) {
  for (const YamlNode& node : list.items()) {
    ContactLink contact = read_contact(node, model);
    if (model.find_contact(contact.name)) {
      node.at("name").fail("contact '" + contact.name + "' is defined twice");
    }
    model.contacts.push_back(std::move(contact));
  }
}

bool are_adjacent(const RobotModel& model, int body_a, int body_b) {
  return body_a == body_b || model.bodies[index(body_a)].parent == body_b ||
         model.bodies[index(body_b)].parent == body_a;
}

// A list of groups: {group, pairs: [[a, b], ...]} or {group, each_of: [...], with_each_of: [...]},
// every primitive of the one list against every primitive of the other.
class PairReader {
 public:
  explicit PairReader(const RobotModel& model) : model_(model) {}

  [[nodiscard]] std::vector<std::pair<int, int>> read(const YamlNode& list) {
    for (const YamlNode& group : list.items()) {
      (void)group.at("group").text();
      if (const auto pairs = group.find("pairs")) {
        group.allow_only({"group", "pairs"});
        read_pairs(*pairs);
      } else {
        group.allow_only({"group", "each_of", "with_each_of"});
        read_product(group);
      }
    }
    return std::move(pairs_);
  }

 private:
  void read_pairs(const YamlNode& list) {
    for (const YamlNode& pair : list.items()) {
      const std::vector<YamlNode> names = pair.items();
      if (names.size() != 2) {
        pair.fail("expected two collision primitives");
      }
      add(names[0], names[1]);
    }
  }

  void read_product(const YamlNode& group) {
    for (const YamlNode& a : group.at("each_of").items()) {
      for (const YamlNode& b : group.at("with_each_of").items()) {
        add(a, b);
      }
    }
  }

  void add(const YamlNode& first, const YamlNode& second) {
    const int a = require_geom(model_, first);
    const int b = require_geom(model_, second);
    if (are_adjacent(model_, model_.geoms[index(a)].body, model_.geoms[index(b)].body)) {
      second.fail(quoted(first.text()) + " and " + quoted(second.text()) +
                  " belong to the same or to neighbouring bodies: they always touch");
    }
    const std::pair<int, int> pair = std::minmax(a, b);
    if (!seen_.insert(pair).second) {
      second.fail(quoted(first.text()) + " and " + quoted(second.text()) + " are paired twice");
    }
    pairs_.push_back(pair);
  }

  const RobotModel& model_;
  std::vector<std::pair<int, int>> pairs_;
  std::set<std::pair<int, int>> seen_;
};

void read_forbidden_links(const YamlNode& list, RobotModel& model) {
  for (const YamlNode& node : list.items()) {
    const std::size_t before = model.forbidden_geoms.size();
    for (std::size_t i = 0; i < model.geoms.size(); ++i) {
      if (model.geoms[i].link == node.text()) {
        model.forbidden_geoms.push_back(static_cast<int>(i));
      }
    }
    if (model.forbidden_geoms.size() == before) {
      node.fail("the robot has no link '" + node.text() + "' with a collision primitive");
    }
  }
}

void read_home(const YamlNode& home, RobotModel& model) {
  model.home = JointVector::Zero(model.joint_count());
  for (const auto& [name, value] : home.entries()) {
    (void)require_joint(model, value, name);
    model.home[*model.find_joint(name)] = value.number();
  }
  for (int i = 0; i < model.joint_count(); ++i) {
    const Joint& joint = model.joints[index(i)];
    if (model.home[i] < joint.lower || model.home[i] > joint.upper) {
      home.fail("joint '" + joint.name + "' at " + std::to_string(model.home[i]) +
                " is outside its limits " + std::to_string(joint.lower) + " ... " +
                std::to_string(joint.upper));
    }
  }
}

std::map<std::string, double> read_ballast(const YamlNode& root, double scale) {
  std::map<std::string, double> added_mass;
  if (const auto ballast = root.find("ballast")) {
    for (const YamlNode& item : ballast->items()) {
      item.allow_only({"link", "mass"});
      const double mass = scale * item.at("mass").number();
      if (mass != 0.0) {
        added_mass[item.at("link").text()] += mass;
      }
    }
  }
  return added_mass;
}

std::string model_hash(const std::string& yaml, const std::string& urdf, double ballast_scale) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), ballast_scale).ptr;
  // Hashing the digests rather than the texts: bytes cannot move from one file to the other unseen.
  return sha256_hex(sha256_hex(yaml) + sha256_hex(urdf) + std::string(digits.data(), end));
}

}  // namespace

RobotModel load_robot(const std::filesystem::path& robot_yaml, const LoadOptions& options) {
  const std::string yaml_text = read_file(robot_yaml);
  const YamlNode root = YamlNode::parse(yaml_text, robot_yaml.string());
  root.allow_only({"name", "urdf", "joint_order", "drives", "contacts", "self_collision",
                   "planner_collision", "forbidden_links", "home", "ballast"});
  if (!(options.ballast_scale >= 0.0)) {
    throw InputError(robot_yaml.string() + ": ballast scale must be >= 0");
  }
  const std::filesystem::path urdf_file = robot_yaml.parent_path() / root.at("urdf").text();
  const std::string urdf_text = read_file(urdf_file);

  TreeOptions tree;
  tree.file = urdf_file.string();
  if (const auto order = root.find("joint_order")) {
    tree.joint_order = order->texts();
    tree.order_source = order->where();
  }
  tree.added_mass = read_ballast(root, options.ballast_scale);

  RobotModel model;
  model.name = root.at("name").text();
  model.hash = model_hash(yaml_text, urdf_text, options.ballast_scale);
  build_tree(*parse_urdf_document(urdf_text, tree.file), tree, model);
  for (const auto& [link, mass] : tree.added_mass) {
    model.ballast_mass += mass;
  }
  read_drives(root.at("drives"), model);
  read_contacts(root.at("contacts"), model);
  model.collision_pairs = PairReader(model).read(root.at("self_collision"));
  model.planner_pairs = PairReader(model).read(root.at("planner_collision"));
  read_forbidden_links(root.at("forbidden_links"), model);
  read_home(root.at("home"), model);
  return model;
}

}  // namespace clamber
