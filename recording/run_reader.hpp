// Reads the frames of an MCAP file that RunRecorder wrote.
// One thread; allocates; blocks on the file; throws InputError.
#pragma once

#include <filesystem>
#include <utility>

#include "recording/mcap_reader.hpp"
#include "recording/run_description.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

class RunReader {
 public:
  /// Reads up to the description. @throws InputError when the file holds none
  explicit RunReader(const std::filesystem::path& file);

  [[nodiscard]] const RunDescription& run() const { return run_; }
  /// False after the last frame. @throws InputError
  bool next(TelemetryFrame& frame);
  /// What stood between the frames since the last call.
  [[nodiscard]] RunNotes take_notes() { return std::exchange(notes_, {}); }
  /// After the last frame: the file was cut, its recorder killed or its disk full.
  [[nodiscard]] bool cut() const { return reader_.cut(); }

 private:
  void take(const McapMessage& message);

  std::filesystem::path file_;
  McapReader reader_;
  RunDescription run_;
  RunNotes notes_;
};

}  // namespace clamber
