#include "tests/certificate/made_plan.hpp"

#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "planner_offline/certify/contact_forces.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber::test {
namespace {

constexpr double kKnot = 0.1;          // s
constexpr double kLift = 0.25;         // rad that the elbows bend to take the hands off
constexpr double kWristInside = 0.06;  // m from the table's edge

double minimum_jerk(double u) { return u * u * u * (10.0 + u * (-15.0 + 6.0 * u)); }

class Maker {
 public:
  explicit Maker(MadePlan& made) : made_(made), forces_(made.model, {.friction = 0.48}) {}

  void make() {
    stand_with_hands_out();
    build_table();
    header();
    phase("stand");
    add(0.0, 1.0, 0.0);
    for (int i = 1; i <= 4; ++i) add(kKnot, 1.0, 0.0);
    phase("reach");
    for (int i = 1; i <= 10; ++i) add(kKnot, 1.0 - minimum_jerk(i / 10.0), 0.0);
    phase("load");
    hands_down_ = true;
    for (int i = 1; i <= 5; ++i) add(kKnot, 0.0, i / 5.0);
    phase("lean");
    for (int i = 1; i <= 5; ++i) add(kKnot, 0.0, 1.0);
    phase("unload");
    for (int i = 1; i <= 5; ++i) add(kKnot, 0.0, 1.0 - i / 5.0);
    hands_down_ = false;
    phase("lift");
    for (int i = 1; i <= 10; ++i) add(kKnot, minimum_jerk(i / 10.0), 0.0);
  }

 private:
  void stand_with_hands_out() {
    Scenario& s = made_.scenario;
    s.name = "table";
    s.hash = std::string(64, 'a');
    s.friction = 0.8;
    s.start_position = {-0.13, 0.0, 0.0};
    s.goal_contacts = {"Lwrist", "Rwrist"};
    posture_ = start_configuration(made_.model, s);
    for (const char* joint : {"LShSag", "RShSag"})
      posture_.q[*made_.model.find_joint(joint)] = -0.15;
    // The lower of two hands would touch first: both arms are the same but for rounding.
    forward_kinematics(made_.model, posture_, data_);
  }

  Eigen::Vector3d touch(const char* link) {
    return touch_point(made_.model, data_, *made_.model.find_contact(link));
  }

  void build_table() {
    const Eigen::Vector3d hand = touch("Lwrist");
    ObstacleBox table;
    table.name = "table";
    table.half_extents = {0.3, 0.5, 0.5 * hand.z()};
    table.center = {hand.x() - kWristInside + 0.3, 0.0, 0.5 * hand.z()};
    made_.scenario.obstacles = {table};
  }

  void header() {
    Plan& plan = made_.plan;
    plan.robot = made_.model.name;
    plan.robot_hash = made_.model.hash;
    plan.scenario = made_.scenario.name;
    plan.scenario_hash = made_.scenario.hash;
    plan.recording = "made";
    plan.synthetic_recording = true;
    plan.tool_version = "test";
    plan.friction = made_.scenario.friction;
    plan.obstacle_height = made_.scenario.obstacles.front().top();
    for (const Joint& joint : made_.model.joints) plan.joint_names.push_back(joint.name);
  }

  void phase(const char* name) {
    const auto& keyframes = made_.plan.keyframes;
    made_.plan.phases.push_back({name, keyframes.empty() ? 0.0 : keyframes.back().time});
  }

  /// `lifted`: 0 hands down, 1 hands up. `weight`: share of the way from standing to leaning.
  void add(double after, double lifted, double weight) {
    Keyframe k;
    k.time = made_.plan.keyframes.empty() ? 0.0 : made_.plan.keyframes.back().time + after;
    k.phase = static_cast<int>(made_.plan.phases.size()) - 1;
    k.x = posture_;
    for (const char* joint : {"LElbj", "RElbj"})
      k.x.q[*made_.model.find_joint(joint)] -= kLift * lifted;
    forward_kinematics(made_.model, k.x, data_);
    const ForceSolution standing = solve({"Lfoot", "Rfoot"});
    k.tau = standing.tau;
    const std::vector<std::string> links =
        hands_down_ ? std::vector<std::string>{"Lfoot", "Rfoot", "Lwrist", "Rwrist"}
                    : std::vector<std::string>{"Lfoot", "Rfoot"};
    const ForceSolution leaning = solve(links);
    if (hands_down_) k.tau += weight * (leaning.tau - standing.tau);
    for (std::size_t i = 0; i < links.size(); ++i) {
      const Eigen::Vector3d alone = i < 2 ? standing.forces[i] : Eigen::Vector3d::Zero();
      const double share = hands_down_ ? weight : 0.0;
      k.contacts.push_back({links[i], i < 2 ? "floor" : "table", touch(links[i].c_str()),
                            alone + share * (leaning.forces[i] - alone)});
    }
    made_.plan.keyframes.push_back(k);
  }

  ForceSolution solve(const std::vector<std::string>& links) {
    ContactSet contacts;
    for (const std::string& link : links)
      contacts.push_back(make_contact(made_.model, made_.scenario, data_,
                                      *made_.model.find_contact(link),
                                      link.ends_with("foot") ? kFloor : 0));
    return forces_.solve(data_, contacts);
  }

  MadePlan& made_;
  ContactForces forces_;
  Configuration posture_;
  RobotData data_;
  bool hands_down_ = false;
};

}  // namespace

MadePlan::MadePlan()
    : model(load_robot(std::filesystem::path(CLAMBER_SOURCE_DIR) /
                       "configs/robots/coman/robot.yaml")) {
  Maker(*this).make();
}

const MadePlan& made_plan() {
  static const MadePlan made;
  return made;
}

std::string text_of(const Plan& plan) {
  const auto file = std::filesystem::temp_directory_path() /
                    ("clamber_certificate_" + std::to_string(getpid()) + ".json");
  save_plan(plan, file);
  const std::string text = read_file(file);
  std::filesystem::remove(file);
  return text;
}

}  // namespace clamber::test
