#include "bench/failure_policy/kills.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <deque>

#include "robot_model/kinematics.hpp"
#include "robot_model/loader.hpp"
#include "sim_backend/ode_bus.hpp"

namespace clamber {
namespace {

// At rest: nothing moves faster for so long.
constexpr double kStill = 0.03;     // rad/s, m/s
constexpr double kStillTime = 0.5;  // s
constexpr int kLookEvery = 5;       // ticks

/// Watches the world after a kill.
class FallWatch {
 public:
  FallWatch(const OdeWorld& world, const KillOptions& options)
      : world_(world), options_(options), height_(com().z()), weight_(0.0) {
    for (const Body& body : world.model().bodies) weight_ += kGravity * body.mass;
  }

  /// @return false: it is decided
  bool look(double after, double least) {
    Outcome& o = outcome_;
    o.after = after;
    const Eigen::Vector3d now = com();
    if (last_time_ > 0.0) o.speed = std::max(o.speed, (now - last_).norm() / (after - last_time_));
    last_ = now;
    last_time_ = after;
    o.sunk = height_ - now.z();
    TelemetryFrame truth;
    read_truth(world_, truth);
    o.hit = std::max(o.hit, truth.force_forbidden);
    o.effort =
        world_.drive_torque().squaredNorm() / static_cast<double>(world_.model().joint_count());
    o.fell = o.speed > options_.fall.speed || o.hit > options_.fall.hit * weight_;
    const bool still = world_.velocity().lpNorm<Eigen::Infinity>() < kStill;
    still_since_ = still ? still_since_ : after;
    return !o.fell && !(after > least && after - still_since_ > kStillTime);
  }
  [[nodiscard]] const Outcome& outcome() const { return outcome_; }

 private:
  [[nodiscard]] Eigen::Vector3d com() {
    forward_kinematics(world_.model(), world_.configuration(), data_);
    return data_.com;
  }

  const OdeWorld& world_;
  const KillOptions& options_;
  RobotData data_;
  double height_;
  double weight_;
  Eigen::Vector3d last_ = Eigen::Vector3d::Zero();
  double last_time_ = 0.0, still_since_ = 0.0;
  Outcome outcome_;
};

Outcome alone(OdeWorld& world, OdeBus& bus, FailurePolicy policy, double tick,
              const KillOptions& options) {
  static_cast<void>(bus.set_failure_policy(policy));
  FallWatch watch(world, options);
  // Drives that sink are at rest before they have let go: theirs is watched at least so long.
  const double least = policy == FailurePolicy::kLower ? DrivesAlone{}.lower_time : 0.0;
  const auto ticks = static_cast<int>(std::llround(options.watch / tick));
  for (int i = 1; i <= ticks; ++i) {
    bus.pass();
    if (i % kLookEvery == 0 && !watch.look(i * tick, least)) break;
  }
  return watch.outcome();
}

/// Copies of this process, at most so many at a time, each with one outcome to tell.
class Copies {
 public:
  explicit Copies(int jobs) : jobs_(jobs) {}

  template <class Work>
  void start(Outcome* result, const Work& work) {
    while (std::ssize(running_) >= jobs_) finish_one();
    int ends[2];
    if (pipe(ends) != 0) throw InputError("cannot make a pipe");
    const pid_t child = fork();
    if (child < 0) throw InputError("cannot start a process");
    if (child == 0) {
      const Outcome outcome = work();
      const bool written = write(ends[1], &outcome, sizeof(outcome)) == sizeof(outcome);
      _exit(written ? 0 : 1);
    }
    close(ends[1]);
    running_.push_back({child, ends[0], result});
  }
  void finish() {
    while (!running_.empty()) finish_one();
  }

 private:
  struct Copy {
    pid_t child;
    int end;
    Outcome* result;
  };
  void finish_one() {
    const Copy copy = running_.front();
    running_.pop_front();
    const bool told = read(copy.end, copy.result, sizeof(Outcome)) == sizeof(Outcome);
    close(copy.end);
    waitpid(copy.child, nullptr, 0);
    if (!told) throw InputError("a copy of the climb ended without telling how");
  }

  int jobs_;
  std::deque<Copy> running_;
};

}  // namespace

std::vector<Kill> kill_everywhere(const KillInputs& inputs, const KillOptions& options) {
  const ControllerConfig& control = inputs.control;
  Perturbation used = options.perturbation.value_or(Perturbation{});
  if (!options.perturbation) used.step = control.dt;
  Controller controller;
  std::vector<double> workspace(
      Controller::workspace_size(inputs.image.size() / sizeof(ImageKeyframe)));
  const LoadReport loaded = controller.load(control, inputs.model.hash, inputs.image, workspace);
  if (loaded.status != LoadStatus::kOk)
    throw InputError(std::string("the controller refuses the plan: ") + to_string(loaded.status));
  controller.request(OperatorCommand::kArm);
  controller.request(OperatorCommand::kStart);
  OdeWorld world(
      perturbed(inputs.model, used), perturbed(inputs.scenario, used),
      perturbed(start_configuration(inputs.model, inputs.scenario), inputs.scenario, used),
      perturbed(OdeOptions{}, used));
  OdeBus bus(world, used.drives, control.dt);
  if (bus.enable() != BusStatus::kOk) throw InputError("the simulation does not start");

  std::vector<JointState> states(inputs.model.joints.size());
  std::vector<JointCommand> commands(states.size());
  TelemetryFrame frame;
  std::vector<Kill> kills;
  const auto stride = static_cast<std::uint64_t>(std::llround(options.stride / control.dt));
  const auto first = static_cast<std::uint64_t>(std::llround(options.first / control.dt));
  Copies copies(options.jobs);
  for (;;) {
    if (bus.exchange(commands, states, 0) != BusStatus::kOk) break;
    const TickStatus status = controller.tick(states, commands, frame);
    if (status == TickStatus::kFinished || status == TickStatus::kFault) break;
    if (frame.time > options.last) break;
    static_cast<void>(bus.set_failure_policy(controller.lost_host_policy()));
    if (frame.sequence < first || (frame.sequence - first) % stride != 0) continue;
    Kill kill{.time = frame.time,
              .plan_time = frame.plan_time,
              .phase = frame.phase,
              .planned = controller.lost_host_policy()};
    for (const auto policy : {FailurePolicy::kHold, FailurePolicy::kLower, FailurePolicy::kLimp})
      copies.start(&kill.of[static_cast<std::size_t>(policy)],
                   [&] { return alone(world, bus, policy, control.dt, options); });
    copies.finish();
    kills.push_back(kill);
    if (options.done) options.done(kill);
  }
  return kills;
}

}  // namespace clamber
