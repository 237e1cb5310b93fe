// Where the control thread hands over what telemetry shows, and the memory that it lies in until
// the publisher, in this process or another, has taken it. TelemetryMemory: start-up, allocates,
// throws. TelemetryPort: one thread; allocates: never; blocks: never.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "telemetry/event.hpp"
#include "telemetry/frame.hpp"
#include "telemetry/ring.hpp"

namespace clamber {

/// How the loop kept its time and the buses answered, up to a frame's tick. Of the wall clock: it
/// travels beside the frame, never in the run log.
struct LoopRecord {
  // Of the tick before: a tick's own end is not known while its frame is handed over.
  std::int64_t wakeup_ns = 0;    ///< start after the grid point
  std::int64_t tick_ns = 0;      ///< controller, log and telemetry
  std::int64_t exchange_ns = 0;  ///< bus, with the wait for the replies
  // Since the start.
  std::uint64_t overruns = 0;  ///< ticks that ended after their period
  std::uint64_t skipped = 0;   ///< grid points lost to them
  std::uint64_t exchanges = 0;
  std::uint64_t missing_replies = 0;
  std::uint64_t late_exchanges = 0;
  std::uint64_t bus_status = 0;  ///< the last exchange's BusStatus
};

struct TelemetryRecord {
  TelemetryFrame frame;
  LoopRecord loop;
};

/// Kept by whoever publishes, where it outlives a publisher that dies.
struct PublisherState {
  static constexpr std::size_t kEventsKept = 64;

  std::atomic<std::uint64_t> frames{0};  ///< given to DDS
  std::atomic<std::uint64_t> batches{0};
  std::atomic<std::uint64_t> joint_states{0};
  std::atomic<std::uint64_t> refused{0};  ///< samples that DDS did not take
  std::atomic<std::uint64_t> gaps{0};     ///< ticks that never reached the publisher
  std::atomic<std::uint64_t> next_tick{0};
  std::atomic<std::uint64_t> events{0};  ///< published since the start, so the next one's sequence
  std::atomic<std::uint64_t> starts{0};  ///< of a process of its own that joined DDS
  std::atomic<std::uint64_t> restarts{0};    ///< attempts after a death, counted by who starts it
  std::atomic<std::uint64_t> hangs{0};       ///< of those, of one that stood still and was killed
  std::atomic<std::uint64_t> announced{0};   ///< of the restarts, that an event has told of
  std::atomic<std::int64_t> start_stamp{0};  ///< ns since 1970 of tick 0; 0: not known yet
  std::atomic<std::uint64_t> rounds{0};      ///< looks at the rings: its pulse
  std::atomic<std::uint64_t> watches{0};     ///< looks at a process of its own: somebody cares
  std::array<std::atomic<std::uint64_t>, 4> numbers{};  ///< samples so far, of the slower topics
  std::array<TelemetryEvent, kEventsKept> kept;  ///< the last events, at sequence % kEventsKept
};

/// Lies in memory that may be shared between processes.
struct TelemetryBlock {
  static constexpr std::uint64_t kLayout = 0x434c4d4254454c31;  // "CLMBTEL1"
  static constexpr std::size_t kRecords = 4096;                 // 4 s of ticks
  static constexpr std::size_t kEvents = 256;

  std::uint64_t layout = kLayout;
  std::uint64_t bytes = 0;
  RingPositions record_positions;
  RingPositions event_positions;
  PublisherState publisher;
  std::array<TelemetryEvent, kEvents> events;
  std::array<TelemetryRecord, kRecords> records;
};

/// Owns a block. Every page of it is written here, so that the first lap of the tick meets no
/// fault.
class TelemetryMemory {
 public:
  enum class Kind : std::uint8_t { kPrivate, kShared };

  /// @throws std::runtime_error when the system has no memory to give
  explicit TelemetryMemory(Kind kind = Kind::kPrivate);
  /// What another process made and handed over as an open file.
  /// @throws std::runtime_error when the file is not a block of this layout
  explicit TelemetryMemory(int file);
  ~TelemetryMemory();
  TelemetryMemory(const TelemetryMemory&) = delete;
  TelemetryMemory& operator=(const TelemetryMemory&) = delete;

  [[nodiscard]] TelemetryBlock& block() noexcept { return *block_; }
  [[nodiscard]] const TelemetryBlock& block() const noexcept { return *block_; }
  /// For another process; -1: private. It has no name anywhere, so nothing stays after a crash.
  [[nodiscard]] int file() const noexcept { return file_; }

 private:
  void map(int flags);

  int file_ = -1;
  TelemetryBlock* block_ = nullptr;
};

/// The control thread's end. A push that finds no room is counted and lost.
class TelemetryPort {
 public:
  explicit TelemetryPort(TelemetryBlock& block) noexcept
      : records_(block.records, block.record_positions),
        events_(block.events, block.event_positions) {}

  bool push(const TelemetryFrame& frame, const LoopRecord& loop) noexcept {
    TelemetryRecord* slot = records_.claim();
    if (slot == nullptr) return false;
    slot->frame = frame;
    slot->loop = loop;
    records_.commit();
    return true;
  }
  bool push(const TelemetryEvent& event) noexcept {
    TelemetryEvent* slot = events_.claim();
    if (slot == nullptr) return false;
    *slot = event;
    events_.commit();
    return true;
  }

 private:
  RingProducer<TelemetryRecord> records_;
  RingProducer<TelemetryEvent> events_;
};

}  // namespace clamber
