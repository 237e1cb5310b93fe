#include "apps/run_support.hpp"

#include <chrono>
#include <csignal>
#include <iostream>
#include <thread>

#include "apps/controller_config.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free);

void request_stop(int /*signal*/) { stop_requested = true; }

TelemetryConfig config_of(const RobotModel& model) {
  TelemetryConfig config;
  config.robot = model.name;
  return with_environment(config);
}

std::vector<std::string> joint_names(const RobotModel& model) {
  std::vector<std::string> names;
  for (const Joint& joint : model.joints) names.push_back(joint.name);
  return names;
}

}  // namespace

TelemetryDescription description_of(const RobotModel& model) {
  TelemetryDescription description;
  description.joint_names = joint_names(model);
  for (const Joint& joint : model.joints) description.torque_limits.push_back(joint.torque_limit);
  for (const ContactLink& contact : model.contacts)
    description.contact_names.push_back(contact.name);
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
  stop_requested = false;
}

StopGuard::~StopGuard() {
  std::signal(SIGINT, interrupt_before_);
  std::signal(SIGTERM, terminate_before_);
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

RunTelemetry::RunTelemetry(const RobotModel& model)
    : publisher_(config_of(model), description_of(model), ring_) {}

void RunTelemetry::wait_for_room() const {
  while (ring_.size() + 1 >= ring_.capacity())
    std::this_thread::sleep_for(std::chrono::microseconds(200));
}

PublisherCounters RunTelemetry::finish() {
  publisher_.stop();
  return publisher_.counters();
}

}  // namespace clamber
