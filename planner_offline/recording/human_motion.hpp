// A recorded human motion after import: what every importer produces and the retargeting reads.
// Start-up only: allocates, never blocks; const after import, then any thread may read it.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace clamber {

/// Segments carry the labels of Xsens MVN (Pelvis, T8, RightUpperArm ...). Every orientation maps
/// the segment's anatomical frame to the world; that frame is x forward, y left, z up when the
/// person stands upright with the arms hanging, so at the N-pose all of them are equal.
/// World: z up, metres; its x and y are the recording's own.
struct HumanMotion {
  struct Frame {
    std::vector<Eigen::Quaterniond> orientation;  ///< per segment, segment to world
    std::vector<Eigen::Vector3d> origin;          ///< per segment, its proximal joint, m
    std::vector<Eigen::Vector3d> point;           ///< per entry of `points`, m
    std::vector<Eigen::Vector3d> angle;  ///< per entry of `joints`, rad, MVN's triple (x, y, z)
  };

  std::string source;       ///< file name it came from
  std::string format;       ///< "MVNX 3", "MVNX 4", "positions (npy)", "positions (csv)", "ASF/AMC"
  bool synthetic = false;   ///< made by a tool, not recorded from a person
  double rate = 0.0;        ///< Hz
  double hip_height = 0.0;  ///< hip centre above the floor when standing, m; 0: not known
  double floor = 0.0;       ///< height of the floor that the person stands on at the start, m
  double heading = 0.0;     ///< yaw of the direction of the climb in the recording's world, rad
  double start_time = 0.0;  ///< of frames.front() in the recording's own clock, s
  std::vector<std::string> segments;  ///< labels of orientation and origin
  std::vector<std::string> points;    ///< labels of recorded joint positions (may be empty)
  std::vector<std::string> joints;    ///< labels of recorded joint angles (may be empty)
  std::vector<Frame> frames;
  std::vector<std::string> warnings;  ///< what the importer had to assume, one sentence each

  [[nodiscard]] std::optional<std::size_t> find_segment(std::string_view label) const;
  [[nodiscard]] std::optional<std::size_t> find_point(std::string_view label) const;
  [[nodiscard]] std::optional<std::size_t> find_joint(std::string_view label) const;
  /// @throws InputError naming the recording and the missing label
  [[nodiscard]] std::size_t segment(std::string_view label) const;
  [[nodiscard]] double duration() const {
    return frames.empty() ? 0.0 : static_cast<double>(frames.size() - 1) / rate;
  }
};

/// The motion sampled at `rate` Hz: rotations by the shortest great arc, positions linearly.
/// Recorded joint angles are dropped (Euler triples must not be interpolated).
[[nodiscard]] HumanMotion resample(const HumanMotion& motion, double rate);

/// Frames first..last (both included).
[[nodiscard]] HumanMotion slice(const HumanMotion& motion, std::size_t first, std::size_t last);

}  // namespace clamber
