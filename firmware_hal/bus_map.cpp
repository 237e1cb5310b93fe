#include "firmware_hal/bus_map.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <numbers>
#include <set>

#include "firmware_hal/motor_types.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

using Motors = std::map<std::string, ListedMotor>;

std::string text_of(double value) {
  std::string text = std::to_string(value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.ends_with('.')) text.pop_back();
  return text;
}

/// Decimal or 0x hexadecimal, which ids are usually written in.
std::uint32_t whole(const YamlNode& node, std::uint32_t min, std::uint32_t max) {
  const std::string text = node.text();
  char* end = nullptr;
  const long value = std::strtol(text.c_str(), &end, 0);
  if (*end != '\0' || value < static_cast<long>(min) || value > static_cast<long>(max))
    node.fail("expected a whole number from " + std::to_string(min) + " to " + std::to_string(max) +
              ", got '" + text + "'");
  return static_cast<std::uint32_t>(value);
}

std::uint32_t read_bitrate(const YamlNode& node) {
  const std::uint32_t rate = whole(node, 10'000, 12'500'000);
  if (1'000'000'000u % rate != 0)
    node.fail(
        "expected a bit rate whose bit lasts whole nanoseconds, such as 500000, 1000000, "
        "2000000, 5000000 or 8000000");
  return rate;
}

void read_cia402_bus(const YamlNode& node, Bus& bus) {
  const std::string mode = node.at("mode").text();
  if (mode != "cst" && mode != "csp")
    node.at("mode").fail("unknown mode '" + mode + "', expected cst (torque) or csp (position)");
  bus.mode = mode == "cst" ? Cia402Mode::kCyclicTorque : Cia402Mode::kCyclicPosition;
  if (const auto host = node.find("host_node"))
    bus.host_node = static_cast<std::uint8_t>(whole(*host, 1, 127));
  if (const auto heartbeat = node.find("heartbeat")) {
    bus.heartbeat = heartbeat->number();
    if (bus.heartbeat < 0.002 || bus.heartbeat > 10.0)
      heartbeat->fail("expected 0.002 to 10 s between heartbeats");
  }
  const YamlNode lost = node.at("lost_host");
  const std::map<std::string, LostHostReaction> kReactions{
      {"none", LostHostReaction::kNone},
      {"fault", LostHostReaction::kFault},
      {"disable", LostHostReaction::kDisable},
      {"quick_stop", LostHostReaction::kQuickStop}};
  const auto found = kReactions.find(lost.text());
  if (found == kReactions.end())
    lost.fail("unknown reaction '" + lost.text() +
              "', expected none, fault, disable or quick_stop");
  bus.lost_host = found->second;
}

/// A joint's values seen from its drive must fit the range: what does not fit is silently clamped.
void require_range(const YamlNode& node, const ListedMotor& motor, const char* what, MitRange range,
                   double lower, double upper, const char* unit) {
  if (range.min <= lower && range.max >= upper) return;
  node.fail(std::string(what) + " range [" + text_of(range.min) + ", " + text_of(range.max) +
            "] of motor '" + motor.type.name + "' (" + motor.where +
            ") does not hold the joint's [" + text_of(lower) + ", " + text_of(upper) + "] " + unit +
            ": choose another motor type or set wider ranges in drive and file");
}

void require_fit(const YamlNode& node, const JointDrive& drive, const ListedMotor& motor,
                 const Joint& joint) {
  if (motor.type.protocol == BusProtocol::kCia402) {
    const Cia402Motor& m = motor.type.cia402;
    if (m.max_torque < joint.torque_limit)
      node.fail("motor '" + motor.type.name + "' (" + motor.where + ") gives " +
                text_of(m.max_torque) + " N m, the joint's plans may use " +
                text_of(joint.torque_limit) + ": choose a stronger motor type");
    const double counts =
        std::max(std::abs(joint.lower), std::abs(joint.upper)) + std::abs(drive.zero);
    if (counts / (2.0 * std::numbers::pi) * m.counts_per_turn > 2147483647.0)
      node.fail("the joint's range does not fit 32 bits of counts: lower counts_per_turn of '" +
                motor.type.name + "'");
    return;
  }
  const MitRanges& r = motor.type.mit.ranges;
  const double a = drive.direction * joint.lower + drive.zero;
  const double b = drive.direction * joint.upper + drive.zero;
  require_range(node, motor, "position", r.position, std::min(a, b), std::max(a, b), "rad");
  require_range(node, motor, "velocity", r.velocity, -joint.velocity_limit, joint.velocity_limit,
                "rad/s");
  require_range(node, motor, "torque", r.torque, -joint.torque_limit, joint.torque_limit, "N m");
  if (r.kp.min > 0.0 || r.kd.min > 0.0)
    node.fail("kp and kd ranges of motor '" + motor.type.name + "' (" + motor.where +
              ") must begin at 0: the host's PID needs both off");
}

const ListedMotor& find_motor(const YamlNode& node, const std::string& name, const Motors& motors) {
  const auto found = motors.find(name);
  if (found == motors.end()) {
    std::string known;
    for (const auto& [key, unused] : motors) known += (known.empty() ? "" : ", ") + key;
    node.fail("unknown motor '" + name + "', expected one of: " + known);
  }
  return found->second;
}

class BusReader {
 public:
  BusReader(const RobotModel& robot, const Motors& motors, double tick)
      : robot_(robot), motors_(motors), tick_(tick) {}

  Bus read(const std::string& name, const YamlNode& node) {
    node.allow_only({"interface", "protocol", "bitrate", "data_bitrate", "motor", "reply_offset",
                     "joints", "mode", "host_node", "heartbeat", "lost_host"});
    Bus bus;
    bus.name = name;
    bus.interface = node.at("interface").text();
    if (bus.interface.size() > 15)  // IFNAMSIZ of Linux
      node.at("interface").fail("expected an interface name of at most 15 characters");
    bus.protocol = read_protocol(node.at("protocol"));
    bus.bitrate = read_bitrate(node.at("bitrate"));
    read_data_bitrate(node, bus);
    if (bus.protocol == BusProtocol::kCia402) {
      if (node.find("reply_offset")) node.at("reply_offset").fail("belongs to protocol mit only");
      read_cia402_bus(node, bus);
    } else {
      for (const char* key : {"mode", "host_node", "heartbeat", "lost_host"})
        if (node.find(key)) node.at(key).fail("belongs to protocol cia402 only");
    }
    for (const auto& [joint, entry] : node.at("joints").entries())
      bus.drives.push_back(read_drive(node, bus, joint, entry));
    if (bus.drives.empty()) node.at("joints").fail("expected at least one joint: node id");
    return bus;
  }

 private:
  static void read_data_bitrate(const YamlNode& node, Bus& bus) {
    const auto data = node.find("data_bitrate");
    if (!data) return;
    bus.data_bitrate = read_bitrate(*data);
    if (bus.data_bitrate < bus.bitrate)
      data->fail("expected at least the bitrate, or leave it out");
    if (bus.protocol == BusProtocol::kCia402)
      data->fail("CiA 402 over CANopen (CiA 301) is classic CAN: leave data_bitrate out");
  }

  JointDrive read_drive(const YamlNode& bus_node, const Bus& bus, const std::string& joint,
                        const YamlNode& entry) {
    JointDrive drive;
    drive.name = joint;
    const auto index = robot_.find_joint(joint);
    if (!index) entry.fail("robot '" + robot_.name + "' has no joint '" + joint + "'");
    drive.joint = *index;
    const bool is_map = entry.is_map();
    if (is_map) entry.allow_only({"node", "motor", "reply_id", "direction", "zero"});
    const bool mit = bus.protocol == BusProtocol::kMit;
    drive.node =
        static_cast<std::uint16_t>(whole(is_map ? entry.at("node") : entry, 1, mit ? 0xFFu : 127u));
    const YamlNode motor_node =
        is_map && entry.find("motor") ? entry.at("motor") : bus_node.at("motor");
    const ListedMotor& motor = find_motor(motor_node, motor_node.text(), motors_);
    if (motor.type.protocol != bus.protocol)
      motor_node.fail("motor '" + motor.type.name + "' speaks " + to_string(motor.type.protocol) +
                      ", the bus " + to_string(bus.protocol) + ": one bus, one protocol");
    drive.motor = motor.type;
    if (is_map) read_mounting(entry, drive);
    if (mit) read_mit(bus_node, entry, bus, motor, drive);
    require_fit(entry, drive, motor, robot_.joints[static_cast<std::size_t>(*index)]);
    claim(entry, bus, drive);
    return drive;
  }

  static void read_mounting(const YamlNode& entry, JointDrive& drive) {
    if (const auto direction = entry.find("direction")) {
      drive.direction = direction->number();
      if (std::abs(drive.direction) != 1.0) direction->fail("expected 1 or -1");
    }
    if (const auto zero = entry.find("zero")) drive.zero = zero->number();
  }

  void read_mit(const YamlNode& bus_node, const YamlNode& entry, const Bus& bus,
                const ListedMotor& motor, JointDrive& drive) const {
    const bool own = entry.is_map() && entry.find("reply_id");
    drive.reply_id = static_cast<std::uint16_t>(
        own ? whole(entry.at("reply_id"), 0, kMaxStandardId)
            : drive.node + whole(bus_node.at("reply_offset"), 0, kMaxStandardId - 0xFF));
    if (bus.data_bitrate > 0 && !motor.type.mit.fd)
      entry.fail("motor '" + motor.type.name + "' (" + motor.where +
                 ") speaks classic CAN only: leave data_bitrate out or choose another motor type");
    if (motor.type.mit.watchdog > 0.0 && motor.type.mit.watchdog < 3.0 * tick_)
      entry.fail("the watchdog of motor '" + motor.type.name + "' (" + motor.where +
                 ") runs out after " + text_of(1e3 * motor.type.mit.watchdog) +
                 " ms, less than three ticks of " + text_of(1e3 * tick_) +
                 " ms: the drive would go limp at one lost frame");
  }

  /// Remembers who uses which joint, node id and reply id, and refuses what is used twice.
  void claim(const YamlNode& entry, const Bus& bus, const JointDrive& drive) {
    const auto [owner, first] = joints_.emplace(drive.joint, bus.name);
    if (!first) entry.fail("joint is on bus '" + owner->second + "' already");
    for (const JointDrive& other : bus.drives) {
      if (other.node == drive.node)
        entry.fail("node id " + std::to_string(drive.node) + " belongs to joint '" + other.name +
                   "' on this bus already: give each drive its own");
      if (bus.protocol != BusProtocol::kMit) continue;
      const int mask = drive.motor.mit.reply == MitReplyKind::kStateNibble ||
                               other.motor.mit.reply == MitReplyKind::kStateNibble
                           ? 0x0F
                           : 0xFF;
      if (other.reply_id == drive.reply_id && ((other.node ^ drive.node) & mask) == 0)
        entry.fail("replies could not be told from those of joint '" + other.name +
                   "': both have reply id " + std::to_string(drive.reply_id) +
                   " and the same last " + (mask == 0x0F ? "four" : "eight") +
                   " bits of node id; set another reply id in drive and file");
      if (other.reply_id == drive.node || drive.reply_id == other.node)
        entry.fail("a reply id equals a node id (joint '" + other.name +
                   "'): that drive would take replies for commands; choose another reply id");
    }
    if (bus.protocol == BusProtocol::kMit && drive.reply_id == drive.node)
      entry.fail(
          "reply id equals the node id: the drive's replies would be commands; choose another");
    if (bus.protocol == BusProtocol::kCia402 && drive.node == bus.host_node)
      entry.fail("node id " + std::to_string(drive.node) + " is the host's (host_node)");
  }

  const RobotModel& robot_;
  const Motors& motors_;
  double tick_;
  std::map<int, std::string> joints_;
};

/// "2026-11-22" as days since 1970.
long read_day(const YamlNode& node) {
  const std::string text = node.text();
  int year = 0;
  unsigned month = 0;
  unsigned day = 0;
  int used = 0;
  const bool shape = std::sscanf(text.c_str(), "%4d-%2u-%2u%n", &year, &month, &day, &used) == 3 &&
                     static_cast<std::size_t>(used) == text.size();
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month),
                                         std::chrono::day(day)};
  if (!shape || !date.ok()) node.fail("expected a day as YYYY-MM-DD, found " + text);
  return std::chrono::sys_days(date).time_since_epoch().count();
}

void require_all_joints(const BusMap& map, const YamlNode& node, const RobotModel& robot) {
  std::set<int> mapped;
  for (const Bus& bus : map.buses)
    for (const JointDrive& drive : bus.drives) mapped.insert(drive.joint);
  for (int i = 0; i < robot.joint_count(); ++i)
    if (!mapped.contains(i))
      node.fail("joint '" + robot.joints[static_cast<std::size_t>(i)].name + "' of robot '" +
                robot.name + "' is on no bus: add it to the joints of one");
}

}  // namespace

const char* to_string(BusProtocol protocol) noexcept {
  return protocol == BusProtocol::kMit ? "mit" : "cia402";
}

BusMap load_bus_map(const std::filesystem::path& file, const RobotModel& robot) {
  return parse_bus_map(read_file(file), file, robot);
}

BusMap parse_bus_map(const std::string& text, const std::filesystem::path& file,
                     const RobotModel& robot) {
  const YamlNode root = YamlNode::parse(text, file.string());
  root.allow_only({"hal"});
  const YamlNode hal = root.at("hal");
  const std::string backend = hal.at("backend").text();
  if (backend != "socketcan")
    hal.at("backend").fail("no buses behind backend '" + backend + "', expected socketcan");
  hal.allow_only({"backend", "rate", "max_load", "turnaround", "motors", "calibrated", "buses"});

  BusMap map;
  map.file = file.string();
  map.joint_count = robot.joint_count();
  map.rate = hal.at("rate").positive();
  if (map.rate > 10'000.0) hal.at("rate").fail("expected at most 10000 Hz");
  if (const auto load = hal.find("max_load")) {
    map.max_load = load->positive();
    if (map.max_load > 1.0) load->fail("expected at most 1");
  }
  if (const auto turnaround = hal.find("turnaround")) map.turnaround = turnaround->non_negative();
  if (const auto day = hal.find("calibrated")) map.calibrated = read_day(*day);
  const Motors motors = load_motor_types(file.parent_path() / hal.at("motors").text());
  BusReader reader(robot, motors, 1.0 / map.rate);
  for (const auto& [name, node] : hal.at("buses").entries()) {
    Bus bus = reader.read(name, node);
    for (const Bus& other : map.buses)
      if (other.interface == bus.interface)
        node.at("interface")
            .fail("interface '" + bus.interface + "' belongs to bus '" + other.name +
                  "' already: one interface, one bus, one protocol");
    map.buses.push_back(std::move(bus));
  }
  require_all_joints(map, hal.at("buses"), robot);
  return map;
}

MitDrive mit_drive(const Bus& bus, const JointDrive& drive) noexcept {
  const MitMotor& motor = drive.motor.mit;
  return {drive.node,  drive.reply_id,           motor.ranges,
          motor.reply, motor.temperature_offset, bus.format()};
}

Cia402Drive cia402_drive(const Bus& bus, const JointDrive& drive) noexcept {
  const Cia402Motor& motor = drive.motor.cia402;
  return {static_cast<std::uint8_t>(drive.node),
          bus.mode,
          motor.counts_per_turn / (2.0 * std::numbers::pi),
          motor.rated_torque / 1000.0,
          motor.max_torque,
          motor.lower_option};
}

}  // namespace clamber
