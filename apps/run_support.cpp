#include "apps/run_support.hpp"

#include <chrono>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <thread>
#include <utility>

#include "apps/controller_config.hpp"
#include "apps/run_events.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr std::chrono::seconds kPatience{5};

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free);
int stop_guards = 0;

void request_stop(int /*signal*/) { stop_requested = true; }

TelemetryConfig config_of(const RobotModel& model, TelemetryConfig config) {
  config.robot = model.name;
  return with_environment(std::move(config));
}

std::vector<std::string> joint_names(const RobotModel& model) {
  std::vector<std::string> names;
  for (const Joint& joint : model.joints) names.push_back(joint.name);
  return names;
}

DescribedLink describe_link(const std::string& name, const std::string& parent, const Pose& pose) {
  const Eigen::Quaterniond q(pose.R);
  return {.name = name,
          .parent = parent,
          .position = {pose.p.x(), pose.p.y(), pose.p.z()},
          .orientation = {q.w(), q.x(), q.y(), q.z()}};
}

/// Bodies behind their joints, and what is fixed to bodies.
std::vector<DescribedLink> links_of(const RobotModel& model) {
  std::vector<DescribedLink> links;
  for (std::size_t b = 1; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    const Body& parent = model.bodies[static_cast<std::size_t>(body.parent)];
    links.push_back(describe_link(body.name, parent.name, body.X_PJ));
    links.back().joint = static_cast<int>(b) - 1;
    links.back().axis = {body.axis.x(), body.axis.y(), body.axis.z()};
  }
  for (const Frame& frame : model.frames) {
    const std::string& carrier = model.bodies[static_cast<std::size_t>(frame.body)].name;
    if (frame.name != carrier) links.push_back(describe_link(frame.name, carrier, frame.X_BF));
  }
  return links;
}

}  // namespace

TelemetryDescription description_of(const RobotModel& model) {
  TelemetryDescription description;
  description.joint_names = joint_names(model);
  for (const Joint& joint : model.joints) description.torque_limits.push_back(joint.torque_limit);
  for (const ContactLink& contact : model.contacts)
    description.contact_names.push_back(contact.name);
  for (std::size_t m = 0; m < kModeCount; ++m)
    description.modes.emplace_back(to_string(static_cast<Mode>(m)));
  for (std::size_t f = 0; f < kFaultCount; ++f)
    description.faults.emplace_back(to_string(static_cast<FaultCode>(f)));
  if (!model.bodies.empty()) description.base = model.bodies.front().name;
  description.links = links_of(model);
  return description;
}

TelemetryDescription description_of(const RobotModel& model, const ExecutedPlan& plan, double dt) {
  TelemetryDescription description = description_of(model);
  description.dt = dt;
  description.plan = plan.sha256;
  description.phases = plan.phases;
  description.urdf = plan.urdf;
  return description;
}

LoadedController::LoadedController(const RobotModel& model, const ControllerConfig& config,
                                   std::span<const std::byte> image)
    : workspace_(Controller::workspace_size(image.size() / sizeof(ImageKeyframe))) {
  const LoadReport loaded = controller.load(config, model.hash, image, workspace_);
  if (loaded.status != LoadStatus::kOk)
    throw InputError("the controller refuses the plan: " + describe(loaded, model));
}

std::unique_ptr<InputLogWriter> log_inputs(const std::string& file, const RobotModel& model,
                                           const ControllerConfig& config,
                                           std::span<const std::byte> image,
                                           const std::string& plan_sha256, std::size_t capacity) {
  if (file.empty()) return nullptr;
  const InputLogHeader header{.robot = model.name,
                              .robot_hash = model.hash,
                              .joint_names = joint_names(model),
                              .plan_sha256 = plan_sha256,
                              .config = config,
                              .image = {image.begin(), image.end()}};
  return std::make_unique<InputLogWriter>(file, header, capacity);
}

StopGuard::StopGuard()
    : interrupt_before_(std::signal(SIGINT, request_stop)),
      terminate_before_(std::signal(SIGTERM, request_stop)) {
  ++stop_guards;
}

StopGuard::~StopGuard() {
  std::signal(SIGINT, interrupt_before_);
  std::signal(SIGTERM, terminate_before_);
  // Here, not when the next one begins: a signal may come as soon as it listens.
  if (--stop_guards == 0) stop_requested = false;
}

const std::atomic<bool>* StopGuard::flag() const noexcept { return &stop_requested; }

RunOperator::RunOperator(const OperatorSettings& settings, const RobotModel& model)
    : server_(settings, desk_, joint_names(model)) {
  std::cout << "operator:    waiting for `clamber arm` at " << settings.socket << '\n'
            << std::flush;
}

std::string RunOperator::summary() const {
  const OperatorCounters counters = server_.counters();
  return "operator:    " + std::to_string(counters.commands) + " commands from " +
         std::to_string(counters.clients) + " clients, " + std::to_string(counters.bad) +
         " lines not understood, " + std::to_string(counters.dropped) + " clients dropped\n";
}

RunTelemetry::RunTelemetry(const RobotModel& model, const TelemetryConfig& wanted,
                           const ExecutedPlan& plan, double dt)
    : memory_(wanted.separate_process ? TelemetryMemory::Kind::kShared
                                      : TelemetryMemory::Kind::kPrivate),
      port_(memory_.block()) {
  const TelemetryConfig config = config_of(model, wanted);
  const TelemetryDescription description = description_of(model, plan, dt);
  if (config.separate_process)
    process_.emplace(
        config, description, memory_,
        std::vector<std::string>{std::filesystem::read_symlink("/proc/self/exe").string(),
                                 kPublisherCommand});
  else
    publisher_.emplace(config, description, memory_.block());
  (void)port_.push(plan_event(plan.sha256));
}

void RunTelemetry::wait_for_room() {
  const RingPositions& ring = memory_.block().record_positions;
  const auto start = std::chrono::steady_clock::now();
  while (waits_ && ring.size() + 1 >= TelemetryBlock::kRecords) {
    std::this_thread::sleep_for(std::chrono::microseconds(200));
    waits_ = std::chrono::steady_clock::now() - start < kPatience;
  }
}

PublisherCounters RunTelemetry::finish() {
  if (publisher_) publisher_->stop();
  if (process_) process_->stop();
  return counters_of(memory_.block());
}

std::string describe(const PublisherCounters& counters) {
  return "telemetry:   " + std::to_string(counters.frames) + " frames and " +
         std::to_string(counters.events) + " events published, " +
         std::to_string(counters.ring_drops) + " dropped, " + std::to_string(counters.refused) +
         " refused" +
         (counters.restarts > 0 ? ", publisher restarted " + std::to_string(counters.restarts) +
                                      " times (" + std::to_string(counters.hangs) + " hung)"
                                : "") +
         "\n";
}

}  // namespace clamber
