#include "planner_offline/plan.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "control/spline.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "clamber plan";
constexpr int kFormatVersion = 3;

// ---- writing ----

double finite(double x, const char* what) {
  if (!std::isfinite(x)) throw InputError(std::string("plan: ") + what + " is not finite");
  return x;
}

template <class Vector>
Json array(const Vector& v, const char* what) {
  Json out = Json::array();
  for (Eigen::Index i = 0; i < v.size(); ++i) out.push_back(finite(v[i], what));
  return out;
}

/// A clearance may be infinite (nothing to hit), which JSON has no number for: null.
Json margin(double x, const char* what) {
  if (x == std::numeric_limits<double>::infinity()) return nullptr;
  return finite(x, what);
}

Json to_json(const PlannedContact& c) {
  return {{"link", c.link},
          {"surface", c.surface},
          {"position", array(c.position, "contact position")},
          {"force", array(c.force, "contact force")}};
}

Json to_json(const Keyframe& k) {
  const Eigen::Quaterniond rotation(k.x.X_WB.R);
  const Eigen::Vector4d wxyz(rotation.w(), rotation.x(), rotation.y(), rotation.z());
  Json contacts = Json::array();
  for (const PlannedContact& c : k.contacts) contacts.push_back(to_json(c));
  return {{"time", finite(k.time, "keyframe time")},
          {"phase", k.phase},
          {"base_position", array(k.x.X_WB.p, "base_position")},
          {"base_orientation", array(wxyz, "base_orientation")},
          {"q", array(k.x.q, "q")},
          {"tau", array(k.tau, "tau")},
          {"contacts", contacts},
          {"support_margin", margin(k.support_margin, "support_margin")},
          {"torque_margin", margin(k.torque_margin, "torque_margin")},
          {"obstacle_clearance", margin(k.obstacle_clearance, "obstacle_clearance")},
          {"self_clearance", margin(k.self_clearance, "self_clearance")}};
}

Json to_json(const CertifiedFor& c) {
  return {{"what", c.what},
          {"unit", c.unit},
          {"stated", finite(c.stated, "stated uncertainty")},
          {"holds", finite(c.holds, "held uncertainty")}};
}

Json header_json(const Plan& plan) {
  Json certified_for = Json::array();
  for (const CertifiedFor& c : plan.certified_for) certified_for.push_back(to_json(c));
  Json phases = Json::array();
  for (const Phase& p : plan.phases)
    phases.push_back({{"name", p.name},
                      {"start", finite(p.start, "phase start")},
                      {"failure_policy", to_string(p.failure_policy)}});
  return {{"format", kFormat},
          {"version", kFormatVersion},
          {"tool_version", plan.tool_version},
          {"robot", plan.robot},
          {"robot_hash", plan.robot_hash},
          {"scenario", plan.scenario},
          {"scenario_hash", plan.scenario_hash},
          {"recording", plan.recording},
          {"synthetic_recording", plan.synthetic_recording},
          {"friction", finite(plan.friction, "friction")},
          {"obstacle_height", finite(plan.obstacle_height, "obstacle_height")},
          {"ballast_mass", finite(plan.ballast_mass, "ballast_mass")},
          {"joint_names", plan.joint_names},
          {"notes", plan.notes},
          {"certified_for", certified_for},
          {"phases", phases}};
}

// ---- reading ----

/// A JSON value and the way to it, so that an error can name both file and key.
class Node {
 public:
  Node(const Json& json, std::string file, std::string path)
      : json_(&json), file_(std::move(file)), path_(std::move(path)) {}

  [[noreturn]] void complain(const std::string& what) const {
    throw InputError(file_ + ": " + (path_.empty() ? "" : path_ + ": ") + what);
  }
  [[noreturn]] void fail(const std::string& expected) const { complain("expected " + expected); }
  [[nodiscard]] Node at(const std::string& key) const {
    if (!json_->is_object()) fail("an object");
    const auto it = json_->find(key);
    if (it == json_->end()) complain("key '" + key + "' is missing");
    return {*it, file_, path_.empty() ? key : path_ + "." + key};
  }
  [[nodiscard]] std::vector<Node> items() const {
    if (!json_->is_array()) fail("a list");
    std::vector<Node> out;
    for (std::size_t i = 0; i < json_->size(); ++i)
      out.emplace_back((*json_)[i], file_, path_ + "[" + std::to_string(i) + "]");
    return out;
  }
  [[nodiscard]] double number() const {
    if (!json_->is_number()) fail("a number");
    return json_->get<double>();
  }
  /// null is infinity, see margin().
  [[nodiscard]] double number_or_infinity() const {
    return json_->is_null() ? std::numeric_limits<double>::infinity() : number();
  }
  [[nodiscard]] int index(std::size_t size) const {
    if (!json_->is_number_unsigned() || json_->get<std::uint64_t>() >= size)
      fail("an index below " + std::to_string(size));
    return json_->get<int>();
  }
  [[nodiscard]] std::string text() const {
    if (!json_->is_string()) fail("a text");
    return json_->get<std::string>();
  }
  [[nodiscard]] bool boolean() const {
    if (!json_->is_boolean()) fail("true or false");
    return json_->get<bool>();
  }
  [[nodiscard]] std::vector<std::string> texts() const {
    std::vector<std::string> out;
    for (const Node& item : items()) out.push_back(item.text());
    return out;
  }
  template <class Vector>
  [[nodiscard]] Vector vector(Eigen::Index size) const {
    const std::vector<Node> list = items();
    if (std::ssize(list) != size) fail(std::to_string(size) + " numbers");
    Vector out(size);
    for (Eigen::Index i = 0; i < size; ++i) out[i] = list[static_cast<std::size_t>(i)].number();
    return out;
  }

 private:
  const Json* json_;
  std::string file_;
  std::string path_;
};

PlannedContact read_contact(const Node& node) {
  return {.link = node.at("link").text(),
          .surface = node.at("surface").text(),
          .position = node.at("position").vector<Eigen::Vector3d>(3),
          .force = node.at("force").vector<Eigen::Vector3d>(3)};
}

Keyframe read_keyframe(const Node& node, const Plan& plan) {
  const auto joints = std::ssize(plan.joint_names);
  Keyframe k;
  k.time = node.at("time").number();
  k.phase = node.at("phase").index(plan.phases.size());
  k.x.X_WB.p = node.at("base_position").vector<Eigen::Vector3d>(3);
  const auto wxyz = node.at("base_orientation").vector<Eigen::Vector4d>(4);
  if (std::abs(wxyz.norm() - 1.0) > 1e-6) node.at("base_orientation").fail("a unit quaternion");
  k.x.X_WB.R =
      Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).normalized().toRotationMatrix();
  k.x.q = node.at("q").vector<JointVector>(joints);
  k.tau = node.at("tau").vector<JointVector>(joints);
  for (const Node& contact : node.at("contacts").items())
    k.contacts.push_back(read_contact(contact));
  k.support_margin = node.at("support_margin").number_or_infinity();
  k.torque_margin = node.at("torque_margin").number_or_infinity();
  k.obstacle_clearance = node.at("obstacle_clearance").number_or_infinity();
  k.self_clearance = node.at("self_clearance").number_or_infinity();
  return k;
}

Phase read_phase(const Node& node) {
  const auto policy = failure_policy_named(node.at("failure_policy").text());
  if (!policy) node.at("failure_policy").fail("hold, lower or limp");
  return {node.at("name").text(), node.at("start").number(), *policy};
}

Plan read_header(const Node& root) {
  if (root.at("format").text() != kFormat)
    root.at("format").fail(std::string("\"") + kFormat + "\"");
  if (root.at("version").number() != kFormatVersion)
    root.at("version").fail("version " + std::to_string(kFormatVersion));
  Plan plan;
  plan.tool_version = root.at("tool_version").text();
  plan.robot = root.at("robot").text();
  plan.robot_hash = root.at("robot_hash").text();
  plan.scenario = root.at("scenario").text();
  plan.scenario_hash = root.at("scenario_hash").text();
  plan.recording = root.at("recording").text();
  plan.synthetic_recording = root.at("synthetic_recording").boolean();
  plan.friction = root.at("friction").number();
  plan.obstacle_height = root.at("obstacle_height").number();
  plan.ballast_mass = root.at("ballast_mass").number();
  plan.joint_names = root.at("joint_names").texts();
  if (plan.joint_names.empty() || plan.joint_names.size() > kMaxJoints)
    root.at("joint_names").fail("1 to " + std::to_string(kMaxJoints) + " names");
  plan.notes = root.at("notes").texts();
  for (const Node& row : root.at("certified_for").items())
    plan.certified_for.push_back({.what = row.at("what").text(),
                                  .unit = row.at("unit").text(),
                                  .stated = row.at("stated").number(),
                                  .holds = row.at("holds").number()});
  for (const Node& phase : root.at("phases").items()) plan.phases.push_back(read_phase(phase));
  return plan;
}

// ---- the 100 Hz table ----

/// Base position and joint angles as knots of one spline: dimensions 0..2, then the joints.
struct PlanKnots {
  const Plan* plan = nullptr;
  [[nodiscard]] std::size_t size() const noexcept { return plan->keyframes.size(); }
  [[nodiscard]] std::size_t dimensions() const noexcept { return 3 + plan->joint_names.size(); }
  [[nodiscard]] double time(std::size_t i) const noexcept { return plan->keyframes[i].time; }
  [[nodiscard]] double value(std::size_t i, std::size_t d) const noexcept {
    const Configuration& x = plan->keyframes[i].x;
    return d < 3 ? x.X_WB.p[static_cast<Eigen::Index>(d)] : x.q[static_cast<Eigen::Index>(d - 3)];
  }
};

Eigen::Quaterniond base_orientation(const Plan& plan, std::size_t segment, double t) {
  const Keyframe& a = plan.keyframes[segment];
  const Keyframe& b = plan.keyframes[segment + 1];
  Eigen::Quaterniond q = Eigen::Quaterniond(a.x.X_WB.R)
                             .slerp(std::clamp((t - a.time) / (b.time - a.time), 0.0, 1.0),
                                    Eigen::Quaterniond(b.x.X_WB.R));
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return q;
}

class CsvWriter {
 public:
  explicit CsvWriter(const std::filesystem::path& file) : file_(file), out_(file) {}

  void text(std::string_view cell) {
    separate();
    out_ << cell;
  }
  void number(double x) {
    separate();
    char digits[32];
    // Adding zero turns a negative zero into the plain one.
    const auto end =
        std::to_chars(digits, digits + sizeof(digits), x + 0.0, std::chars_format::general, 12);
    out_.write(digits, end.ptr - digits);
  }
  void end_row() {
    out_ << '\n';
    first_ = true;
  }
  void close() {
    out_.close();
    if (!out_) throw InputError(file_.string() + ": cannot write the trajectory");
  }

 private:
  void separate() {
    if (!first_) out_ << ',';
    first_ = false;
  }

  std::filesystem::path file_;
  std::ofstream out_;
  bool first_ = true;
};

}  // namespace

std::string format_plan(const Plan& plan) {
  const std::string header = header_json(plan).dump(1);
  // One keyframe a line: a text tool can compare two plans keyframe by keyframe.
  std::string text = header.substr(0, header.rfind('\n')) + ",\n \"keyframes\": [";
  for (std::size_t i = 0; i < plan.keyframes.size(); ++i)
    text += (i == 0 ? "\n  " : ",\n  ") + to_json(plan.keyframes[i]).dump();
  return text + "\n ]\n}\n";
}

void save_plan(const Plan& plan, const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::binary);
  out << format_plan(plan);
  out.close();
  if (!out) throw InputError(file.string() + ": cannot write the plan");
}

Plan load_plan(const std::filesystem::path& file) {
  const std::string text = read_file(file, kPlanBytes);
  Json json;
  try {
    json = Json::parse(text);
  } catch (const Json::exception& error) {
    throw InputError(file.string() + ": not a JSON file: " + error.what());
  }
  const Node root(json, file.string(), "");
  Plan plan = read_header(root);
  for (const Node& keyframe : root.at("keyframes").items()) {
    plan.keyframes.push_back(read_keyframe(keyframe, plan));
    const std::size_t n = plan.keyframes.size();
    if (n > 1 && plan.keyframes[n - 1].time <= plan.keyframes[n - 2].time)
      keyframe.at("time").fail("a time after the keyframe before it");
  }
  if (plan.keyframes.size() < 2) root.at("keyframes").fail("at least 2 keyframes");
  return plan;
}

void export_trajectory(const Plan& plan, const std::filesystem::path& file) {
  const PlanKnots knots{&plan};
  ClampedSpline<PlanKnots> spline;
  std::vector<double> workspace(spline.workspace_size(knots.size(), knots.dimensions()));
  if (spline.build(knots, workspace) != SplineStatus::kOk)
    throw InputError("plan: export needs at least 2 keyframes at increasing times");

  CsvWriter csv(file);
  for (const char* name :
       {"time", "base_x", "base_y", "base_z", "base_qw", "base_qx", "base_qy", "base_qz"})
    csv.text(name);
  for (const std::string& name : plan.joint_names) csv.text(name);
  for (const std::string& name : plan.joint_names) csv.text("tau_" + name);
  csv.end_row();
  // The grid stays at 100 Hz to the end: a duration between two rows is rounded up.
  const auto last = std::lround(std::ceil((spline.end() - spline.start()) * 100.0 - 1e-6));
  std::size_t segment = 0;
  for (long row = 0; row <= last; ++row) {
    const double t = spline.start() + static_cast<double>(row) / 100.0;
    spline.locate(t, segment);
    csv.number(t);
    for (std::size_t axis = 0; axis < 3; ++axis)
      csv.number(spline.evaluate(t, segment, axis).value);
    const Eigen::Quaterniond q = base_orientation(plan, segment, t);
    for (const double x : {q.w(), q.x(), q.y(), q.z()}) csv.number(x);
    for (std::size_t d = 3; d < knots.dimensions(); ++d)
      csv.number(spline.evaluate(t, segment, d).value);
    const Keyframe& a = plan.keyframes[segment];
    const Keyframe& b = plan.keyframes[segment + 1];
    for (Eigen::Index j = 0; j < std::ssize(plan.joint_names); ++j)
      csv.number(interpolate_linear(t, a.time, a.tau[j], b.time, b.tau[j]));
    csv.end_row();
  }
  csv.close();
}

}  // namespace clamber
