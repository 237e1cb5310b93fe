// Lines of candump's log format (can-utils, `candump -l`): text <-> frame.
// Any thread; parse: no allocation, no exception; format: allocates.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "firmware_hal/can_frame.hpp"

namespace clamber {

struct CandumpLine {
  std::int64_t time_us = 0;    ///< as written, microseconds
  std::string_view interface;  ///< points into the parsed text
  CanFrame frame;
};

/// "(1436509052.249713) can0 044#2A366C2BBA": classic; "##1..": FD with its flags; "#R": remote;
/// ids of three digits are standard, of eight extended or, with bit 29, error frames. A direction
/// at the end (" R", " T") is ignored.
/// @return nullptr, or what is wrong with the line; `line` is then untouched
[[nodiscard]] const char* parse_candump(std::string_view text, CandumpLine& line) noexcept;

/// The line without its end. Reads back to the same frame.
[[nodiscard]] std::string format_candump(std::int64_t time_us, std::string_view interface,
                                         const CanFrame& frame);

}  // namespace clamber
