// MCAP recordings: what is written reads back, whole and cut anywhere; the judge of the bytes is
// the format's own JavaScript library.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <charconv>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "recording/messages.hpp"
#include "recording/run_reader.hpp"
#include "recording/run_recorder.hpp"
#include "robot_model/loader.hpp"
#include "tests/recording/made_run.hpp"

namespace clamber {
namespace {

using test::made_frame;
using test::made_run;
using test::same;
using test::TemporaryFile;
using testing::HasSubstr;

constexpr std::uint64_t kFrames = 3500;

void record(const std::filesystem::path& file, std::uint64_t frames) {
  RunRecorder recorder(file, made_run(), nullptr, 0);
  for (std::uint64_t i = 0; i < frames; ++i) recorder.add(made_frame(i));
  recorder.close();
}

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream bytes;
  bytes << in.rdbuf();
  return bytes.str();
}

void write_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

/// How many frames a file gives, all of them as recorded; nothing: not even a description.
std::optional<std::uint64_t> frames_in(const std::filesystem::path& file, bool* cut = nullptr) {
  try {
    RunReader reader(file);
    std::uint64_t count = 0;
    for (TelemetryFrame frame; reader.next(frame); ++count)
      if (!same(frame, made_frame(count))) ADD_FAILURE() << "frame " << count << " differs";
    if (cut != nullptr) *cut = reader.cut();
    return count;
  } catch (const InputError&) {
    return {};
  }
}

template <typename Work>
std::string complaint(Work work) {
  try {
    work();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Recording, ReadsBackTheSame) {
  const TemporaryFile file("whole.mcap");
  record(file.path(), kFrames);
  bool cut = true;
  EXPECT_EQ(frames_in(file.path(), &cut), kFrames);
  EXPECT_FALSE(cut);
  const RunDescription run = RunReader(file.path()).run();
  EXPECT_EQ(run.robot, "made");
  EXPECT_EQ(run.telemetry.joint_names, made_run().telemetry.joint_names);
  EXPECT_EQ(run.telemetry.torque_limits, made_run().telemetry.torque_limits);
  EXPECT_EQ(run.telemetry.contact_names, made_run().telemetry.contact_names);
  EXPECT_EQ(run.scene, made_run().scene);
}

TEST(Recording, GivesTheSameBytesForTheSameRun) {
  const TemporaryFile one("one.mcap");
  const TemporaryFile two("two.mcap");
  record(one.path(), 100);
  record(two.path(), 100);
  EXPECT_EQ(bytes_of(one.path()), bytes_of(two.path()));
}

TEST(Recording, OpensUpToTheLastCompleteChunkWhereverItWasCut) {
  const TemporaryFile file("cut.mcap");
  // Bytes in the file, and frames in them, after every chunk.
  std::vector<std::pair<std::uint64_t, std::uint64_t>> chunks;
  {
    RunRecorder recorder(file.path(), made_run(), nullptr, 0);
    for (std::uint64_t i = 0; i < 400; ++i) {
      recorder.add(made_frame(i));
      if (i % 100 != 99) continue;
      recorder.flush();
      chunks.emplace_back(recorder.bytes(), i + 1);
    }
    recorder.close();
  }
  for (std::uint64_t size = std::filesystem::file_size(file.path()); size > 509;) {
    size -= 509;
    std::filesystem::resize_file(file.path(), size);
    std::uint64_t least = 0;
    for (const auto& [bytes, frames] : chunks)
      if (bytes <= size) least = frames;
    bool cut = false;
    const auto read = frames_in(file.path(), &cut);
    // A chunk is complete before its index is.
    ASSERT_GE(read.value_or(0), least) << size << " bytes";
    ASSERT_LE(read.value_or(0), least + 100) << size << " bytes";
    if (size < chunks.back().first) {
      ASSERT_TRUE(!read || cut) << size;
    }
  }
}

TEST(Recording, SurvivesTheDeathOfItsProcess) {
  const TemporaryFile file("killed.mcap");
  const pid_t child = fork();
  if (child == 0) {
    RunRecorder recorder(file.path(), made_run(), nullptr, 0);
    for (std::uint64_t i = 0; i < 2500; ++i) recorder.add(made_frame(i));
    raise(SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  bool cut = false;
  EXPECT_GE(frames_in(file.path(), &cut).value_or(0), 1500U);
  EXPECT_TRUE(cut);
}

TEST(Recording, FullDiskCutsItBackToItsLastCompleteChunk) {
  const TemporaryFile file("full.mcap");
  constexpr rlim_t kRoom = 2'500'000;
  const pid_t child = fork();
  if (child == 0) {
    const rlimit limit{kRoom, kRoom};
    std::signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &limit);
    const std::string what = complaint([&] { record(file.path(), 5000); });
    const bool good = what.find("cannot write") != std::string::npos &&
                      what.find("is whole") != std::string::npos;
    _exit(good ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  bool cut = false;
  EXPECT_GE(frames_in(file.path(), &cut).value_or(0), 700U);
  EXPECT_TRUE(cut);
  // Back to the chunk's end: reading on from there meets the end of the file, not half a record.
  EXPECT_LT(std::filesystem::file_size(file.path()), kRoom);
}

TEST(Recording, SaysWhatItCannotRead) {
  const TemporaryFile file("bad.mcap");
  write_bytes(file.path(), "no recording at all");
  EXPECT_THAT(complaint([&] { RunReader reader(file.path()); }), HasSubstr("not an MCAP file"));

  record(file.path(), 50);
  std::string bytes = bytes_of(file.path());
  bytes[bytes.size() / 3] = static_cast<char>(bytes[bytes.size() / 3] ^ 1);
  write_bytes(file.path(), bytes);
  EXPECT_THAT(complaint([&] {
                RunReader reader(file.path());
                for (TelemetryFrame frame; reader.next(frame);) continue;
              }),
              HasSubstr("checksum"));

  EXPECT_THAT(complaint([] { RunRecorder recorder("/nowhere/run.mcap", made_run(), nullptr, 0); }),
              HasSubstr("/nowhere/run.mcap: cannot write"));
}

TEST(Tick, RefusesBytesThatAreTooFewAndArraysThatAreTooLong) {
  CdrWriter out;
  encode_tick(made_frame(7), out);
  const std::string bytes(out.bytes());
  TelemetryFrame frame;
  ASSERT_TRUE(decode_tick(bytes, frame));
  EXPECT_TRUE(same(frame, made_frame(7)));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    ASSERT_FALSE(decode_tick(std::string_view(bytes).substr(0, size), frame)) << size;
  // The length of q_ref: after the encapsulation header, three times 8 and six times 4 bytes.
  std::string longer = bytes;
  longer[4 + 48] = kMaxJoints + 1;
  EXPECT_FALSE(decode_tick(longer, frame));
}

// The whole file, its index, checksums, schemas and every message, read by other people's code.
TEST(Recording, IsWhatOthersRead) {
#ifndef MCAP_JUDGE
  GTEST_SKIP() << "skipped: built without npm's @mcap/core (CLAMBER_WEB)";
#else
  const TemporaryFile file("judged.mcap");
  const RobotModel robot =
      load_robot(std::string(CLAMBER_SOURCE_DIR) + "/configs/robots/coman/robot.yaml");
  {
    RunRecorder recorder(file.path(), made_run(), &robot, 0);
    for (std::uint64_t i = 0; i < kFrames; ++i) recorder.add(made_frame(i));
    recorder.close();
  }
  const std::string command = std::string(MCAP_JUDGE) + " '" + file.path().string() + "' 2>&1";
  std::FILE* pipe = popen(command.c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::string answer;
  for (char part[256]; std::fgets(part, sizeof part, pipe) != nullptr;) answer += part;
  EXPECT_EQ(pclose(pipe), 0) << answer;
  EXPECT_THAT(answer, HasSubstr("/made/telemetry/ticks clamber/msg/Tick 3500"));
  EXPECT_THAT(answer, HasSubstr("/made/telemetry/description clamber/msg/Description 1"));
  EXPECT_THAT(answer, HasSubstr("/joint_states sensor_msgs/msg/JointState 350"));
  EXPECT_THAT(answer, HasSubstr("/tf tf2_msgs/msg/TFMessage 175"));
  // Of the last messages: tick, torque of the last joint, joint state, transform.
  const TelemetryFrame last = made_frame(kFrames - 1);
  char torque[32] = {};  // the shortest that reads back, as JavaScript prints it
  std::to_chars(torque, torque + sizeof torque, last.tau_meas[test::kJoints - 1]);
  EXPECT_THAT(answer, HasSubstr("last tick 3499 " + std::string(torque)));
  EXPECT_THAT(answer, HasSubstr("last joint state 3.49 Joint22"));
  EXPECT_THAT(answer, HasSubstr("last transforms " + std::to_string(robot.bodies.size()) +
                                " world " + robot.bodies.front().name));
#endif
}

}  // namespace
}  // namespace clamber
