// Files that a run is written to frame by frame: MCAP, CSV, HDF5.
// One thread; allocates; blocks on the file; throws InputError.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "recording/run_description.hpp"
#include "telemetry/event.hpp"
#include "telemetry/frame.hpp"

namespace clamber {

class RunFile {
 public:
  RunFile() = default;
  virtual ~RunFile() = default;
  RunFile(const RunFile&) = delete;
  RunFile& operator=(const RunFile&) = delete;

  /// Frames in time order, joint and contact counts as described. @throws InputError
  virtual void add(const TelemetryFrame& frame) = 0;
  /// Events in the order of their numbers. A table has no place for them. @throws InputError
  virtual void add(const TelemetryEvent& /*event*/) {}
  /// The robot's URDF, once; likewise.
  virtual void add_urdf(const std::string& /*urdf*/) {}
  /// Makes sure that everything reached the file. @throws InputError
  virtual void close() = 0;
};

/// A comma-separated table with a line of names first: "q.LKneeSag [rad]". Numbers in the shortest
/// form that reads back to the same bits.
[[nodiscard]] std::unique_ptr<RunFile> open_csv(const std::filesystem::path& file,
                                                const RunDescription& run);

/// One data set per field, [frame] or [frame, joint], with its unit as attribute "unit"; names of
/// joints, contacts, modes, faults and phases, torque limits and the robot's name as attributes of
/// the root.
[[nodiscard]] std::unique_ptr<RunFile> open_hdf5(const std::filesystem::path& file,
                                                 const RunDescription& run);

/// As RunRecorder, from time 0. @param model may be null
[[nodiscard]] std::unique_ptr<RunFile> open_mcap(const std::filesystem::path& file,
                                                 const RunDescription& run,
                                                 const RobotModel* model);

}  // namespace clamber
