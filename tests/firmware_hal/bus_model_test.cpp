// The bus model against cases worked out by hand. Bits are 1 us, data bits 200 ns.
#include <gtest/gtest.h>

#include "firmware_hal/bus_model/bus_model.hpp"
#include "tests/firmware_hal/random_frame.hpp"

namespace clamber {
namespace {

constexpr BitTiming kTiming{1000, 200};
constexpr std::int64_t kSecond = 1'000'000'000;

CanFrame frame(std::uint32_t id, std::vector<std::uint8_t> bytes = {}, FrameFormat format = {}) {
  return make_frame(id, bytes, format);
}
std::int64_t lasts(const CanFrame& f) {
  return static_cast<std::int64_t>(duration_ns(exact_bits(f), kTiming));
}
constexpr std::int64_t kIntermission = 3000;

TEST(BusModel, LowestIdFirstThenBackToBack) {
  BusModel bus(kTiming);
  const int a = bus.add_node();
  const int b = bus.add_node();
  const int c = bus.add_node();
  const int listener = bus.add_node();
  ASSERT_TRUE(bus.send(a, frame(0x300, {1})));
  ASSERT_TRUE(bus.send(b, frame(0x100, {2})));
  ASSERT_TRUE(bus.send(c, frame(0x200, {3})));
  bus.run_until(kSecond);
  std::int64_t time = 0;
  for (const CanFrame& expected : {frame(0x100, {2}), frame(0x200, {3}), frame(0x300, {1})}) {
    const auto got = bus.receive(listener);
    ASSERT_TRUE(got.has_value());
    EXPECT_EQ(got->frame, expected);
    time += lasts(expected);
    EXPECT_EQ(got->time_ns, time - kIntermission);
  }
  EXPECT_EQ(bus.busy_ns(), time);
  EXPECT_EQ(bus.counters(a).arbitration_lost, 2u);
  EXPECT_EQ(bus.counters(c).arbitration_lost, 1u);
  EXPECT_FALSE(bus.receive(listener).has_value());
}

TEST(BusModel, ALowIdThatComesLateWaitsForTheFrameOnTheBus) {
  BusModel bus(kTiming);
  const int a = bus.add_node();
  const int b = bus.add_node();
  ASSERT_TRUE(bus.send(a, frame(0x700)));
  ASSERT_TRUE(bus.send(a, frame(0x701)));
  ASSERT_TRUE(bus.send(b, frame(0x001), 10'000));
  bus.run_until(kSecond);
  EXPECT_EQ(bus.receive(b)->frame.id, 0x700u);
  EXPECT_EQ(bus.receive(a)->time_ns, lasts(frame(0x700)) + lasts(frame(0x001)) - kIntermission);
  EXPECT_EQ(bus.receive(b)->frame.id, 0x701u);
}

/// id 0x555, 8 x 0x55: no stuff bits in header or payload but in the checksum; so compare formats
/// by the bits that the standard counts: FD nominal 30, data 5 + 64 + 27.
TEST(BusModel, FdPayloadRunsAtTheDataRate) {
  BusModel bus(kTiming);
  const int a = bus.add_node();
  const int b = bus.add_node();
  const CanFrame fd = frame(0x555, std::vector<std::uint8_t>(8, 0x55), {true, true});
  ASSERT_EQ(exact_bits(fd).stuffed, 0u);
  ASSERT_TRUE(bus.send(a, fd));
  bus.run_until(kSecond);
  EXPECT_EQ(bus.receive(b)->time_ns, 30 * 1000 + 96 * 200 - kIntermission);
}

/// id 0, no data: 34 + 6 stuffed + 10 + 3 bits; up to and with the ACK slot 42; then 17 bits.
TEST(BusModel, NobodyAcknowledges) {
  BusModel bus(kTiming);
  const int lonely = bus.add_node();
  ASSERT_TRUE(bus.send(lonely, frame(0)));
  for (int attempt = 1; attempt <= 16; ++attempt) {
    ASSERT_TRUE(bus.step(kSecond));
    EXPECT_EQ(bus.transmit_errors(lonely), 8 * attempt);
    EXPECT_EQ(bus.now_ns(), attempt * (42 + 17) * 1000);
  }
  EXPECT_EQ(bus.state(lonely), CanState::kPassive);
  const std::int64_t passive_since = bus.now_ns();
  for (int attempt = 1; attempt <= 1000; ++attempt) ASSERT_TRUE(bus.step(kSecond));
  EXPECT_EQ(bus.now_ns(), passive_since + 1000 * (8 + 42 + 17) * 1000);
  EXPECT_EQ(bus.transmit_errors(lonely), 128);
  EXPECT_EQ(bus.state(lonely), CanState::kPassive);  // never bus-off
  // Someone comes: the frame, still waiting, gets through.
  const int other = bus.add_node();
  bus.run_until(bus.now_ns() + 1'000'000);
  EXPECT_TRUE(bus.receive(other).has_value());
  EXPECT_EQ(bus.transmit_errors(lonely), 127);
}

/// 8 for each error and 1 off for each success; warning from 96.
TEST(BusModel, CountersRiseByEightAndFallByOne) {
  BusModel bus(kTiming);
  const int a = bus.add_node();
  const int b = bus.add_node();
  bus.disturb(a, 20, 12);
  ASSERT_TRUE(bus.send(a, frame(0)));
  for (int i = 0; i < 12; ++i) ASSERT_TRUE(bus.step(kSecond));
  EXPECT_EQ(bus.transmit_errors(a), 96);
  EXPECT_EQ(bus.receive_errors(b), 12);
  EXPECT_EQ(bus.state(a), CanState::kWarning);
  EXPECT_EQ(bus.now_ns(), 12 * (21 + 23) * 1000);
  ASSERT_TRUE(bus.step(kSecond));  // gets through at last
  EXPECT_EQ(bus.transmit_errors(a), 95);
  EXPECT_EQ(bus.receive_errors(b), 11);
  EXPECT_EQ(bus.state(a), CanState::kActive);
  EXPECT_EQ(bus.counters(a).errors, 12u);
  EXPECT_EQ(bus.counters(a).sent, 1u);
}

TEST(BusModel, BusOffAt256AndBackAfter128Times11Bits) {
  BusModel bus(kTiming);
  const int a = bus.add_node();
  const int b = bus.add_node();
  bus.disturb(a, 0, 32);
  ASSERT_TRUE(bus.send(a, frame(0x10)));
  ASSERT_TRUE(bus.send(a, frame(0x11)));
  for (int i = 1; i <= 31; ++i) {
    ASSERT_TRUE(bus.step(kSecond));
    ASSERT_NE(bus.state(a), CanState::kBusOff) << i;
  }
  EXPECT_EQ(bus.transmit_errors(a), 248);
  ASSERT_TRUE(bus.step(kSecond));
  EXPECT_EQ(bus.state(a), CanState::kBusOff);
  // 16 attempts active, 16 passive of which each but the last is followed by 8 bits of suspension.
  EXPECT_EQ(bus.now_ns(), (32 * (1 + 23) + 16 * 8) * 1000);
  EXPECT_EQ(bus.counters(a).dropped, 2u);
  EXPECT_FALSE(bus.send(a, frame(0x10)));
  EXPECT_FALSE(bus.receive(b).has_value());
  const std::int64_t off = bus.now_ns();
  bus.run_until(off + 128 * 11 * 1000 - 1);
  EXPECT_EQ(bus.state(a), CanState::kBusOff);
  bus.run_until(off + 128 * 11 * 1000);
  EXPECT_EQ(bus.state(a), CanState::kActive);
  EXPECT_EQ(bus.transmit_errors(a), 0);
  ASSERT_TRUE(bus.send(a, frame(0x10)));
  bus.run_until(bus.now_ns() + kSecond);
  EXPECT_TRUE(bus.receive(b).has_value());
}

/// Trap of MIT drives: no automatic recovery, a power cycle ends it.
TEST(BusModel, BusOffUntilPowerCycle) {
  BusModel bus(kTiming);
  const int drive = bus.add_node({.recover = false});
  const int host = bus.add_node();
  bus.disturb(drive, 0, 1000);
  for (int i = 0; i < 32; ++i) {
    ASSERT_TRUE(bus.send(drive, frame(0x10)));
    bus.run_until(bus.now_ns() + 1'000'000);
    if (bus.state(drive) == CanState::kBusOff) break;
  }
  ASSERT_EQ(bus.state(drive), CanState::kBusOff);
  bus.run_until(bus.now_ns() + 100 * kSecond);
  EXPECT_EQ(bus.state(drive), CanState::kBusOff);
  bus.reset_node(drive);
  ASSERT_TRUE(bus.send(drive, frame(0x10)));
  bus.run_until(bus.now_ns() + kSecond);
  EXPECT_TRUE(bus.receive(host).has_value());
}

/// Trap of MIT drives: no retransmission. A reply that loses arbitration, or is disturbed, is gone.
TEST(BusModel, OneAttemptOnly) {
  BusModel bus(kTiming);
  const int drive = bus.add_node({.retransmit = false});
  const int host = bus.add_node();
  ASSERT_TRUE(bus.send(drive, frame(0x401)));
  ASSERT_TRUE(bus.send(host, frame(0x001)));
  bus.run_until(kSecond);
  EXPECT_FALSE(bus.receive(host).has_value());
  EXPECT_EQ(bus.counters(drive).dropped, 1u);
  bus.disturb(drive, 5);
  ASSERT_TRUE(bus.send(drive, frame(0x401)));
  bus.run_until(2 * kSecond);
  EXPECT_FALSE(bus.receive(host).has_value());
  EXPECT_EQ(bus.counters(drive).dropped, 2u);
  ASSERT_TRUE(bus.send(drive, frame(0x401)));
  bus.run_until(3 * kSecond);
  EXPECT_TRUE(bus.receive(host).has_value());
}

TEST(BusModel, QueuesEnd) {
  BusModel bus(kTiming);
  const int a = bus.add_node({.tx_queue = 3});
  const int b = bus.add_node({.rx_queue = 2});
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(bus.send(a, frame(0x10)));
  EXPECT_FALSE(bus.send(a, frame(0x10)));
  EXPECT_EQ(bus.counters(a).refused, 1u);
  ASSERT_TRUE(bus.step(0));  // the first one has left
  EXPECT_TRUE(bus.send(a, frame(0x10)));
  EXPECT_FALSE(bus.send(a, frame(0x10)));
  EXPECT_EQ(bus.purge(a), 3u);
  bus.run_until(kSecond);
  EXPECT_EQ(bus.counters(a).sent, 1u);
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(bus.send(a, frame(0x10)));
  bus.run_until(2 * kSecond);
  EXPECT_EQ(bus.counters(b).overruns, 1u);
}

/// A host's one queue keeps its order; a drive with mailboxes sends the lowest id that is ready.
TEST(BusModel, OneQueueOrMailboxes) {
  for (const bool urgent_first : {false, true}) {
    BusModel bus(kTiming);
    const int a = bus.add_node({.urgent_first = urgent_first});
    const int b = bus.add_node();
    ASSERT_TRUE(bus.send(a, frame(0x701)));
    ASSERT_TRUE(bus.send(a, frame(0x181)));
    ASSERT_TRUE(bus.send(a, frame(0x081), 40'000));  // while the first is on the bus
    bus.run_until(kSecond);
    std::vector<std::uint32_t> order;
    while (const auto got = bus.receive(b)) order.push_back(got->frame.id);
    EXPECT_EQ(order, urgent_first ? (std::vector<std::uint32_t>{0x181, 0x081, 0x701})
                                  : (std::vector<std::uint32_t>{0x701, 0x181, 0x081}));
  }
}

TEST(BusModel, TwoNodesWithOneIdDestroyEachOther) {
  BusModel bus(kTiming);
  const int a = bus.add_node();
  const int b = bus.add_node();
  const int listener = bus.add_node();
  ASSERT_TRUE(bus.send(a, frame(0x10, {1})));
  ASSERT_TRUE(bus.send(b, frame(0x10, {2})));
  bus.run_until(kSecond);
  EXPECT_EQ(bus.counters(a).errors, 32u);
  EXPECT_EQ(bus.counters(b).errors, 32u);
  EXPECT_EQ(bus.state(listener), CanState::kActive);
  EXPECT_FALSE(bus.receive(listener).has_value());
  ASSERT_TRUE(bus.send(a, frame(0x10, {1})));  // the very same frame is no conflict
  ASSERT_TRUE(bus.send(b, frame(0x10, {1})));
  bus.run_until(2 * kSecond);
  EXPECT_TRUE(bus.receive(listener).has_value());
  EXPECT_FALSE(bus.receive(listener).has_value());
}

TEST(BusModel, UnpluggedNodesAreNotThere) {
  BusModel bus(kTiming);
  const int a = bus.add_node();
  const int b = bus.add_node();
  bus.set_connected(b, false);
  ASSERT_TRUE(bus.send(a, frame(0x10)));
  bus.run_until(1'000'000);
  EXPECT_GT(bus.counters(a).errors, 0u);
  EXPECT_FALSE(bus.receive(b).has_value());
  bus.set_connected(b, true);
  bus.run_until(2'000'000);
  EXPECT_TRUE(bus.receive(b).has_value());
}

/// Time does not depend on where a caller stops to look.
TEST(BusModel, StoppingInBetweenChangesNothing) {
  const auto run = [](std::int64_t pause) {
    BusModel bus(kTiming, 7);
    bus.set_bit_error_rate(1e-3);
    for (int i = 0; i < 4; ++i) (void)bus.add_node({.tx_queue = 1000});
    std::mt19937_64 random(5);
    for (int i = 0; i < 500; ++i) {
      const CanFrame f = test::random_frame(random, true, false);
      (void)bus.send(i % 4, f, static_cast<std::int64_t>(random() % 50'000'000));
    }
    for (std::int64_t t = 0; t < kSecond; t += pause) bus.run_until(t);
    std::vector<std::int64_t> log{bus.busy_ns()};
    for (int i = 0; i < 4; ++i) {
      log.push_back(bus.transmit_errors(i));
      log.push_back(static_cast<std::int64_t>(bus.counters(i).errors));
      while (const auto got = bus.receive(i)) log.push_back(got->time_ns);
    }
    return log;
  };
  const auto once = run(kSecond / 2);
  EXPECT_GT(once.size(), 200u);
  EXPECT_EQ(once, run(kSecond / 2));
  EXPECT_EQ(once, run(9'973));
}

/// Every frame that was taken arrives, in its sender's order, exactly once, at whatever error rate.
TEST(BusModel, RetransmissionLosesNothing) {
  BusModel bus(kTiming, 11);
  bus.set_bit_error_rate(2e-4);
  const int a = bus.add_node({.tx_queue = 100000});
  const int b = bus.add_node({.rx_queue = 100000});
  for (std::uint32_t i = 0; i < 5000; ++i) {
    std::array<std::uint8_t, 4> bytes{};
    for (std::size_t k = 0; k < 4; ++k) bytes[k] = static_cast<std::uint8_t>(i >> (8 * k));
    ASSERT_TRUE(bus.send(a, make_frame(0x100, bytes)));
  }
  bus.run_until(10 * kSecond);
  EXPECT_GT(bus.counters(a).errors, 10u);
  for (std::uint32_t i = 0; i < 5000; ++i) {
    const auto got = bus.receive(b);
    ASSERT_TRUE(got.has_value());
    ASSERT_EQ(got->frame.data[0] | got->frame.data[1] << 8, static_cast<int>(i));
  }
  EXPECT_FALSE(bus.receive(b).has_value());
}

}  // namespace
}  // namespace clamber
