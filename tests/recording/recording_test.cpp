// MCAP recordings: what is written reads back, whole and cut anywhere; the judge of the bytes is
// the format's own JavaScript library.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <tuple>

#include "recording/messages.hpp"
#include "recording/run_reader.hpp"
#include "recording/run_recorder.hpp"
#include "robot_model/loader.hpp"
#include "tests/recording/made_run.hpp"

namespace clamber {
namespace {

using test::kUrdf;
using test::made_event;
using test::made_frame;
using test::made_run;
using test::same;
using test::TemporaryFile;
using testing::HasSubstr;

constexpr std::uint64_t kFrames = 1500;
constexpr std::uint64_t kEvents = 3;

/// Frames with an event every half a second and, late, the robot's description.
void record(const std::filesystem::path& file, std::uint64_t frames,
            const RobotModel* robot = nullptr) {
  RunRecorder recorder(file, made_run(), robot, 0);
  for (std::uint64_t i = 0; i < frames; ++i) {
    if (i % 500 == 0) recorder.add(made_event(i / 500));
    if (i == 20) recorder.add_urdf(kUrdf);
    recorder.add(made_frame(i));
  }
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
  EXPECT_EQ(run.telemetry.plan, "5ec0de");
  EXPECT_EQ(run.telemetry.modes, made_run().telemetry.modes);
  EXPECT_EQ(run.telemetry.faults, made_run().telemetry.faults);
  ASSERT_EQ(run.telemetry.phases.size(), 2U);
  EXPECT_EQ(run.telemetry.phases[1].name, "swing Lknee");
  EXPECT_EQ(run.telemetry.phases[0].contacts, 3U);
}

void expect_same(const TelemetryEvent& a, const TelemetryEvent& b) {
  EXPECT_EQ(std::tie(a.sequence, a.tick, a.time, a.kind, a.severity, a.joint, a.phase),
            std::tie(b.sequence, b.tick, b.time, b.kind, b.severity, b.joint, b.phase));
  EXPECT_EQ(a.view(), b.view());
}

TEST(Recording, ReadsBackWhatHappened) {
  const TemporaryFile file("story.mcap");
  record(file.path(), kFrames);
  RunReader reader(file.path());
  RunNotes notes;
  std::vector<std::uint64_t> seen_at;
  for (TelemetryFrame frame; reader.next(frame);) {
    const RunNotes more = reader.take_notes();
    if (!more.urdf.empty()) notes.urdf = more.urdf;
    for (const TelemetryEvent& event : more.events) {
      notes.events.push_back(event);
      seen_at.push_back(frame.sequence);
    }
  }
  EXPECT_EQ(notes.urdf, kUrdf);
  EXPECT_THAT(seen_at, testing::ElementsAre(0, 500, 1000));
  ASSERT_EQ(notes.events.size(), kEvents);
  for (std::uint64_t i = 0; i < kEvents; ++i) expect_same(notes.events[i], made_event(i));
}

// A recorder that comes late shows the past where it begins, and keeps when it was.
TEST(Recording, BeginsWithWhatCameBeforeIt) {
  const TemporaryFile file("late.mcap");
  constexpr std::uint64_t kStart = 1'700'000'000'000'000'000;
  constexpr std::uint64_t kFirst = 20'000;
  {
    RunRecorder recorder(file.path(), made_run(), nullptr, kStart, 20.0);
    for (std::uint64_t i = 0; i < kEvents; ++i) recorder.add(made_event(i));
    recorder.add(made_frame(kFirst));
    recorder.close();
  }
  McapReader reader(file.path());
  std::uint64_t events = 0;
  for (McapMessage message; reader.next(message);) {
    EXPECT_EQ(message.time, kStart + 20'000'000'000) << message.topic;
    TelemetryEvent event;
    if (message.schema != event_schema().name) continue;
    ASSERT_TRUE(decode_event(message.data, event));
    EXPECT_EQ(event.time, made_event(events++).time);
  }
  EXPECT_EQ(events, kEvents);
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
  for (std::uint64_t size = std::filesystem::file_size(file.path()); size > 1009;) {
    size -= 1009;
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

// The whole file: index, checksums, schemas beside ROS 2's own, every message, and every tick
// beside the CSV of the same run. All of it read by other people's code.
TEST(Recording, IsWhatOthersRead) {
#ifndef MCAP_JUDGE
  GTEST_SKIP() << "skipped: built without npm's @mcap/core (CLAMBER_WEB)";
#else
  const TemporaryFile file("judged.mcap");
  const TemporaryFile table("judged.csv");
  const RobotModel robot =
      load_robot(std::string(CLAMBER_SOURCE_DIR) + "/configs/robots/coman/robot.yaml");
  record(file.path(), kFrames, &robot);
  const auto csv = open_csv(table.path(), made_run());
  for (std::uint64_t i = 0; i < kFrames; ++i) csv->add(made_frame(i));
  csv->close();
  const std::string command = std::string(MCAP_JUDGE) + " '" + file.path().string() + "' '" +
                              table.path().string() + "' 2>&1";
  std::FILE* pipe = popen(command.c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::string answer;
  for (char part[256]; std::fgets(part, sizeof part, pipe) != nullptr;) answer += part;
  EXPECT_EQ(pclose(pipe), 0) << answer;
  EXPECT_THAT(answer, HasSubstr("/made/telemetry/ticks clamber/msg/Tick 1500\n"));
  EXPECT_THAT(answer, HasSubstr("/made/telemetry/description clamber/msg/Description 1\n"));
  EXPECT_THAT(answer, HasSubstr("/made/telemetry/events clamber/msg/Event 3\n"));
  EXPECT_THAT(answer, HasSubstr("/robot_description std_msgs/msg/String 1, as in ROS 2\n"));
  EXPECT_THAT(answer, HasSubstr("/joint_states sensor_msgs/msg/JointState 150, as in ROS 2\n"));
  EXPECT_THAT(answer, HasSubstr("/tf tf2_msgs/msg/TFMessage 75, as in ROS 2\n"));
  // Time, phase, torques ... of each joint, bases, forces.
  EXPECT_THAT(answer,
              HasSubstr("ticks as in the table: 1500 of " +
                        std::to_string(9 + 9 * test::kJoints + 7 + 2 * test::kContacts + 2) +
                        " numbers\n"));
  EXPECT_THAT(answer, HasSubstr("last joint state 1.49 Joint22"));
  EXPECT_THAT(answer, HasSubstr("last transforms " + std::to_string(robot.bodies.size()) +
                                " world " + robot.bodies.front().name));
  EXPECT_THAT(answer, HasSubstr("last event 2 1.0 kind 1 FAULT severity 2 ERROR joint 2: "
                                "tracking error 2"));
  EXPECT_THAT(answer, HasSubstr("phases reach,swing Lknee modes idle,executing faults none,"));
  EXPECT_THAT(answer, HasSubstr("urdf " + std::string(kUrdf)));
#endif
}

}  // namespace
}  // namespace clamber
