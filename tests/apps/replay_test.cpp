// Replay: a stored log of the controller's inputs gives the same commands to the bit, and what
// differs is found. CLAMBER_WRITE_REPLAY=1 makes the stored log anew: needed only when the
// controller is meant to command something else than before.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

#include "apps/input_log.hpp"
#include "control/crc32c.hpp"
#include "robot_model/loader.hpp"
#include "tests/control/test_plan.hpp"

namespace clamber {
namespace {

constexpr std::uint32_t kJoints = 3;
const std::filesystem::path kStored =
    std::filesystem::path(CLAMBER_SOURCE_DIR) / "tests/apps/replay/pause_loss_estop.inputs";

InputLogHeader header() {
  InputLogHeader h{.robot = "three joints",
                   .robot_hash = std::string(test::kRobotHash),
                   .joint_names = {"one", "two", "three"},
                   .plan_sha256 = "none",
                   .config = test::make_config(kJoints),
                   .image = test::make_image(kJoints, test::smooth_keyframes(kJoints, 16))};
  h.config.dt = 4e-3;
  h.config.failure_policy = FailurePolicy::kLower;
  h.config.lowering_time = 0.4;
  h.config.joints[1].spring_stiffness = 250.0;
  return h;
}

/// A start, a slow-down, a pause, lost replies, an e-stop, lowering, and a start again: 500 ticks.
void make_log(const std::filesystem::path& file, const InputLogHeader& h) {
  InputLogWriter writer(file, h, 600);
  Controller controller;
  std::vector<double> workspace(Controller::workspace_size(16));
  ASSERT_EQ(controller.load(h.config, h.robot_hash, h.image, workspace).status, LoadStatus::kOk);
  test::PlantRobot robot(kJoints);
  robot.plants[1].load = -3.0;
  TelemetryFrame frame;
  for (int i = 0; i < 500; ++i) {
    if (i == 3) controller.request(OperatorCommand::kArm);
    if (i == 10) controller.request(OperatorCommand::kStart);
    if (i == 120) controller.set_speed(0.6);
    if (i == 150) controller.request(OperatorCommand::kPause);
    if (i == 230) controller.request(OperatorCommand::kResume);
    if (i == 250) controller.set_bus_health({.skipped_ticks = 3});
    if (i == 300) controller.request(OperatorCommand::kEstop);
    if (i == 420) controller.request(OperatorCommand::kAck);
    if (i == 425) controller.request(OperatorCommand::kArm);
    if (i == 440) controller.request(OperatorCommand::kStart);
    std::vector<JointState> states = robot.states;
    if (i >= 260 && i < 263) states[2].flags |= kJointStale;
    if (i == 270) states[0].q += 0.2;
    writer.before(controller, states);
    static_cast<void>(controller.tick(states, robot.commands, frame));
    writer.after(robot.commands);
    robot.step(h.config.dt);
  }
  writer.close();
  EXPECT_EQ(writer.dropped(), 0u);
}

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class ReplayTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_);
    if (std::getenv("CLAMBER_WRITE_REPLAY") == nullptr) return;
    std::filesystem::create_directories(kStored.parent_path());
    make_log(kStored, header());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// The stored log with one bit of it turned.
  InputLog flipped(std::size_t byte, unsigned bit) {
    std::string bytes = bytes_of(kStored);
    bytes[byte] = static_cast<char>(static_cast<unsigned char>(bytes[byte]) ^ (1u << bit));
    const std::filesystem::path file = folder_ / "flipped.inputs";
    std::ofstream(file, std::ios::binary) << bytes;
    return load_input_log(file);
  }

  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("clamber_replay_" + std::to_string(getpid()));
};

constexpr std::size_t kTickBytes = sizeof(InputTick) + kJoints * sizeof(InputJoint);

TEST_F(ReplayTest, TheStoredLogGivesTheSameCommandsToTheBit) {
  const InputLog log = load_input_log(kStored);
  ASSERT_EQ(log.ticks.size(), 500u);
  const Replay result = replay(log);
  EXPECT_FALSE(result.difference) << result.difference->tick << ' ' << result.difference->joint
                                  << ": " << result.difference->what;
  EXPECT_EQ(result.ticks, 500u);
  EXPECT_EQ(result.end.mode, Mode::kMovingToStart);
  EXPECT_LT(std::filesystem::file_size(kStored), 200'000u);
}

TEST_F(ReplayTest, ANewLogOfTheSameRunIsTheStoredOne) {
  // With the stored image: its keyframes hold sines, whose last bit is the C library's.
  make_log(folder_ / "again.inputs", load_input_log(kStored).header);
  // Text before the records may change with the settings' names; the records may not.
  const std::string again = bytes_of(folder_ / "again.inputs"), stored = bytes_of(kStored);
  const std::size_t records = 500 * kTickBytes;
  ASSERT_GT(again.size(), records);
  EXPECT_TRUE(again.substr(again.size() - records) == stored.substr(stored.size() - records));
}

TEST_F(ReplayTest, AFlippedBitIsFoundAtItsTickAndJoint) {
  const std::size_t size = std::filesystem::file_size(kStored);
  for (std::size_t i = 0; i < 60; ++i) {
    const std::size_t tick = (i * 131) % 500, joint = i % kJoints, byte = (i * 37) % 96;
    const std::size_t where = size - 500 * kTickBytes + tick * kTickBytes + sizeof(InputTick) +
                              joint * sizeof(InputJoint) + byte;
    const Replay result = replay(flipped(where, i % 8));
    ASSERT_TRUE(result.difference) << i;
    EXPECT_EQ(result.difference->tick, tick);
    EXPECT_EQ(result.difference->joint, header().joint_names[joint]);
  }
  const Replay head = replay(flipped(size - 100 * kTickBytes + 8, 2));
  ASSERT_TRUE(head.difference);
  EXPECT_EQ(head.difference->tick, 400u);
}

/// With a checksum that fits: another input, or another command, and not a damaged file.
TEST_F(ReplayTest, AnotherInputOrCommandIsNamed) {
  InputLog log = load_input_log(kStored);
  const auto seal = [](InputJoint& row) {
    row.crc = crc32c(std::as_bytes(std::span(&row, 1)).first(offsetof(InputJoint, crc)));
  };
  InputJoint& row = log.rows[200 * kJoints + 1];
  row.state.q = std::nextafter(row.state.q, 1.0);
  seal(row);
  const Replay other_input = replay(log);
  ASSERT_TRUE(other_input.difference);
  EXPECT_EQ(other_input.difference->tick, 200u);
  EXPECT_EQ(other_input.difference->joint, "two");
  EXPECT_TRUE(other_input.difference->what.starts_with("command's tau: logged "))
      << other_input.difference->what;

  log = load_input_log(kStored);
  log.rows[77 * kJoints].command.kp = -0.0;
  seal(log.rows[77 * kJoints]);
  const Replay other_command = replay(log);
  ASSERT_TRUE(other_command.difference);
  EXPECT_EQ(other_command.difference->tick, 77u);
  EXPECT_EQ(other_command.difference->joint, "one");
}

TEST_F(ReplayTest, RefusesWhatIsNoLog) {
  const auto refused = [&](const std::string& bytes) {
    std::ofstream(folder_ / "bad.inputs", std::ios::binary) << bytes;
    EXPECT_THROW(static_cast<void>(load_input_log(folder_ / "bad.inputs")), InputError);
  };
  const std::string whole = bytes_of(kStored);
  refused("");
  refused("{}\n");
  refused(whole.substr(0, 500));
  refused(whole.substr(0, whole.size() - 1));
  refused(whole.substr(0, whole.find('\n') + 100));
}

}  // namespace
}  // namespace clamber
