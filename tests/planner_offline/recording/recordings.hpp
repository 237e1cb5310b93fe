// Where the recordings are that the tests read, and made-up ones.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "planner_offline/recording/human_motion.hpp"
#include "tools/climb_choreography.hpp"
#include "tools/mvnx_writer.hpp"

namespace clamber {

/// Real recordings are not part of the project: the tests that need them skip without.
inline std::filesystem::path recordings_folder() {
  if (const char* folder = std::getenv("CLAMBER_RECORDINGS")) return folder;
  return std::filesystem::path(CLAMBER_SOURCE_DIR) / ".." / "shared" / "recordings";
}

inline std::filesystem::path demonstration_file() {
  return std::filesystem::path(CLAMBER_SOURCE_DIR) / "configs" / "recordings" /
         "climb_table_synthetic.mvnx";
}

#define CLAMBER_NEEDS_RECORDING(file)                            \
  if (!std::filesystem::exists(file)) {                          \
    GTEST_SKIP() << "skipped: no recordings (" << (file) << ")"; \
  }

/// The made-up climb in short: 3 frames a second.
inline std::string small_mvnx() {
  const tools::ClimbChoreography climb({});
  std::vector<tools::Figure> figures;
  for (int i = 0; i <= 66; ++i) figures.push_back(climb.at(i / 3.0));
  return tools::write_mvnx(climb.skeleton(), figures, 3, "for a test");
}

inline double degrees(double radians) { return radians * 180.0 / 3.14159265358979323846; }

/// Angle between two orientations, deg.
inline double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return degrees(a.angularDistance(b));
}

}  // namespace clamber
