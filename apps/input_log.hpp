// Everything that went into the controller and what came out, tick by tick, with the plan image and
// the settings: enough to run the ticks again and compare every byte (`clamber replay`).
// The file: one line of JSON (settings, names), the plan image, then per tick an InputTick and
// joint_count InputJoints as they lie in memory (little-endian).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "control/controller.hpp"

namespace clamber {

struct InputLogHeader {
  std::string robot;
  std::string robot_hash;
  std::vector<std::string> joint_names;
  std::string plan_sha256;  ///< of what is executed
  ControllerConfig config;
  std::vector<std::byte> image;
};

struct InputTick {
  std::uint64_t tick = 0;
  std::uint32_t requests = 0;  ///< one bit per OperatorCommand
  std::uint32_t skipped_ticks = 0;
  double speed = 1.0;
  std::uint32_t bus_down = 0;
  std::uint32_t crc = 0;  ///< of what stands before it
};
static_assert(std::is_trivially_copyable_v<InputTick> && sizeof(InputTick) == 32);

struct InputJoint {
  JointState state;
  JointCommand command;
  std::uint32_t reserved = 0;
  std::uint32_t crc = 0;  ///< of what stands before it
};
static_assert(std::is_trivially_copyable_v<InputJoint> && sizeof(InputJoint) == 96);

/// before(), after(): control thread, allocate and block never. The rest: outside the tick.
class InputLogWriter {
 public:
  /// Buffers up to `capacity` ticks between two calls of flush().
  /// @throws InputError when the file cannot be written
  InputLogWriter(std::filesystem::path file, const InputLogHeader& header, std::size_t capacity);

  /// What the next tick will be given.
  void before(const Controller& controller, std::span<const JointState> states) noexcept;
  /// What it made of it.
  void after(std::span<const JointCommand> commands) noexcept;

  [[nodiscard]] bool wants_flush() const noexcept { return used_ * 2 > capacity_; }
  void flush();
  /// Flushes and makes sure that everything reached the file. @throws InputError
  void close();
  /// Ticks that found no room: a log with any cannot be replayed beyond the first of them.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  std::filesystem::path file_;
  std::ofstream out_;
  std::size_t joints_;
  std::size_t capacity_;  ///< ticks
  std::size_t used_ = 0;
  std::vector<InputTick> ticks_;
  std::vector<InputJoint> rows_;
  std::uint64_t count_ = 0;
  std::uint64_t dropped_ = 0;
};

struct InputLog {
  InputLogHeader header;
  std::vector<InputTick> ticks;
  std::vector<InputJoint> rows;  ///< joint_count for each tick

  [[nodiscard]] std::span<const InputJoint> joints(std::size_t tick) const {
    return std::span(rows).subspan(tick * header.joint_names.size(), header.joint_names.size());
  }
};

/// Reads a log whole. @throws InputError
[[nodiscard]] InputLog load_input_log(const std::filesystem::path& file);

/// The first place where a replay differs from what was logged.
struct ReplayDifference {
  std::uint64_t tick = 0;
  std::string joint;  ///< empty: the tick as a whole
  std::string what;
};

struct Replay {
  std::uint64_t ticks = 0;  ///< replayed
  SupervisorState end;
  std::optional<ReplayDifference> difference;
};

/// Runs the logged ticks again. @throws InputError when the controller refuses the logged plan
[[nodiscard]] Replay replay(const InputLog& log);

}  // namespace clamber
