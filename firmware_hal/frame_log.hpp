// Every frame of a run in lock step, in candump's log format and in an order that does not depend
// on who was faster: per tick, per bus of the map, first what the host sent, then what it received.
// Times are those of the ticks. So equal runs give equal files. Allocates, writes a file.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/can_motor_bus.hpp"

namespace clamber {

class FrameLog final : public FrameObserver {
 public:
  /// @throws InputError when the file cannot be written
  FrameLog(const std::filesystem::path& file, const BusMap& map);

  void sent(std::size_t bus, const CanFrame& frame) noexcept override;
  void received(std::size_t bus, const CanFrame& frame) noexcept override;
  void tick_ended(std::uint64_t tick) noexcept override;
  /// Makes sure that everything reached the file. @throws InputError
  void close();
  [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }

 private:
  struct Traffic {
    std::string interface;
    std::vector<CanFrame> sent;
    std::vector<CanFrame> received;
  };

  std::filesystem::path file_;
  std::vector<char> buffer_;  ///< the stream's, so before it
  std::ofstream out_;
  double tick_us_;
  std::vector<Traffic> buses_;
  std::uint64_t frames_ = 0;
};

}  // namespace clamber
