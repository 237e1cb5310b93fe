// Does a bus map fit on its buses? Worst-case load and response time of every frame of a tick.
// Start-up only: allocates; require_budget() throws InputError.
#pragma once

#include <string>
#include <vector>

#include "firmware_hal/bus_map.hpp"

namespace clamber {

/// A frame that a bus carries over and over.
struct PlannedFrame {
  std::string name;        ///< "RHipSag command"
  std::uint32_t id = 0;    ///< standard id
  std::size_t length = 0;  ///< bytes
  FrameFormat format;
  bool from_host = false;  ///< host frames leave in the order of the list (one queue)
  int trigger = -1;        ///< index of the frame that makes a drive send this one; -1: none
  double period = 0.0;     ///< s
  bool off_beat = false;   ///< never in a tick with the host's heartbeat
};

/// Everything that the protocol sends on this bus: per tick commands and replies (and SYNC), and
/// heartbeats with their own period.
[[nodiscard]] std::vector<PlannedFrame> planned_frames(const BusMap& map, const Bus& bus);

struct FrameBudget {
  PlannedFrame frame;
  FrameBits worst;
  double duration = 0.0;  ///< s, worst case with intermission
  double response = 0.0;  ///< s from the start of the tick (a heartbeat: from its own release)
                          ///< until it has been received, at worst
};

struct BusBudget {
  std::string bus;
  std::string interface;
  std::string format;  ///< "classic 1 Mbit/s", "FD 1/5 Mbit/s"
  std::size_t joints = 0;
  double load = 0.0;      ///< worst-case share of the bus time
  double busy = 0.0;      ///< s of worst-case bus time in a tick in which every frame is due
  double response = 0.0;  ///< s, the worst of the tick's frames
  bool fits = false;      ///< load within max_load and every frame within the tick
  int max_joints = 0;     ///< of this kind that would fit at this rate
  double max_rate = 0.0;  ///< Hz at which these joints would fit
  double fd_load = 0.0;   ///< load if the bus were FD 1/5 Mbit/s; 0: it is FD or its drives are not
  std::vector<FrameBudget> frames;
};

/// Response times assume no errors, a bus that carries only the planned frames, one
/// first-in-first-out queue in the host (SocketCAN) and drives that send the most urgent of their
/// frames first.
[[nodiscard]] std::vector<BusBudget> bus_budgets(const BusMap& map);

/// One line: which bus does not fit, by how much, what would.
[[nodiscard]] std::string explain_refusal(const BusMap& map, const BusBudget& budget);

/// Start-up check. @throws InputError with the numbers when a bus does not fit
void require_budget(const BusMap& map);

}  // namespace clamber
