// A finished run to read again: a run log or an MCAP recording, told apart by their first bytes.
// One thread; allocates; reads files; throws InputError.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "apps/options.hpp"
#include "recording/run_description.hpp"
#include "recording/run_file.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

/// Robot and scenario for what a run log does not carry; what is not given is taken from the
/// summary.json beside the log, else the shipped ones.
struct RunSourceOptions {
  std::optional<std::string> robot;
  std::optional<std::string> scenario;
};
void add_run_source_options(CLI::App& command, RunSourceOptions& options);

struct RunSource {
  RunDescription run;
  std::optional<RobotModel> model;            ///< nothing: the robot is known by name only
  std::function<bool(TelemetryFrame&)> next;  ///< false after the last frame
  std::function<RunNotes()> notes;            ///< what came with the frames since the last call
  std::function<bool()> cut;                  ///< after the last frame: the end is missing
};
[[nodiscard]] RunSource open_run(const std::filesystem::path& file,
                                 const RunSourceOptions& options);

struct CopiedRun {
  std::size_t frames = 0;
  double end = 0.0;  ///< s, of the last frame
};
/// All of it, and closes the file.
CopiedRun copy_run(const RunSource& source, RunFile& to);

}  // namespace clamber
