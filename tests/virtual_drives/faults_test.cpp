// The fault matrix: every row of faults.yaml against the host's own code, and docs/faults.md, which
// is made from the same rows. CLAMBER_WRITE_DOCS=1 writes the page, CLAMBER_SHOW_FAULTS=1 prints
// what was measured.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "robot_model/yaml_reader.hpp"
#include "tests/firmware_hal/coman_map.hpp"
#include "tests/virtual_drives/fault_rig.hpp"

namespace clamber {
namespace {

struct Row {
  std::string fault;
  std::string what;
  BusProtocol protocol = BusProtocol::kMit;
  test::RobotState state = test::RobotState::kDisabled;
  test::FaultOutcome allowed;
  test::FaultOutcome measured;
};

int whole(const YamlNode& node) { return static_cast<int>(node.non_negative()); }

test::FaultOutcome read_outcome(const YamlNode& node) {
  node.allow_only({"host", "drives", "ticks", "moved"});
  return {node.at("host").text(), node.at("drives").text(), "", whole(node.at("ticks")),
          whole(node.at("moved"))};
}

/// The table with what was measured; made once.
const std::vector<Row>& rows() {
  static const std::vector<Row> all = [] {
    std::vector<Row> table;
    const YamlNode root = YamlNode::load(test::kSource / "tests/virtual_drives/faults.yaml");
    root.allow_only({"faults"});
    for (const auto& [name, fault] : root.at("faults").entries()) {
      fault.allow_only({"what", "mit", "cia402"});
      for (const BusProtocol protocol : {BusProtocol::kMit, BusProtocol::kCia402}) {
        const auto states = fault.find(to_string(protocol));
        if (!states) continue;
        for (const test::RobotState state : test::kRobotStates)
          table.push_back({name, fault.at("what").text(), protocol, state,
                           read_outcome(states->at(to_string(state))),
                           test::rehearse_fault(name, protocol, state)});
      }
    }
    return table;
  }();
  return all;
}

std::string place(const Row& row) {
  return row.fault + ", " + to_string(row.protocol) + ", " + to_string(row.state);
}

TEST(Faults, EveryRowKeepsWhatItStates) {
  for (const Row& row : rows()) {
    SCOPED_TRACE(place(row));
    EXPECT_EQ(row.measured.host, row.allowed.host);
    EXPECT_EQ(row.measured.drives, row.allowed.drives);
    EXPECT_LE(row.measured.ticks, row.allowed.ticks);
    EXPECT_LE(row.measured.moved, row.allowed.moved);
  }
  if (std::getenv("CLAMBER_SHOW_FAULTS") == nullptr) return;
  for (const Row& row : rows())
    std::printf("%s: {host: %s, drives: %s, ticks: %d, moved: %d}\n", place(row).c_str(),
                row.measured.host.c_str(), row.measured.drives.c_str(), row.measured.ticks,
                row.measured.moved);
}

TEST(Faults, NothingIsEnabledWhereEnablingIsRefused) {
  for (const Row& row : rows())
    if (row.measured.host == "refuses") {
      EXPECT_EQ(row.measured.drives, "off") << place(row);
    }
}

TEST(Faults, TheTableHasEveryFaultInEveryState) {
  std::set<std::string> names;
  for (const Row& row : rows()) names.insert(row.fault);
  for (const char* name :
       {"drop_1",     "drop_5",         "drop_20",  "duplicate",      "reorder",
        "delay",      "stale",          "wrong_id", "bad_length",     "corrupt",
        "emergency",  "heartbeat_lost", "reboot",   "drive_fault",    "encoder_jump",
        "bus_off",    "error_passive",  "no_room",  "interface_down", "unplugged",
        "host_killed"})
    EXPECT_TRUE(names.contains(name)) << name;
}

TEST(Faults, TheSameFaultTwiceIsTheSame) {
  const auto once = [] {
    return test::rehearse_fault("drop_20", BusProtocol::kCia402, test::RobotState::kExecuting);
  };
  const test::FaultOutcome a = once();
  const test::FaultOutcome b = once();
  EXPECT_EQ(a.ticks, b.ticks);
  EXPECT_EQ(a.moved, b.moved);
  EXPECT_EQ(a.host + a.drives + a.detail, b.host + b.drives + b.detail);
}

const char* const kIntroduction = R"(# What happens when something goes wrong

Made from `tests/virtual_drives/faults.yaml` and a run of every row; do not edit:
`CLAMBER_WRITE_DOCS=1 <build>/tests/virtual_drives/faults_test`. The test fails when this page is out
of date, when a reaction is another or later than stated, or when a joint moves further.

Each row: six joints of 0.14 kg m2 on two buses with virtual drives (the shipped maps' types), every
joint pulled by 4 N m, under the host's own code and the bus model. The fault is put on the first bus
or its first drive, stays for 300 ticks of 1 ms, and everything is watched as long.

- **State**: *disabled* (robot hung up; then it is switched on), *ready* (on, before the plan moves),
  *executing* (in the middle of a motion, 0.2 rad/s), *holding* (at the plan's end).
- **Host**: *goes on*; *waits* (the plan stands in some ticks, then goes on); *holds* (fault: every
  joint is held where it is, the plan will not go on; the reason in brackets); *lowers* (fault: the
  joints sink, damped, see [supervisor](supervisor.md)); *enables*, *refuses*.
- **Drives** at the end: *on*, *off* (switched off by the host), *let go* (limp by their own
  decision), *stop* (quick stop of their own, then holding).
- **Ticks** until the reaction and **mrad** that the farthest joint got from its reference: measured /
  at most. Limp joints fall under the bench's 4 N m: what let go means on a robot depends on what it
  carries.

Limp is what an MIT drive does without its host, and nothing in its protocol changes that: its
watchdog (here 0.1 s) bounds how long it goes on with the last setpoint. CiA 402 drives with
`lost_host: quick_stop` hold; while a plan runs they do what it says for the phase. A robot that hangs on
its drives wants the latter, or a watchdog that holds.
)";

std::string pair(int measured, int allowed) {
  return std::to_string(measured) + " / " + std::to_string(allowed);
}

std::string page() {
  std::ostringstream out;
  out << kIntroduction;
  for (const BusProtocol protocol : {BusProtocol::kMit, BusProtocol::kCia402}) {
    out << "\n## " << (protocol == BusProtocol::kMit ? "MIT drives" : "CiA 402 drives")
        << "\n\n| fault | state | host | drives | ticks | mrad |\n|---|---|---|---|---|---|\n";
    std::string last;
    for (const Row& row : rows()) {
      if (row.protocol != protocol) continue;
      const test::FaultOutcome& m = row.measured;
      out << "| " << (row.fault == last ? "" : row.what) << " | " << to_string(row.state) << " | "
          << m.host << (m.detail.empty() ? "" : " (" + m.detail + ")") << " | " << m.drives << " | "
          << pair(m.ticks, row.allowed.ticks) << " | " << pair(m.moved, row.allowed.moved)
          << " |\n";
      last = row.fault;
    }
  }
  return out.str();
}

TEST(Faults, ThePageIsUpToDate) {
  const std::filesystem::path file = test::kSource / "docs/faults.md";
  if (std::getenv("CLAMBER_WRITE_DOCS") != nullptr) std::ofstream(file) << page();
  EXPECT_EQ(test::file_text(file), page())
      << "write it anew: CLAMBER_WRITE_DOCS=1 tests/virtual_drives/faults_test";
}

}  // namespace
}  // namespace clamber
