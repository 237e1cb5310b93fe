#include "firmware_hal/motor_types.hpp"

#include <cmath>

#include "robot_model/yaml_reader.hpp"

namespace clamber {
namespace {

MitRange read_range(const YamlNode& motor, const std::string& key) {
  const std::optional<YamlNode> node = motor.find(key);
  if (!node)
    motor.fail("missing range '" + key +
               "': write it as [min, max] from the manual of this motor and firmware; a guessed "
               "range makes every value silently wrong");
  const std::vector<YamlNode> ends = node->items();
  if (ends.size() != 2) node->fail("expected [min, max]");
  const MitRange range{ends[0].number(), ends[1].number()};
  if (range.min >= range.max) node->fail("expected min < max");
  return range;
}

MitReplyKind read_reply(const YamlNode& node) {
  const std::string text = node.text();
  if (text == "plain") return MitReplyKind::kPlain;
  if (text == "voltage") return MitReplyKind::kVoltage;
  if (text == "temperature_error") return MitReplyKind::kTemperatureError;
  if (text == "state_nibble") return MitReplyKind::kStateNibble;
  node.fail("unknown reply '" + text +
            "', expected plain (6 bytes), voltage (7), temperature_error (8) or state_nibble (8)");
}

MitMotor read_mit(const YamlNode& node) {
  node.allow_only({"protocol", "firmware", "position", "velocity", "kp", "kd", "torque",
                   "reply_torque", "voltage", "reply", "temperature_offset", "watchdog", "fd",
                   "winding"});
  MitMotor motor;
  // Which firmware the ranges were read from; only people compare it with the drive's label.
  (void)node.at("firmware").text();
  motor.ranges.position = read_range(node, "position");
  motor.ranges.velocity = read_range(node, "velocity");
  motor.ranges.kp = read_range(node, "kp");
  motor.ranges.kd = read_range(node, "kd");
  motor.ranges.torque = read_range(node, "torque");
  motor.ranges.reply_torque =
      node.find("reply_torque") ? read_range(node, "reply_torque") : motor.ranges.torque;
  motor.reply = read_reply(node.at("reply"));
  if (motor.reply == MitReplyKind::kVoltage) motor.ranges.voltage = read_range(node, "voltage");
  if (const auto offset = node.find("temperature_offset"))
    motor.temperature_offset = offset->number();
  motor.watchdog = node.at("watchdog").non_negative();
  motor.fd = node.at("fd").flag();
  if (motor.ranges.kp.min < 0.0 || motor.ranges.kd.min < 0.0)
    node.fail("kp and kd ranges must not begin below 0: a negative gain drives away");
  return motor;
}

Cia402Motor read_cia402(const YamlNode& node) {
  node.allow_only({"protocol", "counts_per_turn", "rated_torque", "gear_ratio", "max_torque",
                   "lower_option", "position_loop", "quick_stop", "winding"});
  Cia402Motor motor;
  motor.counts_per_turn = node.at("counts_per_turn").positive();
  motor.rated_torque = node.at("rated_torque").positive();
  motor.gear_ratio = node.at("gear_ratio").positive();
  motor.max_torque = node.at("max_torque").positive();
  // Target torque is a signed 16-bit number of thousandths of the rated torque.
  if (motor.max_torque > 32.0 * motor.rated_torque)
    node.at("max_torque").fail("expected at most 32 times rated_torque");
  if (const auto option = node.find("lower_option")) {
    const double value = option->number();
    // CiA 402-2: what 6007h does from -1 downwards is the maker's to say.
    if (value != std::floor(value) || value < -32768.0 || value > -1.0)
      option->fail("expected a whole number from -32768 to -1, found " + option->text());
    motor.lower_option = static_cast<std::int16_t>(value);
  }
  if (const auto loop = node.find("position_loop")) {
    loop->allow_only({"kp", "kd"});
    motor.loop_kp = loop->at("kp").positive();
    motor.loop_kd = loop->at("kd").non_negative();
  }
  if (const auto ramp = node.find("quick_stop")) motor.quick_stop = ramp->positive();
  return motor;
}

WindingHeat read_winding(const YamlNode& node) {
  node.allow_only({"loss", "resistance", "time_constant", "limit", "ambient"});
  WindingHeat heat;
  heat.loss = node.at("loss").non_negative();
  heat.resistance = node.at("resistance").positive();
  heat.time_constant = node.at("time_constant").positive();
  heat.limit = node.at("limit").positive();
  if (const auto ambient = node.find("ambient")) heat.ambient = ambient->number();
  if (heat.limit <= heat.ambient + 5.0)
    node.at("limit").fail("expected at least 5 degrees above ambient");
  return heat;
}

}  // namespace

std::map<std::string, ListedMotor> load_motor_types(const std::filesystem::path& file) {
  const YamlNode root = YamlNode::load(file);
  root.allow_only({"motors"});
  std::map<std::string, ListedMotor> types;
  for (const auto& [name, node] : root.at("motors").entries()) {
    ListedMotor motor;
    motor.type.name = name;
    motor.where = node.where();
    motor.type.protocol = read_protocol(node.at("protocol"));
    if (motor.type.protocol == BusProtocol::kMit)
      motor.type.mit = read_mit(node);
    else
      motor.type.cia402 = read_cia402(node);
    if (const auto winding = node.find("winding")) motor.type.winding = read_winding(*winding);
    types.emplace(name, motor);
  }
  return types;
}

BusProtocol read_protocol(const YamlNode& node) {
  const std::string text = node.text();
  if (text == "mit") return BusProtocol::kMit;
  if (text == "cia402") return BusProtocol::kCia402;
  node.fail("unknown protocol '" + text + "', expected mit or cia402");
}

}  // namespace clamber
