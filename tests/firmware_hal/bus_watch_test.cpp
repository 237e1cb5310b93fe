// What a listener makes of the frames of a bus, for both protocols.
#include "firmware_hal/bus_watch.hpp"

#include <gtest/gtest.h>

#include <random>

#include "firmware_hal/bus_model/frame_bits.hpp"
#include "firmware_hal/codec/canopen.hpp"
#include "firmware_hal/lock_step.hpp"
#include "tests/firmware_hal/coman_map.hpp"
#include "tests/firmware_hal/random_frame.hpp"

namespace clamber {
namespace {

TEST(BusWatch, MitCommandsAnswersStrangersAndLoad) {
  BusMap map = test::shipped_map("coman_mit.yaml");
  Bus& leg = map.buses[0];
  leg.drives[1].direction = -1.0;
  leg.drives[1].zero = 0.25;
  BusWatch watch(leg);
  const MitDrive drive = mit_drive(leg, leg.drives[1]);
  std::vector<CanFrame> frames(1);
  EXPECT_EQ(encode_mit_command(drive, {.tau = 3.0}, frames[0]), CodecStatus::kOk);
  MitReply reply;
  reply.q = 1.0;
  reply.tau = 5.0;
  reply.enabled = true;
  frames.push_back(encode_mit_reply(drive, reply));
  std::int64_t time = 0;
  std::int64_t busy = 0;
  for (const CanFrame& frame : frames) {
    watch.take({frame, ++time});
    busy += static_cast<std::int64_t>(duration_ns(exact_bits(frame), leg.timing()));
  }
  EXPECT_EQ(watch.drive(1).commands, 1u);
  EXPECT_EQ(watch.drive(1).replies, 1u);
  EXPECT_EQ(watch.drive(1).last_reply_ns, 2);
  EXPECT_NEAR(watch.drive(1).q, -0.75, 1e-3);
  EXPECT_NEAR(watch.drive(1).tau, -5.0, 0.05);
  EXPECT_EQ(watch.drive(1).state, "on");
  EXPECT_EQ(watch.drive(0).replies, 0u);
  EXPECT_EQ(watch.busy_ns(), busy);
  EXPECT_EQ(watch.frames(), 2u);

  watch.take({make_frame(0x123, {}, leg.format()), 3});
  CanFrame shorter = frames[1];
  shorter.length = 7;
  watch.take({shorter, 4});
  watch.take({encode_lock_step(LockStepMark::kSent, 9), 5});  // no drive's business
  EXPECT_EQ(watch.strangers().at(0x123), 1u);
  EXPECT_EQ(watch.malformed(), 1u);
  EXPECT_EQ(watch.frames(), 4u);
  EXPECT_EQ(watch.drive(1).replies, 1u);
}

TEST(BusWatch, Cia402StatesAndNodesOutsideTheMap) {
  const BusMap map = test::shipped_map("coman_cia402.yaml");
  const Bus& bus = map.buses[0];
  BusWatch watch(bus);
  const Cia402Drive drive = cia402_drive(bus, bus.drives[0]);
  Cia402Reply reply;
  reply.statusword = statusword_of(Cia402State::kEnabled);
  reply.q = 0.5;
  watch.take({encode_cia402_reply(drive, reply), 7});
  CanFrame command;
  EXPECT_EQ(encode_cia402_command(drive, {}, command), CodecStatus::kOk);
  watch.take({command, 8});
  watch.take({encode_sync(), 9});
  watch.take({encode_heartbeat(bus.host_node, NmtState::kOperational), 10});
  watch.take({encode_heartbeat(99, NmtState::kOperational), 11});
  EXPECT_EQ(watch.drive(0).replies, 1u);
  EXPECT_EQ(watch.drive(0).commands, 1u);
  EXPECT_NEAR(watch.drive(0).q, 0.5, 1e-5);
  EXPECT_EQ(watch.drive(0).state, to_string(Cia402State::kEnabled));
  EXPECT_EQ(watch.strangers().size(), 1u);
  EXPECT_EQ(watch.strangers().at(0x763), 1u);
  EXPECT_EQ(watch.malformed(), 0u);
}

TEST(BusWatch, AnyFrames) {
  const BusMap mit = test::shipped_map("coman_mit.yaml");
  const BusMap cia402 = test::shipped_map("coman_cia402.yaml");
  BusWatch a(mit.buses[0]);
  BusWatch b(cia402.buses[0]);
  std::mt19937_64 random(2);
  for (int i = 0; i < 50000; ++i) {
    const ReceivedFrame frame{test::random_frame(random, i % 2 == 0, i % 5 == 0), i};
    a.take(frame);
    b.take(frame);
  }
  EXPECT_GT(a.strangers().size(), 1000u);
  EXPECT_GT(b.frames(), 49000u);
}

}  // namespace
}  // namespace clamber
