#include "apps/input_log.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "control/crc32c.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

static_assert(std::endian::native == std::endian::little, "records are stored as they are");

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "clamber input log";
constexpr int kFormatVersion = 1;
constexpr std::size_t kLongestHeader = 1 << 20;  // bytes

/// Calls `f` with the name and place of every number of the settings; what is not a number in JSON
/// (infinity) is null there.
template <class Config, class F>
void for_each_number(Config& c, const F& f) {
  f("dt", c.dt);
  f("torque_rate_limit", c.torque_rate_limit);
  f("derivative_filter", c.derivative_filter);
  f("transfer_time", c.transfer_time);
  f("time_scale", c.time_scale);
  f("start_time", c.start_time);
  f("start_speed", c.start_speed);
  f("start_distance_limit", c.start_distance_limit);
  f("hold_time", c.hold_time);
  f("tracking_error_limit", c.tracking_error_limit);
  f("overshoot_limit", c.overshoot_limit);
  f("velocity_factor", c.velocity_factor);
  f("jump_limit", c.jump_limit);
  f("frozen_limit", c.frozen_limit);
  f("pause_time", c.pause_time);
  f("saturation_time", c.saturation_time);
  f("overspeed_factor", c.overspeed_factor);
  f("overspeed_time", c.overspeed_time);
  f("limit_margin", c.limit_margin);
  f("temperature_limit", c.temperature_limit);
  f("acceleration_limit", c.acceleration_limit);
  f("jerk_limit", c.jerk_limit);
  f("lowering_time", c.lowering_time);
  f("lowering_damping", c.lowering_damping);
}

template <class Joint, class F>
void for_each_joint_number(Joint& j, const F& f) {
  f("kp", j.gains.kp);
  f("ki", j.gains.ki);
  f("kd", j.gains.kd);
  f("torque_limit", j.torque_limit);
  f("lower", j.lower);
  f("upper", j.upper);
  f("velocity_limit", j.velocity_limit);
  f("spring_stiffness", j.spring_stiffness);
}

auto writer_of(Json& json) {
  return [&json](const char* name, double value) {
    json[name] = std::isfinite(value) ? Json(value) : Json(nullptr);
  };
}

auto reader_of(const Json& json) {
  return [&json](const char* name, double& value) {
    const Json& found = json.at(name);
    value = found.is_null() ? ControllerConfig::kNever : found.get<double>();
  };
}

Json to_json(const ControllerConfig& config) {
  Json json;
  for_each_number(config, writer_of(json));
  json["feed_forward"] = config.feed_forward == FeedForward::kPlan ? "plan" : "none";
  json["failure_policy"] = to_string(config.failure_policy);
  json["stale_ticks_limit"] = config.stale_ticks_limit;
  json["watchdog_ticks"] = config.watchdog_ticks;
  json["accept_uncertified"] = config.accept_uncertified;
  Json& joints = json["joints"] = Json::array();
  for (std::uint32_t j = 0; j < config.joint_count; ++j) {
    Json joint;
    for_each_joint_number(config.joints[j], writer_of(joint));
    joints.push_back(std::move(joint));
  }
  return json;
}

ControllerConfig config_from(const Json& json, const std::string& file) {
  ControllerConfig config;
  for_each_number(config, reader_of(json));
  config.feed_forward = json.at("feed_forward") == "plan" ? FeedForward::kPlan : FeedForward::kNone;
  const auto policy = failure_policy_named(json.at("failure_policy").get<std::string>());
  if (!policy) throw InputError(file + ":1: failure_policy: expected hold, lower or limp");
  config.failure_policy = *policy;
  config.stale_ticks_limit = json.at("stale_ticks_limit");
  config.watchdog_ticks = json.at("watchdog_ticks");
  config.accept_uncertified = json.at("accept_uncertified");
  const Json& joints = json.at("joints");
  if (joints.size() > kMaxJoints) throw InputError(file + ":1: joints: too many");
  config.joint_count = static_cast<std::uint32_t>(joints.size());
  for (std::size_t j = 0; j < joints.size(); ++j)
    for_each_joint_number(config.joints[j], reader_of(joints[j]));
  return config;
}

/// Header and length of the plan image behind it.
std::pair<InputLogHeader, std::size_t> parse_header(const std::string& line,
                                                    const std::string& file) {
  try {
    const Json json = Json::parse(line);
    if (json.at("format") != kFormat || json.at("version") != kFormatVersion)
      throw InputError(file + ": expected an input log of version " +
                       std::to_string(kFormatVersion));
    InputLogHeader header{.robot = json.at("robot"),
                          .robot_hash = json.at("robot_hash"),
                          .joint_names = json.at("joint_names"),
                          .plan_sha256 = json.at("plan_sha256"),
                          .config = config_from(json.at("controller"), file),
                          .image = {}};
    if (header.joint_names.size() != header.config.joint_count || header.joint_names.empty())
      throw InputError(file + ":1: joint_names: not one for every joint of the controller");
    return {std::move(header), json.at("image_bytes").get<std::size_t>()};
  } catch (const Json::exception& error) {
    throw InputError(file + ":1: not an input log: " + error.what());
  }
}

template <class Record>
std::uint32_t crc_of(const Record& record) noexcept {
  return crc32c(std::as_bytes(std::span(&record, 1)).first(offsetof(Record, crc)));
}

template <class Record>
void read_record(std::ifstream& in, Record& record) {
  in.read(reinterpret_cast<char*>(&record), sizeof(record));
}

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.17g", value);
  return text.data();
}

/// The first field in which two commands differ by a bit; empty: none.
std::string difference(const JointCommand& logged, const JointCommand& replayed) {
  const auto field = [](const char* name, double a, double b) {
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b)
               ? std::string()
               : std::string("command's ") + name + ": logged " + number(a) + ", replayed " +
                     number(b);
  };
  for (std::string what : {field("q", logged.q, replayed.q), field("dq", logged.dq, replayed.dq),
                           field("kp", logged.kp, replayed.kp), field("kd", logged.kd, replayed.kd),
                           field("tau", logged.tau, replayed.tau)})
    if (!what.empty()) return what;
  return {};
}

/// A record that is not what was written.
std::optional<ReplayDifference> damage(const InputLog& log, std::size_t tick) {
  const InputTick& head = log.ticks[tick];
  if (head.crc != crc_of(head)) return ReplayDifference{tick, "", "its record is damaged"};
  if (head.tick != tick)
    return ReplayDifference{tick, "", "the log goes on with tick " + std::to_string(head.tick)};
  const auto rows = log.joints(tick);
  for (std::size_t j = 0; j < rows.size(); ++j)
    if (rows[j].crc != crc_of(rows[j]))
      return ReplayDifference{tick, log.header.joint_names[j], "its record is damaged"};
  return std::nullopt;
}

}  // namespace

InputLogWriter::InputLogWriter(std::filesystem::path file, const InputLogHeader& header,
                               std::size_t capacity)
    : file_(std::move(file)),
      out_(file_, std::ios::binary),
      joints_(header.joint_names.size()),
      capacity_(std::max<std::size_t>(capacity, 1)),
      ticks_(capacity_),
      rows_(capacity_ * joints_) {
  const Json json = {{"format", kFormat},
                     {"version", kFormatVersion},
                     {"robot", header.robot},
                     {"robot_hash", header.robot_hash},
                     {"joint_names", header.joint_names},
                     {"plan_sha256", header.plan_sha256},
                     {"image_bytes", header.image.size()},
                     {"controller", to_json(header.config)}};
  out_ << json.dump() << '\n';
  out_.write(reinterpret_cast<const char*>(header.image.data()),
             static_cast<std::streamsize>(header.image.size()));
  if (!out_) throw InputError(file_.string() + ": cannot write the input log");
}

void InputLogWriter::before(const Controller& controller,
                            std::span<const JointState> states) noexcept {
  if (used_ == capacity_ || states.size() != joints_) return;
  InputTick& head = ticks_[used_];
  head = {.tick = count_,
          .requests = controller.requests(),
          .skipped_ticks = controller.bus_health().skipped_ticks,
          .speed = controller.speed(),
          .bus_down = controller.bus_health().down ? 1u : 0u};
  for (std::size_t j = 0; j < joints_; ++j) rows_[used_ * joints_ + j].state = states[j];
}

void InputLogWriter::after(std::span<const JointCommand> commands) noexcept {
  ++count_;
  if (used_ == capacity_ || commands.size() != joints_) {
    ++dropped_;
    return;
  }
  for (std::size_t j = 0; j < joints_; ++j) {
    InputJoint& row = rows_[used_ * joints_ + j];
    row.command = commands[j];
  }
  ++used_;
}

void InputLogWriter::flush() {
  for (std::size_t i = 0; i < used_; ++i) {
    ticks_[i].crc = crc_of(ticks_[i]);
    for (std::size_t j = 0; j < joints_; ++j) {
      InputJoint& row = rows_[i * joints_ + j];
      row.crc = crc_of(row);
    }
    out_.write(reinterpret_cast<const char*>(&ticks_[i]), sizeof(InputTick));
    out_.write(reinterpret_cast<const char*>(&rows_[i * joints_]),
               static_cast<std::streamsize>(joints_ * sizeof(InputJoint)));
  }
  used_ = 0;
}

void InputLogWriter::close() {
  flush();
  out_.close();
  if (!out_) throw InputError(file_.string() + ": cannot write the input log");
}

InputLog load_input_log(const std::filesystem::path& file) {
  std::ifstream in = open_file(file, kRunLogBytes);
  std::string line(kLongestHeader, '\0');
  if (!in.getline(line.data(), static_cast<std::streamsize>(line.size())))
    throw InputError(file.string() + ":1: not an input log");
  line.resize(std::strlen(line.c_str()));
  InputLog log;
  auto [header, image_bytes] = parse_header(line, file.string());
  log.header = std::move(header);
  const std::size_t joints = log.header.joint_names.size();
  const std::size_t tick_bytes = sizeof(InputTick) + joints * sizeof(InputJoint);
  const std::uintmax_t rest = std::filesystem::file_size(file) - (line.size() + 1);
  if (image_bytes > rest) throw InputError(file.string() + ": truncated in the plan image");
  const std::uintmax_t body = rest - image_bytes;
  if (body % tick_bytes != 0)
    throw InputError(file.string() + ": truncated in tick " + std::to_string(body / tick_bytes));
  log.header.image.resize(image_bytes);
  in.read(reinterpret_cast<char*>(log.header.image.data()),
          static_cast<std::streamsize>(image_bytes));
  log.ticks.resize(body / tick_bytes);
  log.rows.resize(log.ticks.size() * joints);
  for (std::size_t i = 0; i < log.ticks.size(); ++i) {
    read_record(in, log.ticks[i]);
    in.read(reinterpret_cast<char*>(&log.rows[i * joints]),
            static_cast<std::streamsize>(joints * sizeof(InputJoint)));
  }
  if (!in) throw InputError(file.string() + ": cannot read the input log");
  return log;
}

Replay replay(const InputLog& log) {
  const InputLogHeader& header = log.header;
  const auto controller = std::make_unique<Controller>();
  std::vector<double> workspace(
      Controller::workspace_size(header.image.size() / sizeof(ImageKeyframe)));
  const LoadReport loaded =
      controller->load(header.config, header.robot_hash, header.image, workspace);
  if (loaded.status != LoadStatus::kOk)
    throw InputError(
        std::string("the controller refuses the logged plan: ") + to_string(loaded.status) +
        (loaded.status == LoadStatus::kBadImage ? std::string(": ") + to_string(loaded.image)
                                                : std::string()));
  const std::size_t joints = header.joint_names.size();
  std::vector<JointState> states(joints);
  std::vector<JointCommand> commands(joints);
  TelemetryFrame frame;
  Replay result;
  for (; result.ticks < log.ticks.size(); ++result.ticks) {
    const std::size_t tick = result.ticks;
    if ((result.difference = damage(log, tick))) break;
    const InputTick& head = log.ticks[tick];
    for (unsigned c = 1; c < kOperatorCommandCount; ++c)
      if ((head.requests & 1u << c) != 0) controller->request(static_cast<OperatorCommand>(c));
    if (head.speed != controller->speed()) controller->set_speed(head.speed);
    controller->set_bus_health({.down = head.bus_down != 0, .skipped_ticks = head.skipped_ticks});
    const auto rows = log.joints(tick);
    for (std::size_t j = 0; j < joints; ++j) states[j] = rows[j].state;
    static_cast<void>(controller->tick(states, commands, frame));
    for (std::size_t j = 0; j < joints && !result.difference; ++j)
      if (std::string what = difference(rows[j].command, commands[j]); !what.empty())
        result.difference = {tick, header.joint_names[j], std::move(what)};
    if (result.difference) break;
  }
  result.end = controller->supervision();
  return result;
}

}  // namespace clamber
