// The controller against inputs at their worst, and an hour of operation.
//   random_inputs [--ticks N] [--joints N] [--seed N]   adversarial inputs (10 million ticks)
//   random_inputs --hour [--ticks N] [--joints N]       3.6 million ticks of plans, pauses and
//                                                       stops: heap calls and page faults counted
// Exit code 1: a rule did not hold, or something was allocated. tests/control/adversary_test.cpp is
// a slice of the first.
#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "bench/stopwatch.hpp"
#include "tests/control/adversary.hpp"
#include "tests/control/allocation_guard.hpp"

namespace clamber {
namespace {

struct Options {
  bool hour = false;
  std::uint64_t ticks = 0;
  std::uint32_t joints = 0;
  std::uint64_t seed = 1;
};

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const auto number = [&] { return i + 1 < argc ? std::strtoull(argv[++i], nullptr, 10) : 0; };
    if (std::strcmp(argv[i], "--hour") == 0)
      options.hour = true;
    else if (std::strcmp(argv[i], "--ticks") == 0)
      options.ticks = number();
    else if (std::strcmp(argv[i], "--joints") == 0)
      options.joints = static_cast<std::uint32_t>(number());
    else if (std::strcmp(argv[i], "--seed") == 0)
      options.seed = number();
    else
      std::exit((std::fprintf(stderr, "unknown option %s\n", argv[i]), 2));
  }
  if (options.ticks == 0) options.ticks = options.hour ? 3'600'000 : 10'000'000;
  if (options.joints == 0) options.joints = options.hour ? 23 : 6;
  return options;
}

int attack(const Options& options) {
  test::Adversary adversary(options.seed, options.joints);
  const bench::Stopwatch watch;
  const test::CampaignResult result = adversary.run(options.ticks);
  test::print(result, stdout);
  std::printf("%.1f s of processor time\n", watch.elapsed().processor);
  return result.broken.empty() ? 0 : 1;
}

struct PageFaults {
  long minor = 0, major = 0;
  static PageFaults now() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return {usage.ru_minflt, usage.ru_majflt};
  }
};

/// An operator who works: starts again at the end, pauses, slows down, stops.
void operate(Controller& controller, TickStatus status, std::uint64_t tick) {
  if (status == TickStatus::kIdle || status == TickStatus::kStopped ||
      status == TickStatus::kFinished)
    controller.request(OperatorCommand::kStart);
  if (tick % 7919 == 5000) controller.request(OperatorCommand::kPause);
  if (status == TickStatus::kPaused && tick % 1000 == 0)
    controller.request(OperatorCommand::kResume);
  if (tick % 30011 == 20000) controller.request(OperatorCommand::kStop);
  if (tick % 4001 == 0) controller.set_speed(0.4 + 0.2 * static_cast<double>(tick / 4001 % 4));
}

int operate_for_an_hour(const Options& options) {
  constexpr std::size_t kKeyframes = 81;
  constexpr std::uint64_t kWarmUp = 1000;
  const auto image =
      test::make_image(options.joints, test::smooth_keyframes(options.joints, kKeyframes));
  ControllerConfig config = test::make_config(options.joints);
  for (JointControl& joint : config.joints) joint.lower = -4.0, joint.upper = 4.0;
  config.start_distance_limit = 1.0;
  std::vector<double> workspace(Controller::workspace_size(kKeyframes));
  test::PlantRobot robot(options.joints);
  const auto controller = std::make_unique<Controller>();
  if (controller->load(config, test::kRobotHash, image, workspace).status != LoadStatus::kOk)
    return 1;
  controller->request(OperatorCommand::kArm);
  TelemetryFrame frame;
  std::array<std::uint64_t, 9> statuses{};
  TickStatus status = TickStatus::kWaiting;
  std::uint64_t calls = 0;
  const bench::Stopwatch watch;
  PageFaults before;
  {
    const test::AllocationGuard guard;
    for (std::uint64_t i = 0; i < options.ticks + kWarmUp; ++i) {
      if (i == kWarmUp) before = PageFaults::now();
      operate(*controller, status, i);
      status = controller->tick(robot.states, robot.commands, frame);
      ++statuses[static_cast<std::size_t>(status)];
      robot.step(config.dt);
    }
    calls = guard.calls();
  }
  const PageFaults after = PageFaults::now();
  std::printf("%llu ticks of 1 ms, %u joints, %.1f s of processor time\n",
              static_cast<unsigned long long>(options.ticks), options.joints,
              watch.elapsed().processor);
  for (std::size_t s = 0; s < statuses.size(); ++s)
    std::printf("  %-26s %9llu ticks\n", to_string(static_cast<TickStatus>(s)),
                static_cast<unsigned long long>(statuses[s]));
  std::printf("%llu heap calls%s, %ld minor and %ld major page faults after %llu ticks\n",
              static_cast<unsigned long long>(calls),
              test::allocation_guard_works() ? "" : " (not counted: sanitizer)",
              after.minor - before.minor, after.major - before.major,
              static_cast<unsigned long long>(kWarmUp));
  return calls == 0 && statuses[static_cast<std::size_t>(TickStatus::kFault)] == 0 ? 0 : 1;
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  const clamber::Options options = clamber::parse(argc, argv);
  return options.hour ? clamber::operate_for_an_hour(options) : clamber::attack(options);
}
