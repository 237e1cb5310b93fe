// The bus budget: the published figures for COMAN, and bounds against a simulated bus.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "firmware_hal/bus_model/bus_budget.hpp"
#include "firmware_hal/bus_model/bus_model.hpp"
#include "tests/firmware_hal/coman_map.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;

TEST(BusBudget, ComanFitsOnFiveFdBuses) {
  const BusMap map = test::shipped_map("coman_mit.yaml");
  const std::vector<BusBudget> budgets = bus_budgets(map);
  ASSERT_EQ(budgets.size(), 5u);
  // Published: 68, 68, 45, 45, 34 %.
  const std::array<double, 5> kLoads{0.68, 0.68, 0.45, 0.45, 0.34};
  std::size_t joints = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(budgets[i].load, kLoads[i], 0.005) << budgets[i].bus;
    EXPECT_TRUE(budgets[i].fits);
    EXPECT_LT(budgets[i].response, 1e-3);
    joints += budgets[i].joints;
  }
  EXPECT_EQ(joints, 23u);
  EXPECT_NO_THROW(require_budget(map));
}

TEST(BusBudget, ComanOnClassicIsRefusedWithNumbersAndAWayOut) {
  const BusMap map = test::shipped_map("coman_mit_classic.yaml");
  EXPECT_NEAR(bus_budgets(map)[0].load, 1.62, 1e-9);  // 6 (135 + 135) bits a millisecond
  EXPECT_NEAR(bus_budgets(map)[2].load, 1.08, 1e-9);
  EXPECT_NEAR(bus_budgets(map)[4].load, 0.81, 1e-9);
  try {
    require_budget(map);
    FAIL() << "not refused";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("right_leg"));
    EXPECT_THAT(error.what(), HasSubstr("162.0 %"));
    EXPECT_THAT(error.what(), HasSubstr("80.0 %"));
    EXPECT_THAT(error.what(), HasSubstr("use CAN FD"));
    EXPECT_THAT(error.what(), HasSubstr("67.9 %"));
    EXPECT_THAT(error.what(), HasSubstr("at most 2 joints per bus"));
    EXPECT_THAT(error.what(), HasSubstr("at most 493 Hz"));
  }
}

TEST(BusBudget, WhatTheRefusalSuggestsFits) {
  const auto refused = [](const std::string& text) {
    const BusMap map =
        parse_bus_map(text, test::kSource / "configs/hal/coman_mit_classic.yaml", test::coman());
    for (const BusBudget& b : bus_budgets(map))
      if (!b.fits) return true;
    return false;
  };
  EXPECT_FALSE(refused(test::edited("coman_mit_classic.yaml", "rate: 1000\n", "rate: 493\n")));
  EXPECT_TRUE(refused(test::edited("coman_mit_classic.yaml", "rate: 1000\n", "rate: 494\n")));
  EXPECT_FALSE(refused(test::edited("coman_mit_classic.yaml", "bitrate: 1000000",
                                    "bitrate: 1000000\n      data_bitrate: 5000000")));
}

TEST(BusBudget, ComanOnCia402FitsOnNineClassicBuses) {
  const BusMap map = test::shipped_map("coman_cia402.yaml");
  const std::vector<BusBudget> budgets = bus_budgets(map);
  ASSERT_EQ(budgets.size(), 9u);
  // 3 (95 + 135) + 55 bits a millisecond; four heartbeats of 65 bits, and a drive told what to do
  // without its host, 2 x 135 bits, in 20 ms.
  EXPECT_NEAR(budgets[0].load, 0.745 + (4 * 65e-6 + 2 * 135e-6) / 0.02, 1e-9);
  for (const BusBudget& b : budgets) EXPECT_TRUE(b.fits) << b.bus;
  EXPECT_NO_THROW(require_budget(map));
}

/// Plays the planned frames of one bus on the bus model and returns the latest reception of each.
std::map<std::uint32_t, double> simulated(const BusMap& map, const Bus& bus, std::uint64_t seed,
                                          int ticks) {
  const std::vector<PlannedFrame> plan = planned_frames(map, bus);
  std::mt19937_64 random(seed);
  BusModel model(bus.timing(), seed);
  const int host = model.add_node({.tx_queue = 1000, .rx_queue = 100000});
  std::map<std::string, int> drives;  // one node per drive, named by the frame's first word
  for (const PlannedFrame& f : plan) {
    if (f.from_host) continue;
    const std::string name = f.name.substr(0, f.name.find(' '));
    if (!drives.contains(name))
      drives[name] = model.add_node({.tx_queue = 100, .urgent_first = true});
  }
  const auto node_of = [&](const PlannedFrame& f) {
    return f.from_host ? host : drives.at(f.name.substr(0, f.name.find(' ')));
  };
  const auto frame_of = [&](const PlannedFrame& f) {
    std::array<std::uint8_t, 8> bytes{};
    const std::uint64_t kind = random() % 3;
    for (std::uint8_t& byte : bytes)
      byte = static_cast<std::uint8_t>(kind == 0 ? 0x00 : kind == 1 ? 0x3C : random());
    return make_frame(f.id, std::span(bytes).first(f.length), f.format);
  };
  const double tick = 1.0 / map.rate;
  std::map<std::uint32_t, double> worst;
  std::vector<double> next_rare;
  for (const PlannedFrame& f : plan) next_rare.push_back(f.off_beat ? 0.5 * f.period : 0.0);
  for (int t = 0; t < ticks; ++t) {
    const auto begin = static_cast<std::int64_t>(std::llround(1e9 * tick * t));
    const auto end = static_cast<std::int64_t>(std::llround(1e9 * tick * (t + 1)));
    for (std::size_t k = 0; k < plan.size(); ++k) {
      const PlannedFrame& f = plan[k];
      if (f.trigger >= 0) continue;
      if (f.period > tick) {
        if (next_rare[k] > tick * t) continue;
        next_rare[k] = tick * t + f.period;
        const std::int64_t jitter =
            f.from_host ? 0 : static_cast<std::int64_t>(random() % 1'000'000);
        EXPECT_TRUE(model.send(node_of(f), frame_of(f), begin + jitter));
        continue;
      }
      EXPECT_TRUE(model.send(node_of(f), frame_of(f), begin));
    }
    const auto turnaround = static_cast<std::uint64_t>(1e9 * map.turnaround);
    while (model.step(end - 1)) {
      for (const auto& [name, node] : drives) {
        while (const auto got = model.receive(node)) {
          if (got->sender != host) continue;
          worst[got->frame.id] =
              std::max(worst[got->frame.id], 1e-9 * static_cast<double>(got->time_ns - begin));
          for (std::size_t k = 0; k < plan.size(); ++k)
            if (plan[k].trigger >= 0 && node_of(plan[k]) == node &&
                plan[static_cast<std::size_t>(plan[k].trigger)].id == got->frame.id) {
              EXPECT_TRUE(
                  model.send(node, frame_of(plan[k]),
                             got->time_ns + static_cast<std::int64_t>(random() % turnaround)));
            }
        }
      }
      while (const auto got = model.receive(host))
        worst[got->frame.id] =
            std::max(worst[got->frame.id], 1e-9 * static_cast<double>(got->time_ns - begin));
    }
  }
  return worst;
}

/// No frame of the tick ever takes longer on the simulated bus than the budget says.
TEST(BusBudget, ResponseTimesBoundASimulatedBus) {
  for (const char* name : {"coman_mit.yaml", "coman_cia402.yaml"}) {
    const BusMap map = test::shipped_map(name);
    const std::vector<BusBudget> budgets = bus_budgets(map);
    for (const std::size_t i : {std::size_t{0}, map.buses.size() - 1}) {
      const auto worst = simulated(map, map.buses[i], 17 + i, 2000);
      double tightest = 0.0;
      for (const FrameBudget& f : budgets[i].frames) {
        if (f.frame.period > 1.0 / map.rate) continue;
        ASSERT_TRUE(worst.contains(f.frame.id)) << f.frame.name;
        EXPECT_LE(worst.at(f.frame.id), f.response) << name << ' ' << f.frame.name;
        tightest = std::max(tightest, worst.at(f.frame.id) / f.response);
      }
      EXPECT_GT(tightest, 0.7) << "the bound says nothing";
    }
  }
}

/// Random maps: the load is the sum of worst bits, and a map that fits keeps every tick in time.
TEST(BusBudget, WhatFitsIsInTime) {
  std::mt19937_64 random(23);
  const BusMap fd = test::shipped_map("coman_mit.yaml");
  const BusMap canopen = test::shipped_map("coman_cia402.yaml");
  int fitting = 0;
  for (int trial = 0; trial < 40; ++trial) {
    BusMap map = trial % 2 == 0 ? fd : canopen;
    Bus& bus = map.buses[0];
    bus.drives.resize(1 + random() % bus.drives.size());
    map.buses.resize(1);
    map.rate = static_cast<double>(200 + random() % 1800);
    map.turnaround = 1e-6 * static_cast<double>(1 + random() % 200);
    if (trial % 4 == 0) bus.data_bitrate = 0;
    if (trial % 4 == 1) bus.mode = Cia402Mode::kCyclicPosition;
    const BusBudget budget = bus_budgets(map)[0];
    double load = 0.0;
    for (const PlannedFrame& f : planned_frames(map, bus))
      load += 1e-9 *
              static_cast<double>(duration_ns(worst_bits(f.length, f.format), bus.timing())) /
              f.period;
    EXPECT_NEAR(budget.load, load, 1e-12);
    if (!budget.fits) continue;
    ++fitting;
    for (const auto& [id, time] : simulated(map, bus, random(), 300))
      if (id < 0x700) {
        EXPECT_LE(time, 1.0 / map.rate) << trial;
      }
  }
  EXPECT_GT(fitting, 10);
}

}  // namespace
}  // namespace clamber
