#include "apps/case_list.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <system_error>

#include "apps/config_files.hpp"
#include "apps/scaled_robot.hpp"
#include "report/markup.hpp"
#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

ClimbCase read_case(const YamlNode& node) {
  node.allow_only({"name", "recording", "skeleton", "rate", "start", "end", "robot", "scale",
                   "torque", "scenario", "planner", "goal", "height", "friction", "toes"});
  ClimbCase climb;
  climb.name = node.at("name").text();
  const auto read = [&node](const char* key, std::string& value) {
    if (const auto found = node.find(key)) value = found->text();
  };
  read("recording", climb.inputs.recording);
  read("robot", climb.inputs.robot);
  read("scenario", climb.inputs.scenario);
  read("planner", climb.inputs.settings);
  if (const auto skeleton = node.find("skeleton")) climb.inputs.reading.skeleton = skeleton->text();
  if (const auto rate = node.find("rate")) climb.inputs.reading.rate = rate->positive();
  if (const auto start = node.find("start")) climb.inputs.reading.start = start->non_negative();
  if (const auto end = node.find("end")) climb.inputs.reading.end = end->positive();
  if (const auto scale = node.find("scale")) climb.scale = scale->positive();
  if (const auto torque = node.find("torque")) {
    climb.torque_kept = torque->text() == "kept";
    if (!climb.torque_kept && torque->text() != "scaled") torque->fail("expected scaled or kept");
  }
  if (const auto goal = node.find("goal")) {
    climb.inputs.goal_as_recorded = goal->text() == "recorded";
    if (!climb.inputs.goal_as_recorded && goal->text() != "scenario")
      goal->fail("expected scenario or recorded");
  }
  if (const auto height = node.find("height")) climb.height = height->positive();
  if (const auto friction = node.find("friction")) climb.friction = friction->positive();
  if (const auto toes = node.find("toes")) climb.toes = toes->positive();
  return climb;
}

/// m from the mid-point between the soles to the toes, standing.
double foot_reach(const RobotModel& model, const Scenario& scenario) {
  const Configuration x = start_configuration(model, scenario);
  RobotData data;
  forward_kinematics(model, x, data);
  const Eigen::Vector3d forward(std::cos(scenario.start_yaw), std::sin(scenario.start_yaw), 0.0);
  double reach = 0.0;
  for (const ContactLink& contact : model.contacts)
    for (const Eigen::Vector3d& point : contact.points)
      if (contact.is_patch)
        reach =
            std::max(reach, forward.dot(data.X_WB[static_cast<std::size_t>(contact.body)] * point -
                                        scenario.start_position));
  return reach;
}

void describe_robot(const RobotModel& model, CaseRow& row) {
  row.robot = model.name;
  row.joints = model.joint_count();
  row.mass = model.total_mass;
  for (const ContactLink& contact : model.contacts)
    if (contact.is_patch) row.leg = std::max(row.leg, contact.support_length);
}

void take(const Json& record, const RobotModel& model, CaseRow& row) {
  row.climbs = record.at("success").get<bool>();
  row.contacts = record.value("contacts", "");
  const Json* figures = record.contains("run")    ? &record.at("run")
                        : record.contains("plan") ? &record.at("plan")
                                                  : nullptr;
  if (figures != nullptr) {
    row.peak_torque = figures->at("peak_torque_nm").get<double>();
    row.peak_joint = figures->at("peak_joint").get<std::string>();
    if (const auto joint = model.find_joint(row.peak_joint))
      row.torque_limit = model.joints[static_cast<std::size_t>(*joint)].torque_limit;
  }
  const Json margin =
      record.value("/certificate/worst/support_margin/with_gap"_json_pointer, Json(nullptr));
  if (margin.is_number()) row.support_margin = margin.get<double>();
  if (!row.climbs)
    row.why = record.at("stage").get<std::string>() + ": " + record.at("reason").get<std::string>();
}

std::string cell(std::string text) {
  std::replace(text.begin(), text.end(), '|', '/');
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

}  // namespace

CaseList load_case_list(const fs::path& file) {
  const YamlNode root = YamlNode::load(file);
  root.allow_only({"title", "text", "cases"});
  CaseList list;
  list.title = root.at("title").text();
  if (const auto text = root.find("text")) list.text = text->text();
  std::set<std::string> names;
  for (const YamlNode& node : root.at("cases").items()) {
    list.cases.push_back(read_case(node));
    const std::string& name = list.cases.back().name;
    if (!names.insert(name).second) node.at("name").fail("two cases have this name");
    if (name.find('/') != std::string::npos) node.at("name").fail("expected no '/'");
  }
  return list;
}

CaseRow run_case(const ClimbCase& climb, const fs::path& out, const fs::path& recordings) {
  CaseRow row;
  row.name = climb.name;
  row.height = climb.height;
  SweepInputs inputs = climb.inputs;
  const fs::path folder = out / climb.name;
  const auto found = [&recordings](const std::string& name) {
    std::error_code error;
    const fs::path there = find_file(name);
    return fs::exists(there, error) ? there : recordings / name;
  };
  try {
    if (climb.scale) {
      const fs::path robot = folder / "robot";
      write_scaled_robot(find_robot(inputs.robot), *climb.scale,
                         climb.torque_kept ? ScaledTorque::kKept : ScaledTorque::kWithMass, robot);
      inputs.robot = robot.string();
    }
    const RobotModel model = load_robot({.robot = inputs.robot});
    describe_robot(model, row);
    std::error_code error;
    inputs.recording = found(inputs.recording).string();
    if (inputs.reading.skeleton) inputs.reading.skeleton = found(*inputs.reading.skeleton).string();
    row.skipped = !fs::exists(inputs.recording, error);
    if (row.skipped) return row;
    const double reach = foot_reach(model, load_scenario(find_file(inputs.scenario)));
    const SweepPoint point{.height = climb.height,
                           .friction = climb.friction,
                           .depth = {},
                           .distance = std::round(1e4 * (reach + climb.toes)) / 1e4};
    SweepRunner runner(inputs, folder, true);
    take(runner.run(point), model, row);
    const Json times = Json::parse(read_file(folder / "times" / (point.key() + ".json")));
    for (const char* stage : {"planning_s", "certificate_s"})
      row.planning_time += times.value(stage, 0.0);
  } catch (const InputError& unusable) {
    row.why = unusable.what();
  }
  return row;
}

std::string case_table(const CaseList& list, const std::vector<CaseRow>& rows) {
  const auto climbed =
      std::count_if(rows.begin(), rows.end(), [](const CaseRow& row) { return row.climbs; });
  const auto skipped =
      std::count_if(rows.begin(), rows.end(), [](const CaseRow& row) { return row.skipped; });
  std::string out =
      "# " + list.title + "\n\n" + (list.text.empty() ? "" : list.text + "\n\n") +
      std::to_string(climbed) + " of " + std::to_string(std::ssize(rows) - skipped) +
      " climb, as the simulator's judge "
      "sees it" +
      (skipped > 0 ? "; " + std::to_string(skipped) + " skipped" : "") + ".\n\n" +
      "| case | robot | joints | kg | leg (m) | obstacle (m) | contacts in order | "
      "climbs | peak torque (N m) | of | joint | margin (mm) | planning (s) | why not "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  const auto positive = [](double value, int digits) {
    return fixed(value > 0.0 ? value : std::numeric_limits<double>::quiet_NaN(), digits);
  };
  for (const CaseRow& row : rows) {
    out += "| " + row.name + " | " + row.robot + " | " + std::to_string(row.joints) + " | " +
           positive(row.mass, 1) + " | " + positive(row.leg, 3) + " | " + fixed(row.height, 3) +
           " | " + row.contacts + " | " +
           (row.climbs    ? "yes"
            : row.skipped ? "-"
                          : "no") +
           " | " + positive(row.peak_torque, 1) + " | " + positive(row.torque_limit, 1) + " | " +
           row.peak_joint + " | " + positive(1e3 * row.support_margin, 1) + " | " +
           positive(row.planning_time, 1) + " | " +
           (row.skipped ? "skipped: no recordings" : cell(row.why)) + " |\n";
  }
  return out;
}

}  // namespace clamber
