// A bus for tests in simulated time: bench drives behind a port with knobs for every trouble.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <vector>

#include "firmware_hal/frame_port.hpp"
#include "firmware_hal/lock_step.hpp"

namespace clamber::test {

class FakeClock final : public PortClock {
 public:
  [[nodiscard]] std::int64_t now_ns() noexcept override { return now; }
  void wait(std::int64_t until_ns) noexcept override {
    std::int64_t next = until_ns;
    for (const auto& arrival : arrivals) next = std::min(next, arrival());
    now = std::max(now, next);
  }

  std::int64_t now = 1'000'000'000;
  std::vector<std::function<std::int64_t()>> arrivals;  ///< time of a port's next frame
};

/// What the drives answer to a frame comes back after `delay`.
class FakePort final : public FramePort {
 public:
  using Drives = std::function<std::vector<CanFrame>(const CanFrame&)>;

  FakePort(FakeClock& clock, Drives drives) : clock_(clock), drives_(std::move(drives)) {
    clock.arrivals.emplace_back([this] {
      for (const ReceivedFrame& frame : inbox)
        if (frame.time_ns > clock_.now) return frame.time_ns;
      return inbox.empty() ? std::int64_t{1} << 62 : clock_.now;
    });
  }

  SendResult send(std::span<const CanFrame> frames) noexcept override {
    SendResult result;
    if (state_now == PortState::kDown) return {0, SendStatus::kDown};
    for (const CanFrame& frame : frames) {
      if (room == 0) {
        ++counters_.refused;
        result.status = SendStatus::kFull;
        break;
      }
      --room;
      ++result.sent;
      sent.push_back(frame);
      if (stuck) {
        unsent.push_back(frame);
        continue;
      }
      deliver(frame);
    }
    return result;
  }
  std::size_t receive(std::span<ReceivedFrame> into) noexcept override {
    std::size_t count = 0;
    while (count < into.size() && !inbox.empty() && inbox.front().time_ns <= clock_.now) {
      into[count++] = inbox.front();
      inbox.pop_front();
    }
    return count;
  }
  bool discard_unsent() noexcept override {
    ++discards;
    if (!discards_work) return unsent.empty();
    unsent.clear();
    return true;
  }
  [[nodiscard]] bool has_unsent() noexcept override { return !unsent.empty(); }
  void maintain(std::int64_t) noexcept override { ++maintained; }
  [[nodiscard]] PortState state() const noexcept override { return state_now; }
  [[nodiscard]] const PortCounters& counters() const noexcept override { return counters_; }

  /// What waited reaches the drives.
  void release() {
    stuck = false;
    for (const CanFrame& frame : std::exchange(unsent, {})) deliver(frame);
  }

  std::int64_t delay = 100'000;
  std::size_t room = 1u << 30;
  bool stuck = false;    ///< nobody acknowledges: frames stay in the queue
  bool partner = false;  ///< answers in lock step
  bool deaf = false;     ///< the drives' answers get lost
  bool discards_work = true;
  PortState state_now = PortState::kActive;
  std::vector<CanFrame> sent;
  std::vector<CanFrame> unsent;
  std::deque<ReceivedFrame> inbox;
  int discards = 0;
  int maintained = 0;

 private:
  void deliver(const CanFrame& frame) {
    std::uint32_t tick = 0;
    if (decode_lock_step(frame, tick) == LockStepMark::kSent) {
      if (partner)
        inbox.push_back({encode_lock_step(LockStepMark::kDone, tick), clock_.now + delay});
      return;
    }
    for (const CanFrame& reply : drives_(frame))
      if (!deaf) inbox.push_back({reply, clock_.now + delay});
  }

  FakeClock& clock_;
  Drives drives_;
  PortCounters counters_;
};

}  // namespace clamber::test
