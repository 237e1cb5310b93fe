// The shipped robot and bus maps, and maps made from them by a replacement in their text.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "firmware_hal/bus_map.hpp"
#include "robot_model/loader.hpp"

namespace clamber::test {

inline const std::filesystem::path kSource = CLAMBER_SOURCE_DIR;

inline const RobotModel& coman() {
  static const RobotModel robot = load_robot(kSource / "configs/robots/coman/robot.yaml");
  return robot;
}

inline std::string file_text(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline BusMap shipped_map(const std::string& name) {
  return load_bus_map(kSource / "configs/hal" / name, coman());
}

/// The text of a shipped map with every `from` replaced by `to`; fails when there is none.
inline std::string edited(const std::string& name, const std::string& from, const std::string& to) {
  std::string text = file_text(kSource / "configs/hal" / name);
  std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  for (; at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

}  // namespace clamber::test
