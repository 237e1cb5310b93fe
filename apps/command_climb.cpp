// clamber climb: all steps from a recording to a judged climb and its report.
#include <iostream>
#include <memory>

#include "apps/commands.hpp"
#include "apps/job_failed.hpp"
#include "apps/out_folder.hpp"
#include "apps/steps.hpp"
#include "apps/timing_report.hpp"
#include "planner_offline/contacts/playback.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string recording = "configs/recordings/climb_table_synthetic.mvnx";
  std::string out = "out/climb";
  std::string settings = "configs/planner/default.yaml";
  std::string playback_control = "configs/control/playback.yaml";
  bool quick = false;
  RecordingOptions reading;
  ExecutionOptions execution;
  ClimbInputs inputs;
};

class Climb {
 public:
  explicit Climb(const Options& options)
      : options_(options),
        out_(options.out),
        model_(load_robot(options.inputs.robot)),
        scenario_(load_scenario(options.inputs.scenario)) {}

  void run() {
    out_.prepare();
    import_recording();
    play_back();
    analyse_contacts();
    plan();
    execute();
    if (!options_.quick) execute_with_pid_alone();
    finish();
  }

 private:
  double stage(const std::string& name, const std::function<void()>& work) {
    return progress_.time(name, work);
  }
  void planning_stage(const std::string& name, const std::function<void()>& work) {
    summary_.planning_stages.emplace_back(name, stage(name, work));
  }

  void import_recording() {
    planning_stage("import", [&] {
      loaded_ = load_motion(options_.recording, options_.reading, options_.inputs.robot, model_);
      write_text(out_.motion(), loaded_.text);
    });
    std::cout << motion_.recording << (motion_.synthetic ? " (SYNTHETIC)" : "") << ": "
              << motion_.frames.size() << " frames at " << motion_.rate << " Hz\n"
              << clamp_table(motion_) << std::flush;
  }

  void play_back() {
    SimulatedRun playback;
    stage("direct playback, without a plan", [&] {
      playback =
          run_playback(model_, loaded_, scenario_,
                       load_control(options_.playback_control, options_.inputs.robot, model_),
                       out_.playback_log());
    });
    summary_.playback_success = playback.success();
    std::cout << describe(playback, model_) << overload_table(model_, out_.playback_log())
              << std::flush;
  }

  void analyse_contacts() {
    planning_stage("playback analysis", [&] {
      sequence_ = extract_contacts(model_, motion_, scenario_, {});
      save_contacts(sequence_, out_.contacts());
    });
    std::cout << contact_tables(sequence_) << std::flush;
  }

  void plan() {
    const PlanFiles files{.plan = out_.plan(),
                          .certificate = {},
                          .image = out_.image(),
                          .trajectory = out_.trajectory(),
                          .costs = out_.costs(),
                          .rejected = out_.rejected()};
    PlanningResult result;
    stage("planning", [&] {
      result = make_plan(model_, scenario_, &sequence_, options_.settings, files, progress_);
    });
    summary_.planning_stages.insert(summary_.planning_stages.end(), result.stages.begin(),
                                    result.stages.end());
    summary_.plan_sha256 = sha256_file(out_.plan());
    std::cout << describe(result, model_, sequence_.notes) << std::flush;
    Certification certification;
    planning_stage("certificate", [&] { certification = certify_plan(model_, scenario_, files); });
    extra_["certificate"] = to_json(certification);
    std::cout << describe(certification) << std::flush;
    if (!certification.report.valid)
      throw JobFailed("the plan found is not certified: " + certification.report.reason);
  }

  void execute() {
    SimulatedRun run;
    stage("climb", [&] {
      run = run_plan(options_.inputs.robot, model_, scenario_, out_.plan(), options_.execution,
                     out_.log());
    });
    take_verdict(run, summary_);
    failure_ = run.failure(model_);
    summary_.log_sha256 = sha256_file(out_.log());
    extra_["telemetry"] = nullptr;
    if (run.telemetry)
      extra_["telemetry"] = {{"frames", run.telemetry->frames},
                             {"batches", run.telemetry->batches},
                             {"joint_states", run.telemetry->joint_states},
                             {"refused", run.telemetry->refused},
                             {"ring_drops", run.telemetry->ring_drops}};
    if (options_.execution.realtime) extra_["execution"] = to_json(run.execution);
    std::cout << describe(run, model_) << std::flush;
  }

  /// The same plan without its torques, as the paper executes it.
  void execute_with_pid_alone() {
    ExecutionOptions execution = options_.execution;
    execution.feed_forward = "none";
    execution.realtime = false;
    execution.dds = false;
    SimulatedRun run;
    stage("climb with PID alone", [&] {
      run = run_plan(options_.inputs.robot, model_, scenario_, out_.plan(), execution, {});
    });
    extra_["pid_only"] = {{"success", run.success()}, {"peak_torque_nm", run.peak_torque}};
    std::cout << describe(run, model_) << std::flush;
  }

  void finish() {
    summary_.obstacle_height = scenario_.obstacles.front().top();
    summary_.outcome = outcome(scenario_.goal);
    summary_.recording = motion_.recording;
    summary_.synthetic_recording = motion_.synthetic;
    summary_.ballast = model_.ballast_mass;
    extra_["inputs"] = to_json(options_.inputs);
    save_summary(summary_, extra_, out_);
    stage("report", [&] { summary_ = write_report_of(out_, model_, scenario_); });
    save_summary(summary_, extra_, out_);
    std::cout << '\n';
    print_summary(summary_, std::cout);
    std::cout << "report: " << (out_.path() / "report.html").string() << std::endl;
    if (!summary_.success) throw JobFailed("the climb failed: " + failure_);
  }

  const Options& options_;
  OutFolder out_;
  RobotModel model_;
  Scenario scenario_;
  Progress progress_;
  LoadedMotion loaded_;
  const RobotMotion& motion_ = loaded_.motion;
  ContactSequence sequence_;
  Summary summary_;
  Json extra_ = Json::object();
  std::string failure_;
};

}  // namespace

void add_climb_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("climb", "All of it: from a recording to a judged climb and its report");
  command->add_option("recording", options->recording, "recording, or a motion.csv")
      ->capture_default_str();
  command->add_option("--out", options->out, "folder for everything")->capture_default_str();
  command->add_flag("--quick", options->quick, "leave out the second run, with PID alone");
  command->add_option("--planner", options->settings, "the planner's settings")
      ->capture_default_str();
  add_execution_options(*command, options->execution);
  add_recording_options(*command, options->reading);
  add_robot_options(*command, options->inputs.robot);
  add_scenario_options(*command, options->inputs.scenario);
  command->footer(
      "Writes motion.csv, contacts.yaml, plan.json, plan.cert, plan.img, trajectory.csv, "
      "costs.csv,\n"
      "rejected.txt, climb.log, playback.log, summary.json, report.html and pictures. Whatever\n"
      "an earlier climb left in the folder under these names is removed first. Where no plan is\n"
      "found, costs.csv and rejected.txt tell what was tried.\n"
      "Exit code 1: no plan was found, or the judge does not see the robot on top.\n\n"
      "Examples:\n"
      "  clamber climb\n"
      "  clamber climb my_recording.npy --rate 30 --height 0.20 --out out/mine");
  command->callback([options] { Climb(*options).run(); });
}

}  // namespace clamber
