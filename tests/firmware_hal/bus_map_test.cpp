// Bus maps: what is in the shipped ones, and one clear line for everything that can be wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>

#include "firmware_hal/make_host.hpp"
#include "tests/firmware_hal/bench_drives.hpp"
#include "tests/firmware_hal/coman_map.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;

TEST(BusMap, ComanKeepsItsBoardNumbers) {
  for (const char* name : {"coman_mit.yaml", "coman_cia402.yaml"}) {
    const BusMap map = test::shipped_map(name);
    std::set<int> nodes;
    std::set<int> joints;
    for (const Bus& bus : map.buses) {
      for (const JointDrive& drive : bus.drives) {
        nodes.insert(drive.node);
        joints.insert(drive.joint);
        EXPECT_EQ(test::coman().joints[static_cast<std::size_t>(drive.joint)].name, drive.name);
      }
    }
    EXPECT_THAT(nodes, testing::ElementsAre(11, 12, 13, 14, 21, 22, 23, 24, 31, 32, 33, 41, 42, 43,
                                            44, 45, 46, 51, 52, 53, 54, 55, 56));
    EXPECT_EQ(joints.size(), 23u);
  }
  const BusMap map = test::shipped_map("coman_mit.yaml");
  EXPECT_EQ(map.buses[0].drives[3].name, "RKneeSag");
  EXPECT_EQ(map.buses[0].drives[3].node, 44);
  EXPECT_EQ(map.buses[0].drives[3].reply_id, 0x42C);
  EXPECT_EQ(map.buses[0].format(), (FrameFormat{true, true}));
  EXPECT_EQ(map.buses[0].timing().data_ns, 200u);
  const Cia402Drive drive = cia402_drive(test::shipped_map("coman_cia402.yaml").buses[0],
                                         test::shipped_map("coman_cia402.yaml").buses[0].drives[0]);
  EXPECT_NEAR(drive.counts_per_radian * 2 * M_PI, 6553600, 1e-6);
  EXPECT_NEAR(drive.torque_per_permille, 0.02, 1e-12);
}

/// Every bus of both maps, host against bench drives: all joints read, all drives on, all off.
TEST(BusMap, HostsOfTheShippedMapsSwitchComanOnAndOff) {
  for (const char* name : {"coman_mit.yaml", "coman_cia402.yaml"}) {
    const BusMap map = test::shipped_map(name);
    std::vector<JointState> states(23);
    const std::vector<JointCommand> commands(23);
    for (const Bus& bus : map.buses) {
      const std::unique_ptr<BusHost> host = make_host(map, bus);
      std::vector<test::BenchMitDrive> mit(bus.drives.size());
      std::vector<test::BenchCia402Drive> servo(bus.drives.size());
      for (std::size_t i = 0; i < bus.drives.size(); ++i) {
        mit[i].codec = mit_drive(bus, bus.drives[i]);
        servo[i].codec = cia402_drive(bus, bus.drives[i]);
        mit[i].q = servo[i].q = 0.01 * bus.drives[i].node;
        servo[i].objects = {{0x100000, 402}, {0x650200, 1u << 9}, {0x607600, 200}};
      }
      FrameList frames;
      const auto tick = [&](int n) {
        host->begin_tick(commands, frames);
        for (const CanFrame& frame : frames.frames()) {
          for (std::size_t i = 0; i < bus.drives.size(); ++i) {
            const auto replies =
                bus.protocol == BusProtocol::kMit ? mit[i].take(frame) : servo[i].take(frame);
            for (const CanFrame& reply : replies) (void)host->receive(reply);
          }
        }
        for (const test::BenchCia402Drive& drive : servo)
          if (bus.protocol == BusProtocol::kCia402 && n % 20 == 19)
            (void)host->receive(encode_heartbeat(drive.codec.node, drive.nmt));
        host->end_tick(states);
      };
      int n = 0;
      while (n < 200) tick(n++);
      EXPECT_TRUE(host->all_off()) << bus.name;
      host->set_goal(HostGoal::kOn);
      while (n < 220) tick(n++);
      EXPECT_TRUE(host->all_on()) << bus.name;
      EXPECT_TRUE(host->replies_complete());
      host->set_goal(HostGoal::kOff);
      while (n < 225) tick(n++);
      EXPECT_TRUE(host->all_off()) << bus.name;
    }
    for (const Bus& bus : map.buses)
      for (const JointDrive& drive : bus.drives)
        EXPECT_NEAR(states[static_cast<std::size_t>(drive.joint)].q, 0.01 * drive.node, 1e-3);
  }
}

struct Case {
  const char* name;
  const char* file;
  const char* from;
  const char* to;
  const char* message;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class BadMap : public testing::TestWithParam<Case> {};

TEST_P(BadMap, IsOneLineThatSaysWhatWhereAndHow) {
  const Case& c = GetParam();
  const std::string text = test::edited(c.file, c.from, c.to);
  try {
    (void)parse_bus_map(text, test::kSource / "configs/hal" / c.file, test::coman());
    FAIL() << "not refused";
  } catch (const InputError& error) {
    const std::string what = error.what();
    EXPECT_THAT(what, HasSubstr(c.message));
    EXPECT_THAT(what, HasSubstr(std::string(c.file) + ":"));
    EXPECT_EQ(what.find('\n'), std::string::npos);
  }
}

constexpr const char* kMit = "coman_mit.yaml";
constexpr const char* kServo = "coman_cia402.yaml";

INSTANTIATE_TEST_SUITE_P(
    Cases, BadMap,
    testing::Values(
        Case{"unknown_protocol", kMit, "protocol: mit", "protocol: ethercat",
             "unknown protocol 'ethercat', expected mit or cia402"},
        Case{"duplicate_node", kMit, "RHipLat: 42", "RHipLat: 41",
             "node id 41 belongs to joint 'RHipSag' on this bus already"},
        Case{"joint_on_no_bus", kMit, "WaistLat: 31, ", "",
             "joint 'WaistLat' of robot 'coman' is on no bus: add it"},
        Case{"joint_twice", kMit, "WaistLat: 31", "RHipSag: 31",
             "joint is on bus 'right_leg' already"},
        Case{"unknown_joint", kMit, "WaistLat: 31", "WaistTop: 31",
             "robot 'coman' has no joint 'WaistTop'"},
        Case{"unknown_motor", kMit, "motor: dm8009_coman", "motor: dm9",
             "unknown motor 'dm9', expected one of: ak10_9_v1_1"},
        Case{"no_motor", kMit, "      motor: dm8009_coman\n", "", "missing key 'motor'"},
        Case{"motor_of_other_protocol", kMit, "motor: dm8009_coman", "motor: servo_coman",
             "motor 'servo_coman' speaks cia402, the bus mit: one bus, one protocol"},
        Case{"motor_without_fd", kMit, "motor: dm8009_coman", "motor: ak10_9_v1_1",
             "speaks classic CAN only"},
        Case{"range_too_small", "coman_mit_classic.yaml", "motor: dm8009_coman",
             "motor: ak80_6_v1_1", "torque range [-12, 12] of motor 'ak80_6_v1_1'"},
        Case{"watchdog_too_short", kMit, "rate: 1000 ", "rate: 25 ",
             "less than three ticks of 40 ms"},
        Case{"interface_twice", kMit, "interface: can1", "interface: can0",
             "interface 'can0' belongs to bus 'right_leg' already"},
        Case{"interface_too_long", kMit, "interface: can1", "interface: can1_right_leg_lower",
             "at most 15 characters"},
        Case{"reply_is_command", kMit, "reply_offset: 0x400", "reply_offset: 1",
             "a reply id equals a node id"},
        Case{"reply_is_own_command", kMit, "reply_offset: 0x400", "reply_offset: 0",
             "reply id equals the node id"},
        Case{"reply_ids_alike", kMit, "WaistLat: 31, WaistSag: 32",
             "WaistLat: {node: 31, reply_id: 0}, WaistSag: {node: 47, reply_id: 0}",
             "replies could not be told from those of joint 'WaistLat'"},
        Case{"no_reply_offset", kMit, "      reply_offset: 0x400\n", "",
             "missing key 'reply_offset'"},
        Case{"node_out_of_range", kMit, "WaistLat: 31", "WaistLat: 256",
             "expected a whole number from 1 to 255, got '256'"},
        Case{"node_no_number", kMit, "WaistLat: 31", "WaistLat: left",
             "expected a whole number from 1 to 255, got 'left'"},
        Case{"bitrate_odd", kMit, "bitrate: 1000000", "bitrate: 777777", "whole nanoseconds"},
        Case{"data_bitrate_low", kMit, "data_bitrate: 5000000", "data_bitrate: 500000",
             "expected at least the bitrate"},
        Case{"rate_zero", kMit, "rate: 1000 ", "rate: 0 ", "expected a number > 0"},
        Case{"load_above_one", kMit, "max_load: 0.8", "max_load: 1.2", "expected at most 1"},
        Case{"calibrated_no_day", kMit, "max_load: 0.8", "calibrated: 2026-02-30",
             "expected a day as YYYY-MM-DD, found 2026-02-30"},
        Case{"calibrated_with_time", kMit, "max_load: 0.8", "calibrated: 2026-02-03T10:00",
             "expected a day as YYYY-MM-DD"},
        Case{"direction", kMit, "WaistLat: 31", "WaistLat: {node: 31, direction: 2}",
             "expected 1 or -1"},
        Case{"zero_beyond_range", kMit, "WaistLat: 31", "WaistLat: {node: 31, zero: 3.9}",
             "position range [-4, 4]"},
        Case{"unknown_key", kMit, "interface: can1", "interfaces: can1", "unknown key"},
        Case{"mode_on_mit", kMit, "protocol: mit", "protocol: mit\n      mode: cst",
             "belongs to protocol cia402 only"},
        Case{"canopen_fd", kServo, "bitrate: 1000000",
             "bitrate: 1000000\n      data_bitrate: 5000000",
             "is classic CAN: leave data_bitrate out"},
        Case{"unknown_mode", kServo, "mode: cst", "mode: pp", "unknown mode 'pp', expected cst"},
        Case{"lost_host_missing", kServo, "      lost_host: quick_stop\n", "",
             "missing key 'lost_host'"},
        Case{"lost_host_unknown", kServo, "lost_host: quick_stop", "lost_host: pray",
             "unknown reaction 'pray', expected none, fault, disable or quick_stop"},
        Case{"node_is_host", kServo, "WaistLat: 31", "WaistLat: 1", "node id 1 is the host's"},
        Case{"heartbeat_silly", kServo, "heartbeat: 0.02 ", "heartbeat: 0 ",
             "expected 0.002 to 10 s"},
        Case{"backend", kMit, "backend: socketcan", "backend: ode",
             "no buses behind backend 'ode', expected socketcan"}),
    [](const auto& c) { return c.param.name; });

// ---- motor types

class BadMotor : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              ("clamber_motors_" + std::string(GetParam().name));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

TEST_P(BadMotor, IsOneLineThatSaysWhatWhereAndHow) {
  const Case& c = GetParam();
  std::ofstream(folder_ / "motors.yaml") << test::edited("motors.yaml", c.from, c.to);
  const std::string map = test::file_text(test::kSource / "configs/hal" / kMit);
  try {
    (void)parse_bus_map(map, folder_ / "map.yaml", test::coman());
    FAIL() << "not refused";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(c.message));
    EXPECT_THAT(error.what(), HasSubstr("motors.yaml:"));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cases, BadMotor,
    testing::Values(
        Case{"range_missing", "", "    position: [-4, 4]\n", "", "missing range 'position'"},
        Case{"range_one_end", "", "position: [-4, 4]", "position: [4]", "expected [min, max]"},
        Case{"range_reversed", "", "position: [-4, 4]", "position: [4, -4]", "expected min < max"},
        Case{"range_empty", "", "position: [-4, 4]", "position: [4, 4]", "expected min < max"},
        Case{"range_nan", "", "position: [-4, 4]", "position: [.nan, 4]", "finite number"},
        Case{"negative_gain", "", "kd: [0, 5]", "kd: [-5, 5]", "must not begin below 0"},
        Case{"reply_unknown", "", "reply: state_nibble", "reply: eight", "unknown reply 'eight'"},
        Case{"voltage_range", "", "reply: state_nibble", "reply: voltage",
             "missing range 'voltage'"},
        Case{"firmware_missing", "", "    firmware: \"AK80-6 V1.0\"\n", "",
             "missing key 'firmware'"},
        Case{"watchdog_missing", "", "    watchdog: 0.1\n", "", "missing key 'watchdog'"},
        Case{"protocol", "", "protocol: cia402", "protocol: canopen", "unknown protocol 'canopen'"},
        Case{"rated_torque", "", "rated_torque: 20 ", "rated_torque: 0 ", "expected a number > 0"},
        Case{"max_torque", "", "max_torque: 54 ", "max_torque: 1000 ",
             "at most 32 times rated_torque"}),
    [](const auto& c) { return c.param.name; });

}  // namespace
}  // namespace clamber
