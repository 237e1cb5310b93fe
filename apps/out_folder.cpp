#include "apps/out_folder.hpp"

#include <sys/utsname.h>

#include <deque>
#include <system_error>

#include "apps/executed_plan.hpp"
#include "apps/run_events.hpp"
#include "apps/run_support.hpp"
#include "planner_offline/contacts/contact_sequence.hpp"
#include "planner_offline/plan.hpp"
#include "report/report.hpp"
#include "report/scene_json.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "web/page.hpp"
#include "web/story.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json read_summary_file(const OutFolder& out) {
  const std::string text = read_file(out.summary());
  try {
    return Json::parse(text);
  } catch (const Json::exception& error) {
    throw InputError(out.summary() + ": not a JSON file: " + error.what());
  }
}

/// What the files beside it do not say again.
Summary parse_summary(const Json& json) {
  Summary summary;
  summary.success = json.at("success");
  const Json& judge = json.at("judge");
  summary.judge = {.final_contacts = judge.at("final_contacts"),
                   .floor_contacts = judge.at("floor_contacts"),
                   .weight_on_obstacle = judge.at("weight_on_obstacle"),
                   .forbidden_contacts = judge.at("forbidden_contacts"),
                   .rest_speed = judge.at("rest_speed")};
  summary.obstacle_height = json.at("obstacle_height_m");
  summary.outcome = json.at("outcome");
  summary.recording = json.at("recording");
  if (!json.at("playback_success").is_null())
    summary.playback_success = json.at("playback_success").get<bool>();
  for (const auto& [stage, seconds] : json.at("planning_s").items())
    if (stage != "total") summary.planning_stages.emplace_back(stage, seconds.get<double>());
  summary.real_time_factor = json.at("real_time_factor");
  summary.plan_sha256 = json.at("plan_sha256");
  summary.log_sha256 = json.at("log_sha256");
  summary.synthetic_recording = json.at("synthetic_recording");
  summary.feed_forward = json.at("feed_forward");
  summary.ballast = json.at("ballast_kg");
  return summary;
}

NamedValues telemetry_counters(const Json& json) {
  NamedValues counters;
  if (const auto telemetry = json.find("telemetry");
      telemetry != json.end() && telemetry->is_object())
    for (const auto& [name, count] : telemetry->items()) counters.emplace_back(name, count.dump());
  return counters;
}

CertificateTable certificate_table(const Json& json) {
  const auto found = json.find("certificate");
  if (found == json.end() || !found->is_object()) return {};
  CertificateTable table{.valid = found->at("valid"),
                         .samples = found->at("samples"),
                         .margins = {},
                         .covered = found->at("covered"),
                         .not_covered = found->at("not_covered")};
  for (const Json& m : found->at("margins"))
    table.margins.push_back({.name = m.at("name"),
                             .unit = m.at("unit"),
                             .worst = m.at("worst"),
                             .with_gap = m.at("with_gap"),
                             .limit = m.at("limit"),
                             .time = m.at("time"),
                             .phase = m.at("phase")});
  return table;
}

NamedValues environment() {
  NamedValues values = {{"Clamber", CLAMBER_VERSION},          {"build", CLAMBER_BUILD_TYPE},
                        {"compiler", CLAMBER_COMPILER},        {"ODE", CLAMBER_ODE_VERSION},
                        {"Fast DDS", CLAMBER_FASTDDS_VERSION}, {"Eigen", CLAMBER_EIGEN_VERSION}};
  utsname system{};
  if (uname(&system) == 0)
    values.emplace_back("system",
                        std::string(system.sysname) + " " + system.release + " " + system.machine);
  return values;
}

RunData load_run(const std::string& label, const std::string& log, const RobotModel& model,
                 const Scenario& scenario) {
  RunLog run = load_run_log(log);
  if (run.header.robot_hash != model.hash)
    throw InputError(log + ": run of another robot: '" + run.header.robot + "', not '" +
                     model.name + "'");
  return {.label = label, .model = model, .scenario = scenario, .frames = std::move(run.frames)};
}

ContactTable table_of(const std::vector<ContactState>& states) {
  ContactTable table;
  for (const ContactState& state : states) {
    ContactTableState entry{
        .name = "State" + std::to_string(table.size() + 1), .links = {}, .s = state.stability};
    for (const ContactReference& contact : state.obstacle) entry.links.push_back(contact.link);
    table.push_back(std::move(entry));
  }
  return table;
}

/// What the climb's log tells of it, as the page shows it.
std::string story_of(const ReportInput& input) {
  const TelemetryDescription names =
      description_of(input.climb.model,
                     {.sha256 = input.summary.plan_sha256,
                      .urdf = {},
                      .phases = describe_phases(input.plan, input.climb.model)},
                     0.0);
  LoggedEvents log(names);
  std::deque<TelemetryEvent> events;
  for (const TelemetryFrame& frame : input.climb.frames)
    log.after_tick(frame, [&](const TelemetryEvent& event) { events.push_back(event); });
  return story_json(names, events);
}

/// The climb to look at in the browser. False where the program has no page.
bool write_climb_page(const ReportInput& input, const OutFolder& out) {
  const RunData& climb = input.climb;
  const std::string page =
      web_page_with_run({.name = climb.model.name + ", " + climb.scenario.name,
                         .scene = scene_json(climb.model, climb.scenario),
                         .story = story_of(input),
                         .joints = climb.model.joints.size(),
                         .contacts = climb.model.contacts.size(),
                         .next = [&climb, i = std::size_t{0}](TelemetryFrame& frame) mutable {
                           if (i == climb.frames.size()) return false;
                           frame = climb.frames[i++];
                           return true;
                         }});
  if (!page.empty()) write_text((out.path() / "climb.html").string(), page);
  return !page.empty();
}

}  // namespace

void OutFolder::prepare() const {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) throw InputError(folder_.string() + ": cannot be made: " + error.message());
  for (const char* name :
       {"motion.csv", "contacts.yaml", "plan.json", "plan.cert", "plan.img", "trajectory.csv",
        "costs.csv", "rejected.txt", "climb.log", "playback.log", "summary.json", "report.html",
        "climb.html", "climb.png", "playback.png", "torque.svg"})
    fs::remove(folder_ / name, error);
}

void take_verdict(const SimulatedRun& run, Summary& summary) {
  summary.success = run.success();
  summary.judge = {.final_contacts = run.verdict.final_contacts,
                   .floor_contacts = run.verdict.floor_contacts,
                   .weight_on_obstacle = run.verdict.weight_on_obstacle,
                   .forbidden_contacts = run.verdict.forbidden_contacts,
                   .rest_speed = run.verdict.rest_speed};
  summary.feed_forward = run.feed_forward;
  summary.real_time_factor = run.real_time_factor();
}

void save_summary(const Summary& summary, const Json& extra, const OutFolder& out) {
  Json json = to_json(summary);
  for (const auto& [key, value] : extra.items()) json[key] = value;
  write_text(out.summary(), json.dump(2) + '\n');
}

Summary write_report_of(const OutFolder& out, const RobotModel& model, const Scenario& scenario) {
  const Json json = read_summary_file(out);
  ReportInput input;
  try {
    input.summary = parse_summary(json);
    input.counters = telemetry_counters(json);
    input.certificate = certificate_table(json);
  } catch (const Json::exception& error) {
    throw InputError(out.summary() + ": not a summary of a climb: " + error.what());
  }
  input.plan = load_plan(out.plan());
  if (input.plan.robot_hash != model.hash || input.plan.scenario_hash != scenario.hash)
    throw InputError(out.plan() + ": made for another robot or scenario than " + model.name +
                     " and " + scenario.name);
  input.climb = load_run("climb", out.log(), model, scenario);
  if (fs::exists(out.playback_log()))
    input.playback = load_run("playback", out.playback_log(), model, scenario);
  const ContactSequence contacts = load_contacts(out.contacts(), model);
  input.contacts = table_of(contacts.states);
  input.reduced_contacts = table_of(contacts.reduced);
  input.environment = environment();
  measure_peaks(input.climb, input.playback ? &*input.playback : nullptr, input.summary);
  if (write_climb_page(input, out)) input.viewer = "climb.html";
  write_report(input, out.path());
  return input.summary;
}

Json to_json(const ClimbInputs& inputs) {
  return {{"robot", inputs.robot.robot},
          {"ballast", inputs.robot.ballast},
          {"scenario", inputs.scenario.scenario},
          {"height_m", inputs.scenario.height ? Json(*inputs.scenario.height) : Json(nullptr)}};
}

ClimbInputs load_inputs(const OutFolder& out) {
  const Json json = read_summary_file(out);
  try {
    const Json& given = json.at("inputs");
    ClimbInputs inputs;
    inputs.robot = {.robot = given.at("robot"), .ballast = given.at("ballast")};
    inputs.scenario.scenario = given.at("scenario");
    if (!given.at("height_m").is_null())
      inputs.scenario.height = given.at("height_m").get<double>();
    return inputs;
  } catch (const Json::exception& error) {
    throw InputError(out.summary() + ": not a summary of a climb: " + error.what());
  }
}

}  // namespace clamber
