// Time of one control tick: interpolate, supervise, PID, feed-forward, telemetry frame, and encode
// every joint's command as a frame of the mit protocol.
//   tick [ticks per row]
// Against joints (6 to 32) and against the length of the plan (20 s to 15 min).
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "bench/stopwatch.hpp"
#include "firmware_hal/codec/mit.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

/// `count` keyframes 0.1 s apart that stay within +-0.6 rad.
std::vector<ImageKeyframe> long_plan(std::uint32_t joints, std::size_t count) {
  std::vector<ImageKeyframe> keyframes(count);
  for (std::size_t i = 0; i < count; ++i) {
    ImageKeyframe& k = keyframes[i];
    k.time = 0.1 * static_cast<double>(i);
    for (std::uint32_t j = 0; j < joints; ++j) {
      k.q[j] = 0.3 * (1.0 - std::cos(0.5 * k.time * (1.0 + 0.01 * j)));
      k.tau[j] = 2.0 * std::sin(0.2 * k.time + j);
    }
  }
  return keyframes;
}

MitDrive drive(std::uint16_t id) {
  return {.id = id,
          .reply_id = id,
          .ranges = {.position = {-12.5, 12.5},
                     .velocity = {-45.0, 45.0},
                     .kp = {0.0, 500.0},
                     .kd = {0.0, 5.0},
                     .torque = {-54.0, 54.0},
                     .reply_torque = {-54.0, 54.0},
                     .voltage = {0.0, 60.0}},
          .reply = MitReplyKind::kTemperatureError,
          .format = {}};
}

struct Row {
  double p50 = 0.0, p99 = 0.0, p999 = 0.0, worst = 0.0;  ///< us
};

Row measure(std::uint32_t joints, std::size_t keyframes, std::size_t ticks) {
  const auto image = test::make_image(joints, long_plan(joints, keyframes));
  const ControllerConfig config = test::make_config(joints);
  std::vector<double> workspace(Controller::workspace_size(keyframes));
  const auto controller = std::make_unique<Controller>();
  const auto load = [&] {
    if (controller->load(config, test::kRobotHash, image, workspace).status != LoadStatus::kOk)
      std::exit((std::fprintf(stderr, "the plan is refused\n"), 1));
    controller->request(OperatorCommand::kArm);
    controller->request(OperatorCommand::kStart);
  };
  std::vector<MitDrive> drives;
  for (std::uint32_t j = 0; j < joints; ++j) drives.push_back(drive(static_cast<std::uint16_t>(j)));
  std::vector<CanFrame> frames(joints);
  TelemetryFrame telemetry;
  std::vector<double> times;
  times.reserve(ticks);
  // Every plan from its start: a row of a long plan sees as much of it as there are ticks.
  load();
  test::PlantRobot robot(joints);
  unsigned refused = 0;
  while (times.size() < ticks) {
    TickStatus status = TickStatus::kWaiting;
    times.push_back(bench::microseconds([&] {
      status = controller->tick(robot.states, robot.commands, telemetry);
      for (std::uint32_t j = 0; j < joints; ++j)
        refused +=
            encode_mit_command(drives[j], robot.commands[j], frames[j]) == CodecStatus::kNotFinite
                ? 1
                : 0;
    }));
    robot.step(config.dt);
    if (status == TickStatus::kFinished) {
      load();
      for (auto& plant : robot.plants) plant = test::Plant{};
      for (auto& state : robot.states) state = JointState{};
    }
    if (status == TickStatus::kFault || refused > 0)
      std::exit((std::fprintf(stderr, "fault: %s\n", to_string(controller->fault())), 1));
  }
  return {bench::quantile(times, 0.5), bench::quantile(times, 0.99), bench::quantile(times, 0.999),
          bench::quantile(times, 1.0)};
}

void print(std::uint32_t joints, std::size_t keyframes, std::size_t ticks) {
  const Row row = measure(joints, keyframes, ticks);
  std::printf("%6u %9zu %7.2f %7.2f %7.2f %9.1f\n", joints, keyframes, row.p50, row.p99, row.p999,
              row.worst);
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  const std::size_t ticks = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 200000;
  std::printf("%zu ticks a row, us\njoints keyframes     p50     p99   p99.9     worst\n", ticks);
  for (const std::uint32_t joints : {6u, 12u, 23u, 32u}) clamber::print(joints, 200, ticks);
  for (const std::size_t keyframes : {20u, 200u, 2000u, 8192u})
    clamber::print(23, keyframes, ticks);
  return 0;
}
