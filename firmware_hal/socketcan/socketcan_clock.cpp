#include "firmware_hal/socketcan/socketcan_clock.hpp"

#include <sched.h>
#include <time.h>

#include <algorithm>

namespace clamber {
namespace {

constexpr std::int64_t kNanoseconds = 1'000'000'000;

}  // namespace

SocketCanClock::SocketCanClock(std::vector<SocketCanPort*> ports)
    : ports_(std::move(ports)), polled_(ports_.size()) {}

std::int64_t SocketCanClock::now_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<std::int64_t>(t.tv_sec) * kNanoseconds + t.tv_nsec;
}

int SocketCanClock::poll(std::span<pollfd> polled, std::int64_t until_ns) noexcept {
  const std::int64_t left = std::max<std::int64_t>(0, until_ns - now_ns());
  const timespec timeout{.tv_sec = static_cast<time_t>(left / kNanoseconds),
                         .tv_nsec = static_cast<long>(left % kNanoseconds)};
  return ppoll(polled.data(), polled.size(), &timeout, nullptr);
}

void SocketCanClock::wait(std::int64_t until_ns) noexcept {
  for (std::size_t i = 0; i < ports_.size(); ++i)
    polled_[i] = {ports_[i]->descriptor(), POLLIN, 0};  // poll() passes over negative ones
  if (poll(polled_, until_ns) < 0) return;
  for (std::size_t i = 0; i < ports_.size(); ++i)
    if (polled_[i].revents == 0) ports_[i]->nothing_to_receive();
}

void SocketCanClock::wait_for(FramePort& port, std::int64_t until_ns) noexcept {
  for (SocketCanPort* candidate : ports_) {
    if (candidate != &port) continue;
    pollfd polled{candidate->descriptor(), POLLIN, 0};
    (void)poll({&polled, 1}, until_ns);
    return;
  }
  wait(until_ns);
}

bool stay_on_this_processor() noexcept {
  const int processor = sched_getcpu();
  if (processor < 0) return false;
  cpu_set_t only;
  CPU_ZERO(&only);
  CPU_SET(static_cast<std::size_t>(processor), &only);
  return sched_setaffinity(0, sizeof only, &only) == 0;
}

}  // namespace clamber
