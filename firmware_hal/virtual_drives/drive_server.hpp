// Serves virtual drives on the ports of their buses: in lock step with the host (lock_step.hpp) or
// by the clock. One thread; allocates: yes; blocks: serve() until its time is over.
//
// In lock step drives answer a command with what their sensors read before the tick passes, as real
// drives do, whose command and answer are a fraction of a tick apart: the controller sees a state
// that is a tick old. "Done" goes out before the plant moves, so that host and plant work at the
// same time and nothing depends on who is faster.
// When the host has been silent for `host_patience`, time passes by the clock until it is back, so
// that the drives' own watchdogs come to act.
#pragma once

#include <span>
#include <vector>

#include "firmware_hal/frame_port.hpp"
#include "firmware_hal/virtual_drives/virtual_drives.hpp"

namespace clamber {

struct DriveServerSettings {
  bool lock_step = true;
  std::int64_t period_ns = 1'000'000;        ///< a tick by the clock
  std::int64_t host_patience = 500'000'000;  ///< ns, lock step: longer silence is a host gone
};

struct ServedBus {
  std::uint64_t received = 0;
  std::uint64_t sent = 0;
  std::uint64_t lost = 0;  ///< frames that the port did not take
};

class DriveServer {
 public:
  /// Drives, clock and ports (one per bus of the drives) must outlive it.
  DriveServer(VirtualDrives& drives, PortClock& clock, std::span<FramePort* const> ports,
              const DriveServerSettings& settings);

  /// Announces the drives that do so when power comes on.
  void boot();
  /// Serves until one tick has passed or the clock says `until_ns`. @return a tick has passed
  bool serve(std::int64_t until_ns);

  /// The host has not been heard for host_patience, or never.
  [[nodiscard]] bool host_silent() const { return host_silent_; }
  [[nodiscard]] const ServedBus& bus(std::size_t i) const { return lines_[i].counters; }
  /// Ticks by the clock that were given up because the simulation was late.
  [[nodiscard]] std::uint64_t skipped() const { return skipped_; }

 private:
  struct Line {
    FramePort* port = nullptr;
    std::vector<CanFrame> unsent;
    std::int64_t marked = -1;  ///< lock step: the last tick of which all frames are here
    ServedBus counters;
  };

  void take_frames(std::size_t bus, std::int64_t now);
  void take_mark(Line& line, std::uint32_t tick);
  void flush(std::size_t bus);
  [[nodiscard]] bool tick_is_in() const;
  /// Lock step: the last bus whose frames of this tick are not all here.
  [[nodiscard]] Line& last_open_line();
  void pass_lock_step();
  bool pass_by_clock(std::int64_t now);

  VirtualDrives& drives_;
  PortClock& clock_;
  DriveServerSettings settings_;
  std::vector<Line> lines_;
  std::vector<ReceivedFrame> inbox_;
  std::int64_t tick_ = 0;  ///< lock step: the last one passed
  bool passed_ = false;    ///< lock step: just now
  std::int64_t next_;      ///< ns, of the clock's grid
  std::int64_t last_heard_;
  bool host_silent_ = true;
  std::uint64_t skipped_ = 0;
};

}  // namespace clamber
