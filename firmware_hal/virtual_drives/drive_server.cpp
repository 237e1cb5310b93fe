#include "firmware_hal/virtual_drives/drive_server.hpp"

#include <algorithm>

#include "firmware_hal/lock_step.hpp"

namespace clamber {
namespace {

constexpr std::int64_t kOfferAgain = 100'000;  // ns, where a port had no room
constexpr std::size_t kMostUnsent = 1024;      // frames; beyond them nobody takes any
constexpr std::int64_t kMostLate = 20;         // ticks that are made up for when the clock is ahead

}  // namespace

DriveServer::DriveServer(VirtualDrives& drives, PortClock& clock, std::span<FramePort* const> ports,
                         const DriveServerSettings& settings)
    : drives_(drives),
      clock_(clock),
      settings_(settings),
      inbox_(256),
      next_(clock.now_ns() + settings.period_ns),
      last_heard_(clock.now_ns() - settings.host_patience) {
  for (FramePort* port : ports) lines_.emplace_back().port = port;
}

void DriveServer::boot() {
  drives_.boot();
  for (std::size_t i = 0; i < lines_.size(); ++i) flush(i);
}

bool DriveServer::serve(std::int64_t until_ns) {
  for (;;) {
    const std::int64_t now = clock_.now_ns();
    // Right after a tick the host has not sent anything yet: asking every port would be in vain.
    for (std::size_t i = 0; !passed_ && i < lines_.size(); ++i) {
      take_frames(i, now);
      flush(i);
    }
    passed_ = false;
    if (settings_.lock_step && tick_is_in()) {
      pass_lock_step();
      return true;
    }
    host_silent_ = now - last_heard_ >= settings_.host_patience;
    const bool by_clock = !settings_.lock_step || host_silent_;
    if (by_clock && pass_by_clock(now)) return true;
    if (now >= until_ns) return false;
    const bool unsent = std::any_of(lines_.begin(), lines_.end(),
                                    [](const Line& line) { return !line.unsent.empty(); });
    std::int64_t wake =
        std::min(until_ns, by_clock ? next_ : last_heard_ + settings_.host_patience);
    if (unsent) wake = std::min(wake, now + kOfferAgain);
    // The host sends bus by bus: who waits for the last one is woken once a tick.
    if (settings_.lock_step && !by_clock && !unsent)
      clock_.wait_for(*last_open_line().port, wake);
    else
      clock_.wait(wake);
  }
}

void DriveServer::take_frames(std::size_t bus, std::int64_t now) {
  Line& line = lines_[bus];
  line.port->maintain(now);
  std::size_t count = inbox_.size();
  while (count == inbox_.size()) {
    count = line.port->receive(inbox_);
    for (const ReceivedFrame& received : std::span(inbox_).first(count)) {
      std::uint32_t tick = 0;
      switch (decode_lock_step(received.frame, tick)) {
        case LockStepMark::kSent:
          if (settings_.lock_step) take_mark(line, tick);
          break;
        case LockStepMark::kDone:
          break;
        case LockStepMark::kNone:
          drives_.receive(bus, received.frame);
          ++line.counters.received;
      }
    }
    if (count > 0) last_heard_ = now;
  }
}

/// The handshake and a repeated mark are answered at once; a new tick waits for the other buses.
void DriveServer::take_mark(Line& line, std::uint32_t tick) {
  if (tick == 0) tick_ = 0;
  line.marked = tick;
  if (tick == 0 || tick == tick_)
    line.unsent.push_back(encode_lock_step(LockStepMark::kDone, tick));
}

bool DriveServer::tick_is_in() const {
  return std::all_of(lines_.begin(), lines_.end(), [this](const Line& line) {
    return line.marked > 0 && line.marked != tick_ && line.marked == lines_.front().marked;
  });
}

DriveServer::Line& DriveServer::last_open_line() {
  for (std::size_t i = lines_.size(); i-- > 1;)
    if (lines_[i].marked <= 0 || lines_[i].marked == tick_) return lines_[i];
  return lines_.front();
}

void DriveServer::pass_lock_step() {
  tick_ = lines_.front().marked;
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    drives_.collect(i, lines_[i].unsent);
    lines_[i].unsent.push_back(
        encode_lock_step(LockStepMark::kDone, static_cast<std::uint32_t>(tick_)));
    flush(i);
  }
  drives_.step();
  passed_ = true;
}

bool DriveServer::pass_by_clock(std::int64_t now) {
  if (now < next_) return false;
  // A simulation that has fallen behind does not run after the clock for ever.
  const std::int64_t late = (now - next_) / settings_.period_ns;
  if (late > kMostLate) {
    skipped_ += settings_.lock_step ? 0 : static_cast<std::uint64_t>(late);
    next_ += late * settings_.period_ns;
  }
  next_ += settings_.period_ns;
  drives_.step();
  for (std::size_t i = 0; i < lines_.size(); ++i) flush(i);
  return true;
}

void DriveServer::flush(std::size_t bus) {
  Line& line = lines_[bus];
  // In lock step what a drive says between two ticks belongs to the next one.
  if (!settings_.lock_step || host_silent_) drives_.collect(bus, line.unsent);
  if (line.unsent.empty()) return;
  const SendResult result = line.port->send(line.unsent);
  line.counters.sent += result.sent;
  line.unsent.erase(line.unsent.begin(),
                    line.unsent.begin() + static_cast<std::ptrdiff_t>(result.sent));
  if (result.status == SendStatus::kDown || line.unsent.size() > kMostUnsent) {
    line.counters.lost += line.unsent.size();
    line.unsent.clear();
  }
}

}  // namespace clamber
