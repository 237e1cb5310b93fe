#include "planner_offline/contacts/contact_sequence.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <system_error>

#include "robot_model/loader.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

constexpr double kUnitTolerance = 1e-6;  // of a quaternion's norm

std::vector<std::string> links_of(const std::vector<ContactReference>& contacts) {
  std::vector<std::string> links;
  links.reserve(contacts.size());
  for (const ContactReference& contact : contacts) {
    links.push_back(contact.link);
  }
  std::sort(links.begin(), links.end());
  return links;
}

double mean_stability(const ContactState& state) {
  double sum = 0.0;
  for (const ContactReference& contact : state.obstacle) {
    sum += contact.stability;
  }
  return sum / static_cast<double>(state.obstacle.size());
}

bool better_supported(const ContactState& a, const ContactState& b) {
  if (a.floor.size() != b.floor.size()) {
    return a.floor.size() > b.floor.size();
  }
  return mean_stability(a) < mean_stability(b);
}

void merge_into(ContactState& kept, const ContactState& next) {
  const double start = kept.start;
  if (better_supported(next, kept)) {
    kept = next;
  }
  kept.start = start;
  kept.end = next.end;
}

// ---- writing

std::string number(double value) {
  if (!std::isfinite(value)) {
    throw InputError("contact sequence: a number to be saved is not finite");
  }
  std::array<char, 32> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), result.ptr};
}

void put(YAML::Emitter& out, const char* key, double value) {
  out << YAML::Key << key << YAML::Value << number(value);
}

void put(YAML::Emitter& out, const char* key, const std::string& value) {
  out << YAML::Key << key << YAML::Value << YAML::DoubleQuoted << value;
}

template <typename Vector>
void put_vector(YAML::Emitter& out, const char* key, const Vector& values) {
  out << YAML::Key << key << YAML::Value << YAML::Flow << YAML::BeginSeq;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    out << number(values[i]);
  }
  out << YAML::EndSeq;
}

void put_texts(YAML::Emitter& out, const char* key, const std::vector<std::string>& texts) {
  out << YAML::Key << key << YAML::Value << YAML::BeginSeq;
  for (const std::string& text : texts) {
    out << YAML::DoubleQuoted << text;
  }
  out << YAML::EndSeq;
}

void put_contacts(YAML::Emitter& out, const char* key,
                  const std::vector<ContactReference>& contacts) {
  out << YAML::Key << key << YAML::Value << YAML::BeginSeq;
  for (const ContactReference& contact : contacts) {
    out << YAML::Flow << YAML::BeginMap;
    put(out, "link", contact.link);
    put(out, "surface", contact.surface);
    put_vector(out, "position", contact.position);
    put(out, "stability", contact.stability);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq;
}

void put_posture(YAML::Emitter& out, const Configuration& x) {
  const Eigen::Quaterniond Q(x.X_WB.R);
  out << YAML::Key << "posture" << YAML::Value << YAML::BeginMap;
  put_vector(out, "position", x.X_WB.p);
  put_vector(out, "orientation", Eigen::Vector4d(Q.w(), Q.x(), Q.y(), Q.z()));
  put_vector(out, "q", x.q);
  out << YAML::EndMap;
}

void put_states(YAML::Emitter& out, const char* key, const std::vector<ContactState>& states) {
  out << YAML::Key << key << YAML::Value << YAML::BeginSeq;
  for (const ContactState& state : states) {
    out << YAML::BeginMap;
    put(out, "start", state.start);
    put(out, "end", state.end);
    put(out, "stability", state.stability);
    put_contacts(out, "obstacle", state.obstacle);
    put_contacts(out, "floor", state.floor);
    put_posture(out, state.posture);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq;
}

// ---- reading

/// What the names in a file must belong to; without a model, any name is taken.
struct Names {
  const RobotModel* model = nullptr;
  std::size_t joints = 0;
};

Eigen::VectorXd read_vector(const YamlNode& node, std::size_t size) {
  const std::vector<YamlNode> items = node.items();
  if (items.size() != size) {
    node.fail("expected " + std::to_string(size) + " numbers, got " + std::to_string(items.size()));
  }
  Eigen::VectorXd values(static_cast<Eigen::Index>(size));
  for (std::size_t i = 0; i < size; ++i) {
    values[static_cast<Eigen::Index>(i)] = items[i].number();
  }
  return values;
}

ContactReference read_contact(const YamlNode& node, const Names& names) {
  node.allow_only({"link", "surface", "position", "stability"});
  ContactReference contact;
  contact.link = node.at("link").text();
  if (names.model != nullptr && !names.model->find_contact(contact.link)) {
    node.at("link").fail("unknown contact link '" + contact.link + "' of robot '" +
                         names.model->name + "'");
  }
  contact.surface = node.at("surface").text();
  contact.position = read_vector(node.at("position"), 3);
  contact.stability = node.at("stability").non_negative();
  return contact;
}

std::vector<ContactReference> read_contacts(const YamlNode& node, const Names& names) {
  std::vector<ContactReference> contacts;
  for (const YamlNode& item : node.items()) {
    contacts.push_back(read_contact(item, names));
    const auto same = [&](const auto& c) { return c.link == contacts.back().link; };
    if (std::count_if(contacts.begin(), contacts.end(), same) > 1) {
      item.fail("contact link '" + contacts.back().link + "' is listed twice");
    }
  }
  return contacts;
}

Configuration read_posture(const YamlNode& node, const Names& names) {
  node.allow_only({"position", "orientation", "q"});
  Configuration x;
  x.X_WB.p = read_vector(node.at("position"), 3);
  const Eigen::Vector4d wxyz = read_vector(node.at("orientation"), 4);
  if (std::abs(wxyz.norm() - 1.0) > kUnitTolerance) {
    node.at("orientation").fail("expected a unit quaternion [w, x, y, z]");
  }
  x.X_WB.R = Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).normalized().matrix();
  x.q = read_vector(node.at("q"), names.joints);
  return x;
}

ContactState read_state(const YamlNode& node, const Names& names) {
  node.allow_only({"start", "end", "stability", "obstacle", "floor", "posture"});
  ContactState state;
  state.start = node.at("start").number();
  state.end = node.at("end").number();
  if (state.end < state.start) {
    node.at("end").fail("expected a time not before 'start'");
  }
  state.stability = node.at("stability").non_negative();
  state.obstacle = read_contacts(node.at("obstacle"), names);
  if (state.obstacle.empty()) {
    node.at("obstacle").fail("expected at least one contact");
  }
  state.floor = read_contacts(node.at("floor"), names);
  state.posture = read_posture(node.at("posture"), names);
  return state;
}

std::vector<ContactState> read_states(const YamlNode& node, const Names& names) {
  std::vector<ContactState> states;
  for (const YamlNode& item : node.items()) {
    states.push_back(read_state(item, names));
    if (states.size() > 1 && states.back().start < states[states.size() - 2].start) {
      item.fail("states are not in the order of time");
    }
  }
  return states;
}

std::vector<std::string> read_joint_names(const YamlNode& node, const RobotModel* model) {
  std::vector<std::string> joints = node.texts();
  if (joints.empty() || joints.size() > kMaxJoints) {
    node.fail("expected 1 to " + std::to_string(kMaxJoints) + " joint names");
  }
  if (model == nullptr) {
    return joints;
  }
  const bool same =
      std::equal(joints.begin(), joints.end(), model->joints.begin(), model->joints.end(),
                 [](const std::string& name, const Joint& joint) { return name == joint.name; });
  if (!same) {
    node.fail("expected the joints of robot '" + model->name + "' in its order");
  }
  return joints;
}

ContactSequence read_sequence(const std::filesystem::path& file, const RobotModel* model) {
  const YamlNode root = YamlNode::load(file);
  root.allow_only({"recording", "synthetic", "robot", "playback_obstacle_height", "joint_names",
                   "notes", "states", "reduced"});
  ContactSequence sequence;
  sequence.recording = root.at("recording").text();
  sequence.synthetic = root.at("synthetic").flag();
  sequence.robot = root.at("robot").text();
  if (model != nullptr && sequence.robot != model->name) {
    root.at("robot").fail("made for robot '" + sequence.robot + "', not for '" + model->name + "'");
  }
  sequence.playback_obstacle_height = root.at("playback_obstacle_height").positive();
  sequence.joint_names = read_joint_names(root.at("joint_names"), model);
  sequence.notes = root.at("notes").texts();
  const Names names{model, sequence.joint_names.size()};
  sequence.states = read_states(root.at("states"), names);
  sequence.reduced = read_states(root.at("reduced"), names);
  return sequence;
}

}  // namespace

std::vector<ContactState> reduce(const std::vector<ContactState>& states) {
  std::vector<ContactState> reduced;
  for (const ContactState& state : states) {
    if (state.stability > 0.0 || state.obstacle.empty()) {
      continue;
    }
    if (!reduced.empty() && links_of(reduced.back().obstacle) == links_of(state.obstacle)) {
      merge_into(reduced.back(), state);
    } else {
      reduced.push_back(state);
    }
  }
  return reduced;
}

void save_contacts(const ContactSequence& sequence, const std::filesystem::path& file) {
  YAML::Emitter out;
  out << YAML::Comment(
      "contact sequence of a recorded climb, found by playback (clamber contacts)");
  out << YAML::BeginMap;
  put(out, "recording", sequence.recording);
  out << YAML::Key << "synthetic" << YAML::Value << sequence.synthetic;
  put(out, "robot", sequence.robot);
  put(out, "playback_obstacle_height", sequence.playback_obstacle_height);
  put_texts(out, "joint_names", sequence.joint_names);
  put_texts(out, "notes", sequence.notes);
  put_states(out, "states", sequence.states);
  put_states(out, "reduced", sequence.reduced);
  out << YAML::EndMap;

  std::filesystem::path draft = file;
  draft += ".part";
  std::error_code error;
  {
    std::ofstream stream(draft, std::ios::binary);
    stream << out.c_str() << '\n';
    stream.close();
    if (stream.fail()) {
      throw InputError(file.string() + ": cannot be written");
    }
  }
  std::filesystem::rename(draft, file, error);
  if (error) {
    throw InputError(file.string() + ": cannot be written: " + error.message());
  }
}

ContactSequence load_contacts(const std::filesystem::path& file) {
  return read_sequence(file, nullptr);
}

ContactSequence load_contacts(const std::filesystem::path& file, const RobotModel& model) {
  return read_sequence(file, &model);
}

}  // namespace clamber
