// The run log: every tick's frame, byte for byte the same for the same run in simulation.
// Layout: one line of JSON (RunLogHeader), then raw TelemetryFrames, little-endian.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "robot_model/model.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

struct RunLogHeader {
  std::string robot;
  std::string robot_hash;
  std::vector<std::string> joint_names;
  std::vector<std::string> contact_names;
  std::string plan_sha256;  ///< of the plan file that was executed
  double dt = 0.0;          ///< s
};

[[nodiscard]] RunLogHeader make_run_log_header(const RobotModel& robot,
                                               const std::string& plan_sha256, double dt);

/// push(): control thread, allocates and blocks never. The rest: outside the tick, may do both.
class RunLogWriter {
 public:
  /// Buffers up to `capacity` frames between two calls of flush().
  /// @throws InputError when the file cannot be written
  RunLogWriter(std::filesystem::path file, const RunLogHeader& header, std::size_t capacity);

  /// False: no room, the frame was not taken.
  bool push(const TelemetryFrame& frame) noexcept;

  /// More than half of the buffer is in use.
  [[nodiscard]] bool wants_flush() const noexcept { return used_ * 2 > buffer_.size(); }
  void flush();
  /// Flushes and makes sure that everything reached the file. @throws InputError
  void close();
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  std::filesystem::path file_;
  std::ofstream out_;
  std::vector<TelemetryFrame> buffer_;
  std::size_t used_ = 0;
  std::uint64_t dropped_ = 0;
};

struct RunLog {
  RunLogHeader header;
  std::vector<TelemetryFrame> frames;
};

/// Reads a log whole. Any thread; start-up and tools only. @throws InputError
[[nodiscard]] RunLog load_run_log(const std::filesystem::path& file);

}  // namespace clamber
