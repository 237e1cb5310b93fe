// The control loop on an emulated Cortex-M7 through a recorded climb: every command and every CAN
// frame of every tick to the same bit as on this machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <sstream>

#include "apps/controller_config.hpp"
#include "apps/run_log.hpp"
#include "control/crc32c.hpp"
#include "firmware_hal/bare_metal/climb_loop.hpp"
#include "firmware_hal/bus_map.hpp"
#include "planner_offline/plan_image.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

/// Why the loop cannot be run here; empty: it can.
std::string missing() {
  if (std::string(CLAMBER_FIRMWARE).empty()) return "no arm-none-eabi-g++ when this was configured";
  if (std::string(CLAMBER_QEMU).empty()) return "no qemu-system-arm when this was configured";
  return {};
}
bool in_ci() { return std::getenv("CI") != nullptr; }

/// A recorded climb as what the loop reads.
struct Stream {
  StreamHeader header;
  std::vector<std::byte> image;
  std::vector<JointState> states;  ///< tick by tick

  [[nodiscard]] std::span<const JointState> tick(std::size_t i) const {
    return std::span(states).subspan(i * header.joint_count, header.joint_count);
  }
};

Stream recorded_climb() {
  const fs::path folder = CLAMBER_CLIMB_FOLDER;
  const fs::path configs = fs::path(CLAMBER_SOURCE_DIR) / "configs";
  const fs::path robot = configs / "robots/coman";
  const RobotModel model = load_robot(robot / "robot.yaml");
  const RunLog log = load_run_log(folder / "climb.log");
  Stream stream;
  stream.image = read_plan_image(folder / "plan.img");
  StreamHeader& header = stream.header;
  header.joint_count = static_cast<std::uint32_t>(model.joints.size());
  header.tick_count = static_cast<std::uint32_t>(log.frames.size());
  header.image_bytes = static_cast<std::uint32_t>(stream.image.size());
  std::copy(model.hash.begin(), model.hash.end(), header.robot_hash.begin());
  header.control =
      load_controller_config(configs / "control/default.yaml", model, robot / "control.yaml");
  for (const Bus& bus : load_bus_map(configs / "hal/coman_mit.yaml", model).buses)
    for (const JointDrive& drive : bus.drives) {
      LoopDrive& loop = header.drives[static_cast<std::size_t>(drive.joint)];
      loop.mit = mit_drive(bus, drive);
      loop.mounting = {drive.joint, drive.direction, drive.zero};
    }
  for (const Bus& bus : load_bus_map(configs / "hal/coman_cia402.yaml", model).buses)
    for (const JointDrive& drive : bus.drives)
      header.drives[static_cast<std::size_t>(drive.joint)].cia402 = cia402_drive(bus, drive);
  for (const TelemetryFrame& frame : log.frames)
    for (std::size_t j = 0; j < header.joint_count; ++j)
      stream.states.push_back({.q = frame.q[j],
                               .dq = frame.dq[j],
                               .tau = frame.tau_meas[j],
                               .temperature = 25.0,
                               .flags = kJointEnabled,
                               .sequence = frame.sequence + 1});
  return stream;
}

/// All ticks' records, as this machine computes them.
std::vector<std::byte> run_here(const Stream& stream) {
  ClimbLoop loop(stream.header);
  std::vector<double> workspace(
      Controller::workspace_size(stream.image.size() / sizeof(ImageKeyframe)));
  const LoadReport report = loop.start(stream.image, workspace, stream.tick(0));
  EXPECT_EQ(report.status, LoadStatus::kOk) << to_string(report.image);
  const std::size_t size = record_size(stream.header.joint_count);
  std::vector<std::byte> records(stream.header.tick_count * size);
  for (std::size_t i = 0; i < stream.header.tick_count; ++i)
    loop.tick(stream.tick(i), std::span(records).subspan(i * size, size));
  return records;
}

std::span<const std::byte> block_of(const StreamHeader& header, std::span<const std::byte> records,
                                    std::size_t block) {
  const std::size_t bytes = header.block_ticks * record_size(header.joint_count);
  const std::size_t from = block * bytes;
  return records.subspan(from, std::min(bytes, records.size() - from));
}

void write_stream(const Stream& stream, std::span<const std::byte> records, const fs::path& file) {
  std::ofstream out(file, std::ios::binary);
  const auto write = [&](std::span<const std::byte> bytes) {
    out.write(reinterpret_cast<const char*>(bytes.data()),
              static_cast<std::streamsize>(bytes.size()));
  };
  write(std::as_bytes(std::span(&stream.header, 1)));
  write(stream.image);
  for (std::size_t block = 0; block < stream.header.block_count(); ++block) {
    const std::uint32_t checksum = crc32c(block_of(stream.header, records, block));
    write(std::as_bytes(std::span(&checksum, 1)));
  }
  write(std::as_bytes(std::span(stream.states)));
  ASSERT_TRUE(out.good());
}

struct Emulation {
  int exit_code = -1;
  std::string text;
};

/// The firmware in the emulator, which counts one instruction as one nanosecond.
Emulation emulate(const fs::path& folder) {
  const std::string line = "cd '" + folder.string() + "' && timeout 120 '" + CLAMBER_QEMU +
                           "' -M mps2-an500 -nographic -monitor none -serial none -icount shift=0 "
                           "-semihosting-config enable=on,target=native -kernel '" +
                           CLAMBER_FIRMWARE + "' >out.txt 2>&1 </dev/null";
  const int status = std::system(line.c_str());
  std::ostringstream text;
  text << std::ifstream(folder / "out.txt").rdbuf();
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text.str()};
}

template <class T>
T at(std::span<const std::byte> bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(value));
  return value;
}

std::string hexadecimal(const std::array<std::uint8_t, 8>& bytes) {
  std::ostringstream out;
  for (const std::uint8_t byte : bytes) out << std::hex << (byte >> 4) << (byte & 15);
  return out.str();
}

/// The first difference of two joints' records: what, here, there; empty: none.
std::string difference(const JointRecord& here, const JointRecord& there) {
  std::ostringstream out;
  out << std::hexfloat;
  const auto number = [&](const char* what, double a, double b) {
    if (std::memcmp(&a, &b, sizeof(a)) != 0 && out.str().empty())
      out << what << ": " << a << " here, " << b << " there";
  };
  number("q", here.command.q, there.command.q);
  number("dq", here.command.dq, there.command.dq);
  number("kp", here.command.kp, there.command.kp);
  number("kd", here.command.kd, there.command.kd);
  number("tau", here.command.tau, there.command.tau);
  const auto frame = [&](const char* what, const WireBytes& a, const WireBytes& b) {
    if (std::memcmp(&a, &b, sizeof(a)) != 0 && out.str().empty())
      out << what << ": " << hexadecimal(a.data) << " here, " << hexadecimal(b.data) << " there";
  };
  frame("mit frame", here.mit, there.mit);
  frame("cia402 frame", here.cia402, there.cia402);
  return out.str();
}

/// Where the firmware's block of records leaves this machine's, in words.
std::string describe_mismatch(const Stream& stream, std::span<const std::byte> records,
                              const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  const std::string content = text.str();
  const std::span<const std::byte> all = std::as_bytes(std::span(content));
  if (all.size() < sizeof(std::uint32_t)) return "no records of it";
  const auto block = at<std::uint32_t>(all, 0);
  const std::span<const std::byte> there = all.subspan(sizeof(block));
  const std::span<const std::byte> here = block_of(stream.header, records, block);
  const std::size_t size = record_size(stream.header.joint_count);
  for (std::size_t i = 0; (i + 1) * size <= std::min(here.size(), there.size()); ++i) {
    const std::string where =
        "tick " + std::to_string(block * stream.header.block_ticks + i) + ", ";
    for (std::size_t j = 0; j < stream.header.joint_count; ++j) {
      const std::size_t offset = i * size + sizeof(TickRecord) + j * sizeof(JointRecord);
      const std::string what =
          difference(at<JointRecord>(here, offset), at<JointRecord>(there, offset));
      if (!what.empty()) return where + "joint " + std::to_string(j) + ", " + what;
    }
    if (std::memcmp(here.data() + i * size, there.data() + i * size, sizeof(TickRecord)) != 0)
      return where + "the controller's state or telemetry";
  }
  return "no difference in its records";
}

class BareMetal : public testing::Test {
 protected:
  void SetUp() override {
    if (missing().empty()) return;
    ASSERT_FALSE(in_ci()) << missing();
    GTEST_SKIP() << "skipped: " << missing();
  }
  void TearDown() override {
    std::error_code error;
    fs::remove_all(folder_, error);
  }
  [[nodiscard]] fs::path folder() const {
    fs::create_directories(folder_);
    return folder_;
  }

 private:
  fs::path folder_ = fs::path(testing::TempDir()) / "clamber_bare_metal";
};

TEST_F(BareMetal, TheWholeClimbGivesTheSameBits) {
  const Stream stream = recorded_climb();
  const std::vector<std::byte> records = run_here(stream);
  // Worth comparing: the plan was tracked to its end, and the drives took part.
  const auto last =
      at<TickRecord>(records, records.size() - record_size(stream.header.joint_count));
  EXPECT_EQ(last.status, static_cast<std::uint32_t>(TickStatus::kFinished));
  EXPECT_EQ(last.links_on, stream.header.joint_count);
  write_stream(stream, records, folder() / "climb.stream");

  const Emulation run = emulate(folder());
  EXPECT_EQ(run.exit_code, 0) << run.text
                              << describe_mismatch(stream, records, folder() / "mismatch.bin");
  EXPECT_THAT(run.text, testing::HasSubstr("all outputs as on the host"));
  std::cout << run.text << std::flush;
  std::system(("'" CLAMBER_ARM_SIZE "' '" CLAMBER_FIRMWARE "'"));
}

/// A last bit that differs here is found there, and told with tick, joint and both values.
TEST_F(BareMetal, ALastBitIsNoticed) {
  Stream stream = recorded_climb();
  stream.header.tick_count = 200;
  stream.states.resize(stream.header.tick_count * stream.header.joint_count);
  std::vector<std::byte> records = run_here(stream);
  const std::size_t offset = 150 * record_size(stream.header.joint_count) + sizeof(TickRecord) +
                             7 * sizeof(JointRecord) + offsetof(JointRecord, command.tau);
  records[offset] ^= std::byte{1};
  write_stream(stream, records, folder() / "climb.stream");

  const Emulation run = emulate(folder());
  EXPECT_EQ(run.exit_code, 1) << run.text;
  EXPECT_THAT(run.text, testing::HasSubstr("MISMATCH in block 2"));
  EXPECT_THAT(describe_mismatch(stream, records, folder() / "mismatch.bin"),
              testing::HasSubstr("tick 150, joint 7, tau: "));
}

TEST_F(BareMetal, AStreamOfAnotherLayoutIsRefused) {
  Stream stream = recorded_climb();
  stream.header.header_bytes += 8;
  stream.header.tick_count = 0;
  write_stream(stream, {}, folder() / "climb.stream");
  const Emulation run = emulate(folder());
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.text, testing::HasSubstr("another layout"));
}

}  // namespace
}  // namespace clamber
