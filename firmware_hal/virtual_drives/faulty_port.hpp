// A port that ill-treats frames on their way, in either direction: for rehearsing a bad bus.
// One thread; allocates: yes; blocks: never. Deterministic for a seed and the frames that pass.
#pragma once

#include <deque>
#include <random>
#include <vector>

#include "firmware_hal/frame_port.hpp"

namespace clamber {

enum class FrameFaultKind : std::uint8_t {
  kNone,
  kDrop,
  kDuplicate,
  kReorder,    ///< goes behind the next frame
  kDelay,      ///< by FrameFault::delay_ns
  kStale,      ///< with the content of the first one that passed, whatever it should say
  kWrongId,    ///< with one bit of the id changed
  kBadLength,  ///< a byte short
  kCorrupt,    ///< with random content
  kNoRoom,     ///< the interface takes nothing (ENOBUFS): of frames to the drives only
};

struct FrameFault {
  FrameFaultKind kind = FrameFaultKind::kNone;
  double share = 1.0;       ///< of the frames concerned
  bool from_drives = true;  ///< directions concerned
  bool to_drives = false;
  std::uint32_t id = 0;       ///< the one concerned; 0: all data frames
  std::int64_t delay_ns = 0;  ///< kDelay
};

class FaultyPort final : public FramePort {
 public:
  /// Port and clock must outlive it.
  FaultyPort(FramePort& port, PortClock& clock, std::uint64_t seed)
      : port_(port), clock_(clock), random_(seed) {}

  /// From now on; replaces the fault before it. What that one has held back passes.
  void set_fault(const FrameFault& fault);
  [[nodiscard]] std::uint64_t treated() const { return treated_; }

  SendResult send(std::span<const CanFrame> frames) noexcept override;
  std::size_t receive(std::span<ReceivedFrame> into) noexcept override;
  bool discard_unsent() noexcept override;
  [[nodiscard]] bool has_unsent() noexcept override { return port_.has_unsent(); }
  void maintain(std::int64_t now_ns) noexcept override;
  [[nodiscard]] PortState state() const noexcept override { return port_.state(); }
  [[nodiscard]] const PortCounters& counters() const noexcept override { return port_.counters(); }

 private:
  struct Held {
    std::int64_t due = 0;  ///< ns; kDelay
    ReceivedFrame frame;
  };
  struct Way {
    std::deque<Held> held;             ///< delayed, or waiting for the next frame
    std::vector<ReceivedFrame> ready;  ///< treated
    bool remembered = false;
    CanFrame first;  ///< kStale
  };

  [[nodiscard]] bool concerns(const CanFrame& frame, bool from_drives);
  void treat(Way& way, const ReceivedFrame& frame, bool from_drives);
  void ill_treat(Way& way, ReceivedFrame frame);
  void release(Way& way);
  void pass_on();

  FramePort& port_;
  PortClock& clock_;
  std::mt19937_64 random_;
  FrameFault fault_;
  Way in_;
  Way out_;
  std::uint64_t treated_ = 0;
};

}  // namespace clamber
