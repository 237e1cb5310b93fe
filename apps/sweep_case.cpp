#include "apps/sweep_case.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "apps/config_files.hpp"
#include "apps/job_failed.hpp"
#include "certificate/acceptance.hpp"
#include "planner_offline/contacts/playback.hpp"
#include "planner_offline/settings_file.hpp"
#include "report/markup.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

void fail(Json& record, const char* stage, const std::string& reason) {
  record["success"] = false;
  record["stage"] = stage;
  record["reason"] = reason;
}

/// Another process may look at the folder meanwhile, and this one may be killed.
void write_whole(const fs::path& file, const std::string& text) {
  const std::string part = file.string() + ".part";
  write_text(part, text);
  std::error_code error;
  fs::rename(part, file, error);
  if (error) throw InputError(file.string() + ": cannot write: " + error.message());
}

/// A reason may quote a recording's name, which need not be UTF-8.
std::string line_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

Json plan_figures(const Plan& plan, const std::string& file, const RobotModel& model) {
  double peak = 0.0;
  Eigen::Index joint = 0;
  double support = std::numeric_limits<double>::infinity();
  for (const Keyframe& keyframe : plan.keyframes) {
    Eigen::Index at = 0;
    const double largest = keyframe.tau.cwiseAbs().maxCoeff(&at);
    if (largest > peak) {
      peak = largest;
      joint = at;
    }
    support = std::min(support, keyframe.support_margin);
  }
  return {{"keyframes", plan.keyframes.size()},
          {"duration_s", plan.keyframes.back().time},
          {"peak_torque_nm", peak},
          {"peak_joint", model.joints[static_cast<std::size_t>(joint)].name},
          {"support_margin_m", support},
          {"sha256", sha256_file(file)}};
}

Json certificate_figures(const Certification& certification) {
  const Json all = to_json(certification);
  Json worst = Json::object();
  for (const Json& margin : all.at("margins"))
    worst[margin.at("name").get<std::string>()] = {{"with_gap", margin.at("with_gap")},
                                                   {"limit", margin.at("limit")},
                                                   {"time", margin.at("time")},
                                                   {"phase", margin.at("phase")}};
  return {{"valid", all.at("valid")},
          {"violations", all.at("violations")},
          {"sha256", all.at("sha256")},
          {"worst", worst}};
}

Json run_figures(const SimulatedRun& run) {
  return {{"success", run.success()},
          {"peak_torque_nm", run.peak_torque},
          {"peak_joint", run.peak_joint},
          {"on_top", run.verdict.final_contacts},
          {"weight_on_obstacle", run.verdict.weight_on_obstacle},
          {"rest_speed", run.verdict.rest_speed}};
}

/// The scenario with the point contacts of the recording's last state as its goal. (Feet do not
/// carry on the obstacle in this goal.)
std::string with_recorded_goal(const std::string& text, const RobotModel& model,
                               const ContactSequence& sequence) {
  YAML::Node root = YAML::Load(text);
  YAML::Node names(YAML::NodeType::Sequence);
  if (!sequence.reduced.empty())
    for (const ContactReference& contact : sequence.reduced.back().obstacle) {
      const auto link = model.find_contact(contact.link);
      if (link && !model.contacts[static_cast<std::size_t>(*link)].is_patch)
        names.push_back(contact.link);
    }
  if (names.size() > 0) {
    if (root["goal"].IsScalar()) {  // a goal of one word has no contacts to put beside it
      YAML::Node goal;
      goal["posture"] = root["goal"].as<std::string>();
      root["goal"] = goal;
    }
    root["goal"]["contacts"] = names;
  }
  std::ostringstream out;
  out << root << '\n';
  return out.str();
}

void save_rejected(const PlanningFailed& error, const fs::path& file) {
  if (error.log() == nullptr) return;
  std::string text;
  for (const std::string& why : error.log()->rejected) text += why + '\n';
  write_text(file.string(), text);
}

}  // namespace

std::string contact_order(const ContactSequence& sequence) {
  std::string order;
  std::set<std::string> before;
  for (const ContactState& state : sequence.reduced) {
    std::set<std::string> links;
    std::string change;
    for (const ContactReference& contact : state.obstacle) {
      links.insert(contact.link);
      if (!before.contains(contact.link)) change += (change.empty() ? "" : " ") + contact.link;
    }
    for (const std::string& link : before)
      if (!links.contains(link)) change += (change.empty() ? "-" : " -") + link;
    if (!change.empty()) order += (order.empty() ? "" : ", ") + change;
    before = std::move(links);
  }
  return order;
}

SweepRunner::SweepRunner(SweepInputs inputs, fs::path out, bool keep_plans)
    : inputs_(std::move(inputs)),
      out_(std::move(out)),
      keep_plans_(keep_plans),
      scenario_(read_file(find_file(inputs_.scenario))),
      program_(sha256_file("/proc/self/exe")) {
  static_cast<void>(parse_scenario(scenario_, inputs_.scenario));
  const Mapped& plain = mapped(0.0);
  const fs::path settings = find_file(inputs_.settings), control = find_file(inputs_.control),
                 margins = find_file(kDefaultMargins),
                 gains = find_robot(inputs_.robot).parent_path() / "control.yaml";
  static_cast<void>(load_planner_settings(settings));
  static_cast<void>(load_acceptance(margins));
  static_cast<void>(load_control(inputs_.control, {.robot = inputs_.robot}, plain.model));
  std::string all = std::string(CLAMBER_VERSION) + (inputs_.plan_only ? " plans" : " climbs") +
                    (inputs_.goal_as_recorded ? " to the recorded goal" : "") + '\n' +
                    plain.model.hash + '\n' + sha256_hex(plain.motion.text) + '\n' +
                    sha256_hex(scenario_) + '\n';
  for (const fs::path& file : {settings, margins, control, gains}) {
    std::error_code error;
    if (fs::exists(file, error)) all += sha256_file(file) + '\n';
  }
  digest_ = sha256_hex(all);
}

fs::path SweepRunner::file(const char* folder, const SweepPoint& point, const char* ending) const {
  return out_ / folder / (point.key() + ending);
}

bool SweepRunner::done(const SweepPoint& point) const {
  const fs::path record = file("cases", point, ".json");
  std::error_code error;
  if (!fs::exists(record, error)) return false;
  const Json json = Json::parse(read_file(record), nullptr, false);
  return json.is_object() && json.value("inputs", "") == digest_ &&
         json.value("program", "") == program_;
}

const SweepRunner::Mapped& SweepRunner::mapped(double ballast) {
  if (const auto found = mapped_.find(ballast); found != mapped_.end()) return found->second;
  Mapped robot;
  robot.model = load_robot(find_robot(inputs_.robot), {.ballast_scale = ballast});
  robot.motion =
      load_motion(inputs_.recording, inputs_.reading, {.robot = inputs_.robot}, robot.model);
  return mapped_.emplace(ballast, std::move(robot)).first->second;
}

const SweepRunner::Contacts& SweepRunner::contacts(const SweepPoint& point,
                                                   const Scenario& scenario, Json& times) {
  const std::tuple key(point.ballast, scenario.obstacles.front().half_extents.x(), point.friction);
  if (const auto found = contacts_.find(key); found != contacts_.end()) return found->second;
  const Mapped& robot = mapped(point.ballast);
  Contacts result;
  times["playback_s"] = quiet_.time("playback", [&] {
    try {
      result = extract_contacts(robot.model, robot.motion.motion, scenario, {});
    } catch (const PlanningFailed& error) {
      result = std::string(error.what());
    }
  });
  return contacts_.emplace(key, std::move(result)).first->second;
}

void SweepRunner::attempt(const SweepPoint& point, Json& record, Json& times) {
  const Mapped& robot = mapped(point.ballast);
  const fs::path scenario_file = file("scenarios", point, ".yaml");
  const std::string text = scenario_text(scenario_, inputs_.scenario, point);
  write_whole(scenario_file, text);
  Scenario scenario = parse_scenario(text, scenario_file.string());
  const ObstacleBox box = scenario.obstacles.front();
  const Eigen::Vector2d inwards(std::cos(box.yaw), std::sin(box.yaw));
  record["depth_m"] = 2.0 * box.half_extents.x();
  record["distance_m"] =
      std::round(1e9 * (inwards.dot(box.center.head<2>() - scenario.start_position.head<2>()) -
                        box.half_extents.x())) /
      1e9;
  record["ballast_kg"] = robot.model.ballast_mass;
  const Contacts& found = contacts(point, scenario, times);
  if (const auto* why = std::get_if<std::string>(&found)) return fail(record, "contacts", *why);
  record["contacts"] = contact_order(std::get<ContactSequence>(found));
  if (inputs_.goal_as_recorded) {
    write_whole(scenario_file,
                with_recorded_goal(text, robot.model, std::get<ContactSequence>(found)));
    scenario = load_scenario(scenario_file);
  }
  PlanFiles files;
  files.plan = file("plans", point, ".json").string();
  files.certificate = file("plans", point, ".cert").string();
  PlanningResult result;
  Certification certification;
  try {
    times["planning_s"] = quiet_.time("planning", [&] {
      try {
        result = make_plan(robot.model, scenario, &std::get<ContactSequence>(found),
                           inputs_.settings, files, quiet_);
      } catch (const PlanningFailed& error) {
        if (keep_plans_) save_rejected(error, file("plans", point, ".rejected.txt"));
        fail(record, "planning", error.what());
      }
    });
    if (!record.at("success").is_null()) return;
  } catch (const InputError& error) {
    throw InputError(point.key() + ": " + error.what());
  }
  record["plan"] = plan_figures(result.plan, files.plan, robot.model);
  times["certificate_s"] = quiet_.time(
      "certificate", [&] { certification = certify_plan(robot.model, scenario, files); });
  record["certificate"] = certificate_figures(certification);
  if (!certification.report.valid) return fail(record, "certificate", certification.report.reason);
  record["success"] = true;
  if (!inputs_.plan_only) execute(robot, scenario, files.plan, record, times);
}

void SweepRunner::execute(const Mapped& robot, const Scenario& scenario, const std::string& plan,
                          Json& record, Json& times) {
  ExecutionOptions options;
  options.control = inputs_.control;
  options.feed_forward = "plan";
  options.dds = false;
  SimulatedRun run;
  try {
    times["execution_s"] = quiet_.time("climb", [&] {
      run = run_plan({.robot = inputs_.robot}, robot.model, scenario, plan, options, {});
    });
  } catch (const InputError& refused) {  // of a plan just made: this case's fault, not the user's
    return fail(record, "execution", refused.what());
  }
  if (run.execution.stopped) throw JobFailed("interrupted; the same command goes on from here");
  record["run"] = run_figures(run);
  if (!run.success()) fail(record, "execution", run.failure(robot.model));
}

Json SweepRunner::run(const SweepPoint& point) {
  Json record = {{"key", point.key()},
                 {"height_m", point.height},
                 {"friction", point.friction},
                 {"depth_m", nullptr},
                 {"distance_m", nullptr},
                 {"ballast", point.ballast},
                 {"ballast_kg", nullptr},
                 {"plan_only", inputs_.plan_only},
                 {"success", nullptr},
                 {"stage", nullptr},
                 {"reason", ""},
                 {"version", CLAMBER_VERSION},
                 {"inputs", digest_},
                 {"program", program_}};
  Json times = {{"key", point.key()}};
  attempt(point, record, times);
  if (!keep_plans_) {
    std::error_code error;
    for (const char* ending : {".json", ".cert"}) fs::remove(file("plans", point, ending), error);
  }
  write_whole(file("times", point, ".json"), line_of(times));
  write_whole(file("cases", point, ".json"), line_of(record));
  return record;
}

std::string describe_case(const Json& record) {
  const std::string key = record.at("key");
  if (!record.at("success"))
    return key + ": no, " + record.at("stage").get<std::string>() + ": " +
           record.at("reason").get<std::string>();
  const Json& figures = record.contains("run") ? record.at("run") : record.at("plan");
  return key + (record.contains("run") ? ": climbs, " : ": plan certified, ") +
         fixed(figures.at("peak_torque_nm").get<double>(), 1) + " N m at most (" +
         figures.at("peak_joint").get<std::string>() + ")";
}

}  // namespace clamber
