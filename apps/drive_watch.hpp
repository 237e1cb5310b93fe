// Asks the drives of a bus map again and again whether they are there and well, for as long as
// nobody commands them: with the drives off the control loop does not. Moves nothing. A thread of
// its own at ordinary priority. Allocates; throws InputError in the constructor.
#pragma once

#include <chrono>
#include <mutex>
#include <thread>
#include <vector>

#include "apps/bus_listener.hpp"
#include "apps/service_health.hpp"

namespace clamber {

class DriveWatch {
 public:
  /// Has asked once when it returns.
  explicit DriveWatch(BusMap map);
  DriveWatch(const DriveWatch&) = delete;
  DriveWatch& operator=(const DriveWatch&) = delete;

  /// From its return on nothing is sent: "be off" must not meet a drive that is being switched on.
  /// Any thread; blocks for a millisecond.
  void fall_silent();
  /// Any thread. A drive is heard if it has answered one of the last three questions.
  [[nodiscard]] DriveHealth seen() const;

 private:
  using Clock = std::chrono::steady_clock;

  struct Drive {
    std::size_t bus = 0;
    std::size_t place = 0;     ///< on its bus
    std::uint64_t answer = 0;  ///< what had come at the last look
    int unanswered = 0;        ///< questions in a row
  };

  void watch(const std::stop_token& stop);
  /// Asks, unless somebody else does, and listens.
  void go_round();
  void ask();
  void look();
  [[nodiscard]] std::uint64_t answer_of(const Drive& drive) const;
  /// Empty: none.
  [[nodiscard]] std::string error_of(const Drive& drive) const;

  BusMap map_;
  BusListener listener_;
  std::vector<Drive> drives_;
  std::uint64_t commands_ = 0;  ///< of others, at the last look
  mutable std::mutex lock_;
  bool silent_ = false;
  DriveHealth seen_;
  Clock::time_point seen_at_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace clamber
