// The SocketCAN port on a pair of connected sockets that carry what CAN sockets carry. What only a
// real CAN socket does is tested where there is one: tests/vcan.
#include "firmware_hal/socketcan/socketcan_port.hpp"

#include <gtest/gtest.h>
#include <linux/can.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <random>

#include "firmware_hal/socketcan/error_frame.hpp"
#include "firmware_hal/socketcan/interface_check.hpp"
#include "firmware_hal/socketcan/socketcan_clock.hpp"
#include "robot_model/loader.hpp"
#include "tests/firmware_hal/golden_file.hpp"
#include "tests/firmware_hal/random_frame.hpp"

namespace clamber {
namespace {

class SocketCanPortTest : public testing::Test {
 protected:
  SocketCanPortTest() {
    std::array<int, 2> pair{};
    EXPECT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair.data()), 0);
    peer = pair[0];
    port = std::make_unique<SocketCanPort>(pair[1]);
  }
  ~SocketCanPortTest() override {
    if (peer >= 0) close(peer);
  }
  void write_raw(canid_t id, std::uint8_t length, std::size_t size, std::uint8_t flags = 0,
                 const std::vector<std::uint8_t>& data = {}) const {
    canfd_frame raw{};
    raw.can_id = id;
    raw.len = length;
    raw.flags = flags;
    std::copy(data.begin(), data.end(), raw.data);
    ASSERT_EQ(write(peer, &raw, size), static_cast<ssize_t>(size));
  }
  std::vector<ReceivedFrame> receive() const {
    std::vector<ReceivedFrame> frames(100);
    frames.resize(port->receive(frames));
    return frames;
  }

  int peer = -1;
  std::unique_ptr<SocketCanPort> port;
};

TEST_F(SocketCanPortTest, FramesOfEveryKindComeBackAsTheyWent) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 3000; ++i) {
    const CanFrame frame = test::random_frame(random, i % 2 == 0, i % 3 == 0);
    ASSERT_EQ(port->send({&frame, 1}).status, SendStatus::kOk);
    canfd_frame raw{};
    const ssize_t size = read(peer, &raw, sizeof raw);
    ASSERT_EQ(size, static_cast<ssize_t>(frame.fd ? CANFD_MTU : CAN_MTU));
    ASSERT_EQ(write(peer, &raw, static_cast<std::size_t>(size)), size);
    const auto back = receive();
    ASSERT_EQ(back.size(), 1u);
    ASSERT_EQ(back[0].frame.payload().size(), frame.payload().size());
    CanFrame expected = frame;
    if (frame.remote) expected.data = {};
    ASSERT_EQ(back[0].frame, expected);
    ASSERT_GT(back[0].time_ns, 0);
  }
  EXPECT_EQ(port->counters().sent, 3000u);
  EXPECT_EQ(port->counters().received, 3000u);
  EXPECT_EQ(port->counters().malformed, 0u);
}

TEST_F(SocketCanPortTest, MoreFramesThanOneSystemCallTakes) {
  int buffer = 1 << 20;
  setsockopt(peer, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
  std::vector<CanFrame> frames;
  for (std::uint32_t id = 0; id < 80; ++id) frames.push_back(make_frame(id, {}));
  ASSERT_EQ(port->send(frames).sent, 80u);
  for (std::uint32_t id = 0; id < 80; ++id) {
    canfd_frame raw{};
    ASSERT_EQ(read(peer, &raw, sizeof raw), static_cast<ssize_t>(CAN_MTU));
    ASSERT_EQ(raw.can_id, id);
    write_raw(id, 0, CAN_MTU);
  }
  const auto back = receive();
  ASSERT_EQ(back.size(), 80u);
  for (std::uint32_t id = 0; id < 80; ++id) ASSERT_EQ(back[id].frame.id, id);
}

TEST_F(SocketCanPortTest, WhatIsNoFrameIsCountedAndIgnored) {
  write_raw(0x123, 8, 5);          // too short
  write_raw(0x123, 9, CAN_MTU);    // classic with nine bytes
  write_raw(0x123, 9, CANFD_MTU);  // FD knows no nine either
  write_raw(0x123, 255, CANFD_MTU);
  write_raw(0x123 | CAN_RTR_FLAG, 0, CANFD_MTU);  // FD has no remote frames
  write_raw(0x123, 8, CAN_MTU);
  const auto frames = receive();
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].frame.id, 0x123u);
  EXPECT_EQ(port->counters().malformed, 5u);
  EXPECT_EQ(port->state(), PortState::kActive);
}

TEST_F(SocketCanPortTest, AnyBytesAtAll) {
  std::mt19937_64 random(8);
  std::uint64_t messages = 0;
  for (int i = 0; i < 20000; ++i) {
    std::array<std::uint8_t, CANFD_MTU> bytes{};
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    const std::size_t sizes[] = {CAN_MTU, CANFD_MTU, 1 + random() % CANFD_MTU};
    if (write(peer, bytes.data(), sizes[random() % 3]) < 0) continue;
    ++messages;
    for (const ReceivedFrame& received : receive()) ASSERT_TRUE(is_valid(received.frame));
  }
  const PortCounters& counters = port->counters();
  EXPECT_EQ(counters.received + counters.malformed + counters.error_frames, messages);
  EXPECT_GT(counters.error_frames, 0u);
}

TEST_F(SocketCanPortTest, NoRoomIsSaidAndOverWhenThereIsRoomAgain) {
  const CanFrame frame = make_frame(1, {});
  SendResult result;
  std::uint64_t sent = 0;
  while ((result = port->send({&frame, 1})).status == SendStatus::kOk) ++sent;
  EXPECT_EQ(result.status, SendStatus::kFull);
  EXPECT_EQ(port->counters().sent, sent);
  EXPECT_EQ(port->counters().refused, 1u);
  EXPECT_TRUE(port->has_unsent());
  EXPECT_FALSE(port->discard_unsent());  // only an interface can
  EXPECT_EQ(port->state(), PortState::kActive);
  canfd_frame raw{};
  while (read(peer, &raw, sizeof raw) > 0) {
  }
  EXPECT_FALSE(port->has_unsent());
  EXPECT_TRUE(port->discard_unsent());
  EXPECT_EQ(port->send({&frame, 1}).status, SendStatus::kOk);
}

TEST_F(SocketCanPortTest, ALostSocketIsDownAndSurvived) {
  close(peer);
  peer = -1;
  const CanFrame frame = make_frame(1, {});
  EXPECT_EQ(port->send({&frame, 1}).status, SendStatus::kDown);
  EXPECT_EQ(port->state(), PortState::kDown);
  EXPECT_EQ(port->descriptor(), -1);
  EXPECT_EQ(port->send({&frame, 1}).status, SendStatus::kDown);
  EXPECT_TRUE(receive().empty());
  EXPECT_FALSE(port->has_unsent());
  EXPECT_TRUE(port->discard_unsent());
  EXPECT_EQ(port->counters().losses, 1u);
  port->maintain(1);
  EXPECT_EQ(port->state(), PortState::kDown);
}

TEST_F(SocketCanPortTest, ErrorFramesBecomeStates) {
  const auto report = [this](canid_t classes, std::vector<std::uint8_t> data) {
    write_raw(CAN_ERR_FLAG | classes, 8, CAN_MTU, 0, data);
    EXPECT_TRUE(receive().empty());
    return port->state();
  };
  EXPECT_EQ(report(0x4, {0, 0x08}), PortState::kWarning);
  EXPECT_EQ(report(0x4, {0, 0x20}), PortState::kPassive);
  EXPECT_EQ(report(0x20, {}), PortState::kPassive);  // says nothing about the state
  EXPECT_EQ(report(0x40, {}), PortState::kBusOff);
  EXPECT_EQ(report(0x40, {}), PortState::kBusOff);
  EXPECT_EQ(port->counters().bus_offs, 1u);
  EXPECT_EQ(report(0x100, {}), PortState::kActive);
  EXPECT_EQ(port->counters().restarts, 1u);
  // An adapter that comes back without a word: who hears is back.
  EXPECT_EQ(report(0x40, {}), PortState::kBusOff);
  write_raw(0x10, 0, CAN_MTU);
  EXPECT_EQ(receive().size(), 1u);
  EXPECT_EQ(port->state(), PortState::kActive);
  EXPECT_EQ(port->counters().error_frames, 7u);
}

TEST_F(SocketCanPortTest, TheClockWaitsForAnyOfItsPorts) {
  SocketCanClock clock({port.get()});
  const std::int64_t start = clock.now_ns();
  clock.wait(start + 3'000'000);
  EXPECT_GE(clock.now_ns() - start, 3'000'000);
  EXPECT_TRUE(receive().empty());
  write_raw(0x77, 0, CAN_MTU);
  clock.wait(clock.now_ns() + 60'000'000'000);  // would be noticed
  EXPECT_EQ(receive().size(), 1u);
  clock.wait(0);  // over long ago
}

TEST(ErrorFrame, GoldenBytes) {
  for (const auto& row : test::golden_lines("error_frames.txt")) {
    const auto bytes = test::bytes_of(row[1]);
    std::array<std::uint8_t, 8> data{};
    std::copy(bytes.begin(), bytes.end(), data.begin());
    const ErrorReport report =
        read_error_frame(static_cast<std::uint32_t>(std::stoul(row[0], nullptr, 16)), data);
    const auto has = [&row](const std::string& note) {
      return std::find(row.begin() + 3, row.end(), note) != row.end();
    };
    EXPECT_EQ(report.state ? to_string(*report.state) : "-", row[2]) << row[0] << ' ' << row[1];
    EXPECT_EQ(report.overflow, has("overflow")) << row[0];
    EXPECT_EQ(report.not_acknowledged, has("unacknowledged")) << row[0];
    EXPECT_EQ(report.restarted, has("restarted")) << row[0];
  }
}

std::string refusal(int error) {
  const SocketCanSettings settings{"can7", true, "map.yaml: bus 'arm'", "bitrate 1000000"};
  try {
    fail_to_open(settings, error);
  } catch (const InputError& refused) {
    return refused.what();
  }
}

TEST(InterfaceCheck, SaysWhatWhereAndHow) {
  EXPECT_EQ(refusal(EAFNOSUPPORT),
            "map.yaml: bus 'arm': interface 'can7': this kernel has no CAN sockets: modprobe "
            "can_raw, or take a kernel that has them (for a rehearsal: tests/vcan/vcan_run)");
  EXPECT_NE(refusal(EPERM).find("permission denied"), std::string::npos);
  EXPECT_NE(refusal(ENETDOWN).find("is down: ip link set can7 up type can bitrate 1000000"),
            std::string::npos);
  EXPECT_NE(refusal(ENODEV).find("plug the adapter in again"), std::string::npos);
  for (const int error : {EAFNOSUPPORT, EPERM, ENETDOWN, ENODEV, EMFILE})
    EXPECT_EQ(refusal(error).find('\n'), std::string::npos);
}

}  // namespace
}  // namespace clamber
