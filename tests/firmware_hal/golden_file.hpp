// Reads the golden vectors beside the tests: lines of blank-separated words, '#' begins a comment.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "firmware_hal/can_frame.hpp"

namespace clamber::test {

inline std::vector<std::vector<std::string>> golden_lines(const std::string& name) {
  std::ifstream in(std::string(CLAMBER_SOURCE_DIR) + "/tests/firmware_hal/golden/" + name);
  EXPECT_TRUE(in.good()) << name;
  std::vector<std::vector<std::string>> lines;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line.substr(0, line.find(" #")));
    std::vector<std::string> row;
    for (std::string word; words >> word;) row.push_back(word);
    if (!row.empty() && row[0][0] != '#') lines.push_back(row);
  }
  return lines;
}

/// "8A3D99" -> bytes; "-" -> none.
inline std::vector<std::uint8_t> bytes_of(const std::string& hex) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; hex != "-" && i + 1 < hex.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(hex.substr(i, 2), nullptr, 16)));
  return bytes;
}

inline std::string hex_of(const CanFrame& frame) {
  std::string text;
  for (const std::uint8_t byte : frame.payload()) {
    char digits[3];
    std::snprintf(digits, sizeof digits, "%02X", byte);
    text += digits;
  }
  return text.empty() ? "-" : text;
}

}  // namespace clamber::test
