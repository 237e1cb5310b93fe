// CANopen bytes judged by an independent dissector: tshark reads our candump log.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "firmware_hal/candump.hpp"
#include "firmware_hal/virtual_drives/bench_plant.hpp"
#include "firmware_hal/virtual_drives/cia402_drive.hpp"
#include "tests/firmware_hal/bench_drives.hpp"

namespace clamber {
namespace {

const std::vector<std::string> kFields{"canopen.cob_id",
                                       "canopen.nmt_ctrl.cd",
                                       "canopen.nmt_ctrl.node_id",
                                       "canopen.nmt_guard.state",
                                       "canopen.em.err_code",
                                       "canopen.em.err_reg",
                                       "canopen.sdo.cmd",
                                       "canopen.sdo.main_idx",
                                       "canopen.sdo.sub_idx",
                                       "canopen.sdo.data.bytes",
                                       "canopen.sdo.abort_code",
                                       "canopen.pdo.data.bytes",
                                       "_ws.malformed",
                                       "_ws.expert"};
using Dissected = std::map<std::string, std::string>;

class Tshark : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("tshark --version >/dev/null 2>&1") != 0) GTEST_SKIP() << "skipped: no tshark";
    log_ = std::filesystem::path(testing::TempDir()) / "clamber_canopen.log";
  }
  void TearDown() override { std::filesystem::remove(log_); }

  std::vector<Dissected> dissect(const std::vector<CanFrame>& frames) const {
    std::ofstream out(log_);
    std::int64_t time = 0;
    for (const CanFrame& frame : frames) out << format_candump(time += 100, "can0", frame) << '\n';
    out.close();
    std::string line =
        "tshark -r '" + log_.string() + "' -d can.subdissector,canopen -T fields -E separator=/t";
    for (const std::string& field : kFields) line += " -e " + field;
    FILE* pipe = popen((line + " 2>/dev/null").c_str(), "r");
    std::string text;
    std::array<char, 4096> buffer;
    while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
      text.append(buffer.data(), n);
    EXPECT_EQ(pclose(pipe), 0);
    std::vector<Dissected> rows;
    std::istringstream lines(text);
    for (std::string row; std::getline(lines, row);) {
      std::istringstream cells(row);
      Dissected fields;
      std::string cell;
      for (const std::string& field : kFields)
        if (std::getline(cells, cell, '\t') && !cell.empty()) fields[field] = cell;
      rows.push_back(fields);
    }
    EXPECT_EQ(rows.size(), frames.size());
    return rows;
  }

  std::filesystem::path log_;
};

/// Every encoder with its arguments, and what the dissector reads back.
TEST_F(Tshark, ReadsWhatTheEncodersWereTold) {
  const Cia402Drive torque{41, Cia402Mode::kCyclicTorque, 1000.0, 0.02, 54.0};
  const Cia402Drive position{41, Cia402Mode::kCyclicPosition, 1000.0, 0.02, 54.0};
  CanFrame cst;
  CanFrame csp;
  ASSERT_EQ(encode_cia402_command(torque, {kControlEnable, 0, 20.0}, cst), CodecStatus::kOk);
  ASSERT_EQ(encode_cia402_command(position, {kControlEnable, -1.0, 20.0}, csp), CodecStatus::kOk);
  Cia402Reply reply;
  reply.statusword = statusword_of(Cia402State::kEnabled);
  reply.q = 1.0;
  reply.tau = -0.02;
  struct Case {
    CanFrame frame;
    Dissected expected;
  };
  const std::vector<Case> cases{
      {encode_nmt(NmtCommand::kStart, 41),
       {{"canopen.nmt_ctrl.cd", "0x01"}, {"canopen.nmt_ctrl.node_id", "0x29"}}},
      {encode_nmt(NmtCommand::kPreOperational, 0), {{"canopen.nmt_ctrl.cd", "0x80"}}},
      {encode_nmt(NmtCommand::kResetCommunication, 42), {{"canopen.nmt_ctrl.cd", "0x82"}}},
      {encode_sync(), {{"canopen.cob_id", "0x00000080"}}},
      {encode_heartbeat(41, NmtState::kOperational),
       {{"canopen.cob_id", "0x00000729"}, {"canopen.nmt_guard.state", "0x05"}}},
      {encode_heartbeat(1, NmtState::kPreOperational), {{"canopen.nmt_guard.state", "0x7f"}}},
      {encode_emergency({41, kEmergencyHeartbeatLost, 0x11, {}}),
       {{"canopen.cob_id", "0x000000a9"},
        {"canopen.em.err_code", "0x8130"},
        {"canopen.em.err_reg", "0x11"}}},
      {encode_sdo({SdoKind::kDownload, 41, 0x1016, 1, 4, 0x00010032}, true),
       {{"canopen.cob_id", "0x00000629"},
        {"canopen.sdo.cmd", "0x23"},
        {"canopen.sdo.main_idx", "0x1016"},
        {"canopen.sdo.sub_idx", "0x01"},
        {"canopen.sdo.data.bytes", "32000100"}}},
      {encode_sdo({SdoKind::kDownload, 41, 0x6060, 0, 1, 10}, true),
       {{"canopen.sdo.cmd", "0x2f"}, {"canopen.sdo.data.bytes", "0a000000"}}},
      {encode_sdo({SdoKind::kUpload, 41, 0x6076, 0, 0, 0}, true),
       {{"canopen.sdo.cmd", "0x40"}, {"canopen.sdo.main_idx", "0x6076"}}},
      {encode_sdo({SdoKind::kUploadReply, 41, 0x6076, 0, 4, 200}, false),
       {{"canopen.cob_id", "0x000005a9"},
        {"canopen.sdo.cmd", "0x43"},
        {"canopen.sdo.data.bytes", "c8000000"}}},
      {encode_sdo({SdoKind::kDownloadReply, 41, 0x6060, 0, 0, 0}, false),
       {{"canopen.sdo.cmd", "0x60"}}},
      {encode_sdo({SdoKind::kAbort, 41, 0x1017, 0, 0, kSdoAbortNoObject}, false),
       {{"canopen.sdo.cmd", "0x80"}, {"canopen.sdo.abort_code", "0x06020000"}}},
      {cst, {{"canopen.cob_id", "0x00000229"}, {"canopen.pdo.data.bytes", "0f00e803"}}},
      {csp, {{"canopen.pdo.data.bytes", "0f0018fcffffe803"}}},
      {encode_cia402_reply(torque, reply),
       {{"canopen.cob_id", "0x000001a9"}, {"canopen.pdo.data.bytes", "3702e8030000ffff"}}}};
  std::vector<CanFrame> frames;
  for (const Case& c : cases) frames.push_back(c.frame);
  const std::vector<Dissected> rows = dissect(frames);
  ASSERT_EQ(rows.size(), cases.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (auto [field, value] : cases[i].expected) {
      std::string got = rows[i].contains(field) ? rows[i].at(field) : "";
      got.erase(std::remove(got.begin(), got.end(), ':'), got.end());
      EXPECT_EQ(got, value) << "frame " << i + 1 << ' ' << field;
    }
  }
}

/// A whole session: found, configured, enabled, moved, stopped. The dissector knows every frame.
TEST_F(Tshark, FindsNothingWrongInASession) {
  Cia402Host host({});
  test::BenchCia402Drive drive;
  drive.codec = {41, Cia402Mode::kCyclicTorque, 1e5, 0.02, 54.0};
  drive.objects = {{0x100000, 402}, {0x650200, 1u << 9}, {0x607600, 200}};
  ASSERT_TRUE(host.add_drive(drive.codec, {}, 0.2));
  std::vector<CanFrame> log;
  FrameList frames;
  std::array<JointState, 1> states{};
  for (int tick = 0; tick < 300; ++tick) {
    if (tick == 150) host.set_goal(HostGoal::kOn);
    if (tick == 250) host.set_goal(HostGoal::kQuickStop);
    const std::array<JointCommand, 1> commands{JointCommand{.tau = 0.1 * (tick - 200)}};
    host.begin_tick(commands, frames);
    for (const CanFrame& frame : frames.frames()) {
      log.push_back(frame);
      for (const CanFrame& reply : drive.take(frame)) {
        log.push_back(reply);
        (void)host.receive(reply);
      }
    }
    if (tick % 20 == 19) {
      log.push_back(encode_heartbeat(41, drive.nmt));
      (void)host.receive(log.back());
    }
    host.end_tick(states);
  }
  ASSERT_EQ(drive.state, Cia402State::kQuickStop);
  std::map<std::string, int> services;
  for (const Dissected& row : dissect(log)) {
    ASSERT_TRUE(row.contains("canopen.cob_id"));
    EXPECT_FALSE(row.contains("_ws.malformed"));
    EXPECT_FALSE(row.contains("_ws.expert"));
    services[row.at("canopen.cob_id")] += 1;
  }
  EXPECT_GT(services["0x00000080"], 200);  // SYNC
  EXPECT_EQ(services["0x00000080"], services["0x00000229"]);
  EXPECT_EQ(services["0x00000080"], services["0x000001a9"]);
  EXPECT_EQ(services["0x00000629"], static_cast<int>(cia402_step_count(drive.codec)));
  EXPECT_EQ(services["0x00000629"], services["0x000005a9"]);
  EXPECT_EQ(services["0x00000000"], 2);   // pre-operational, start
  EXPECT_EQ(services["0x00000701"], 15);  // the host's heartbeat
}

/// What a virtual drive says in its life: boot-up, configuration, process data, heartbeats, a
/// broken winding, a refused object, a lost host.
TEST_F(Tshark, FindsNothingWrongInAVirtualDrive) {
  const Cia402Drive codec{41, Cia402Mode::kCyclicPosition, 1e5, 0.02, 54.0};
  Cia402Motor motor;
  motor.rated_torque = 20.0;
  motor.gear_ratio = 100.0;
  VirtualCia402Drive drive(codec, motor, {}, 1e-3);
  Cia402Host host({});
  ASSERT_TRUE(host.add_drive(codec, {}, 0.2));
  std::vector<CanFrame> log;
  const auto collect = [&](bool heard) {
    for (const CanFrame& frame : drive.outbox().frames()) {
      log.push_back(frame);
      if (heard) (void)host.receive(frame);
    }
    drive.outbox().clear();
  };
  FrameList frames;
  std::array<JointState, 1> states{};
  const std::array<JointCommand, 1> commands{};
  drive.boot();
  for (int tick = 0; tick < 400; ++tick) {
    if (tick == 100) host.set_goal(HostGoal::kOn);
    if (tick == 200) drive.break_down(0x4310);
    if (tick == 210) drive.receive(encode_sdo({SdoKind::kUpload, 41, 0x2000, 0, 0, 0}, true));
    host.begin_tick(commands, frames);
    for (const CanFrame& frame : frames.frames())
      if (tick < 300) drive.receive(frame);
    collect(tick < 300);
    host.end_tick(states);
    drive.pass();
    collect(tick < 300);
  }
  std::map<std::string, int> services;
  std::vector<std::string> emergencies;
  int aborts = 0;
  for (const Dissected& row : dissect(log)) {
    ASSERT_TRUE(row.contains("canopen.cob_id"));
    EXPECT_FALSE(row.contains("_ws.malformed"));
    EXPECT_FALSE(row.contains("_ws.expert"));
    services[row.at("canopen.cob_id")] += 1;
    if (row.contains("canopen.em.err_code")) emergencies.push_back(row.at("canopen.em.err_code"));
    aborts += row.contains("canopen.sdo.abort_code") ? 1 : 0;
  }
  EXPECT_EQ(emergencies, (std::vector<std::string>{"0x4310", "0x8130"}));
  EXPECT_EQ(aborts, 1);
  EXPECT_GT(services["0x000001a9"], 200);
  EXPECT_GT(services["0x00000729"], 15);
  EXPECT_EQ(services["0x000005a9"], static_cast<int>(cia402_step_count(codec)) + 1);
}

}  // namespace
}  // namespace clamber
