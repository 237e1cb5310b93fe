#include "apps/run_log.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

static_assert(std::endian::native == std::endian::little, "frames are stored as they are");

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "clamber run log";
constexpr int kFormatVersion = 1;
constexpr std::size_t kLongestHeader = 65536;  // bytes

RunLogHeader parse_header(const std::string& line, const std::string& file) {
  try {
    const Json json = Json::parse(line);
    if (json.at("format") != kFormat || json.at("version") != kFormatVersion)
      throw InputError(file + ": expected a run log of version " + std::to_string(kFormatVersion));
    if (json.at("frame_bytes") != sizeof(TelemetryFrame))
      throw InputError(file + ": frame_bytes: expected " + std::to_string(sizeof(TelemetryFrame)) +
                       ": written by another version of Clamber");
    return {.robot = json.at("robot"),
            .robot_hash = json.at("robot_hash"),
            .joint_names = json.at("joint_names"),
            .contact_names = json.at("contact_names"),
            .plan_sha256 = json.at("plan_sha256"),
            .dt = json.at("dt")};
  } catch (const Json::exception& error) {
    throw InputError(file + ":1: not a run log: " + error.what());
  }
}

}  // namespace

RunLogHeader make_run_log_header(const RobotModel& robot, const std::string& plan_sha256,
                                 double dt) {
  RunLogHeader header{.robot = robot.name,
                      .robot_hash = robot.hash,
                      .joint_names = {},
                      .contact_names = {},
                      .plan_sha256 = plan_sha256,
                      .dt = dt};
  for (const Joint& joint : robot.joints) header.joint_names.push_back(joint.name);
  for (const ContactLink& contact : robot.contacts) header.contact_names.push_back(contact.name);
  return header;
}

RunLogWriter::RunLogWriter(std::filesystem::path file, const RunLogHeader& header,
                           std::size_t capacity)
    : file_(std::move(file)),
      out_(file_, std::ios::binary),
      buffer_(std::max<std::size_t>(capacity, 1)) {
  const Json json = {{"format", kFormat},
                     {"version", kFormatVersion},
                     {"frame_bytes", sizeof(TelemetryFrame)},
                     {"robot", header.robot},
                     {"robot_hash", header.robot_hash},
                     {"joint_names", header.joint_names},
                     {"contact_names", header.contact_names},
                     {"plan_sha256", header.plan_sha256},
                     {"dt", header.dt}};
  out_ << json.dump() << '\n';
  if (!out_) throw InputError(file_.string() + ": cannot write the run log");
}

bool RunLogWriter::push(const TelemetryFrame& frame) noexcept {
  if (used_ == buffer_.size()) {
    ++dropped_;
    return false;
  }
  buffer_[used_++] = frame;
  return true;
}

void RunLogWriter::flush() {
  out_.write(reinterpret_cast<const char*>(buffer_.data()),
             static_cast<std::streamsize>(used_ * sizeof(TelemetryFrame)));
  used_ = 0;
}

void RunLogWriter::close() {
  flush();
  out_.close();
  if (!out_) throw InputError(file_.string() + ": cannot write the run log");
}

RunLog load_run_log(const std::filesystem::path& file) {
  std::ifstream in = open_file(file, kRunLogBytes);
  // What is no run log may have no end of line for gigabytes.
  std::string line(kLongestHeader, '\0');
  if (!in.getline(line.data(), static_cast<std::streamsize>(line.size())))
    throw InputError(file.string() + ":1: not a run log");
  line.resize(std::strlen(line.c_str()));
  RunLog log{.header = parse_header(line, file.string()), .frames = {}};
  const std::uintmax_t body = std::filesystem::file_size(file) - (line.size() + 1);
  if (body % sizeof(TelemetryFrame) != 0)
    throw InputError(file.string() + ": truncated in frame " +
                     std::to_string(body / sizeof(TelemetryFrame)));
  log.frames.resize(body / sizeof(TelemetryFrame));
  in.read(reinterpret_cast<char*>(log.frames.data()), static_cast<std::streamsize>(body));
  if (!in) throw InputError(file.string() + ": cannot read the run log");
  for (const TelemetryFrame& frame : log.frames)
    if (frame.joint_count != log.header.joint_names.size() || frame.contact_count > kMaxContacts)
      throw InputError(file.string() + ": frame " + std::to_string(&frame - log.frames.data()) +
                       ": joint or contact count differs from the header's");
  return log;
}

}  // namespace clamber
