#include "firmware_hal/virtual_drives/faulty_port.hpp"

#include <algorithm>
#include <array>
#include <limits>

namespace clamber {

void FaultyPort::set_fault(const FrameFault& fault) {
  fault_ = fault;
  for (Way* way : {&in_, &out_}) {
    for (Held& held : way->held) held.due = std::numeric_limits<std::int64_t>::min();
    way->remembered = false;
  }
}

bool FaultyPort::concerns(const CanFrame& frame, bool from_drives) {
  const bool direction = from_drives ? fault_.from_drives : fault_.to_drives;
  if (fault_.kind == FrameFaultKind::kNone || !direction) return false;
  if (fault_.id != 0 && frame.id != fault_.id) return false;
  if (frame.extended) return false;  // the marks of lock step are not the protocol's
  return std::uniform_real_distribution<double>(0.0, 1.0)(random_) < fault_.share;
}

void FaultyPort::treat(Way& way, const ReceivedFrame& frame, bool from_drives) {
  if (concerns(frame.frame, from_drives)) {
    ++treated_;
    ill_treat(way, frame);
    return;
  }
  way.ready.push_back(frame);
  if (fault_.kind != FrameFaultKind::kReorder) return;
  for (const Held& held : way.held) way.ready.push_back(held.frame);
  way.held.clear();
}

void FaultyPort::ill_treat(Way& way, ReceivedFrame frame) {
  CanFrame& f = frame.frame;
  switch (fault_.kind) {
    case FrameFaultKind::kNone:
    case FrameFaultKind::kNoRoom:
    case FrameFaultKind::kDrop:
      return;
    case FrameFaultKind::kDuplicate:
      way.ready.push_back(frame);
      break;
    case FrameFaultKind::kReorder:
      way.held.push_back({std::numeric_limits<std::int64_t>::max(), frame});
      return;
    case FrameFaultKind::kDelay:
      way.held.push_back({clock_.now_ns() + fault_.delay_ns, frame});
      return;
    case FrameFaultKind::kStale:
      if (!way.remembered) way.first = f;
      way.remembered = true;
      if (way.first.id == f.id) f.data = way.first.data;
      break;
    case FrameFaultKind::kWrongId:
      f.id ^= 1u << (random_() % 11);
      break;
    case FrameFaultKind::kBadLength:
      if (f.length > 0) --f.length;
      break;
    case FrameFaultKind::kCorrupt:
      for (std::size_t i = 0; i < f.length; ++i) f.data[i] = static_cast<std::uint8_t>(random_());
      break;
  }
  way.ready.push_back(frame);
}

void FaultyPort::release(Way& way) {
  const std::int64_t now = clock_.now_ns();
  while (!way.held.empty() && way.held.front().due <= now) {
    way.ready.push_back(way.held.front().frame);
    way.held.pop_front();
  }
}

SendResult FaultyPort::send(std::span<const CanFrame> frames) noexcept {
  if (fault_.kind == FrameFaultKind::kNoRoom && fault_.to_drives) {
    ++treated_;
    return {0, SendStatus::kFull};
  }
  if (fault_.kind == FrameFaultKind::kNone && out_.held.empty()) return port_.send(frames);
  for (const CanFrame& frame : frames) treat(out_, {frame, clock_.now_ns()}, false);
  pass_on();
  return {frames.size(), SendStatus::kOk};
}

void FaultyPort::pass_on() {
  release(out_);
  std::vector<CanFrame> frames;
  for (const ReceivedFrame& ready : out_.ready) frames.push_back(ready.frame);
  out_.ready.clear();
  if (!frames.empty()) (void)port_.send(frames);
}

void FaultyPort::maintain(std::int64_t now_ns) noexcept {
  port_.maintain(now_ns);
  if (!out_.held.empty()) pass_on();
}

std::size_t FaultyPort::receive(std::span<ReceivedFrame> into) noexcept {
  std::array<ReceivedFrame, 16> taken;
  release(in_);
  for (std::size_t n = taken.size(); n == taken.size();) {
    n = port_.receive(taken);
    for (std::size_t i = 0; i < n; ++i) treat(in_, taken[i], true);
  }
  const std::size_t count = std::min(into.size(), in_.ready.size());
  std::copy_n(in_.ready.begin(), count, into.begin());
  in_.ready.erase(in_.ready.begin(), in_.ready.begin() + static_cast<std::ptrdiff_t>(count));
  return count;
}

bool FaultyPort::discard_unsent() noexcept {
  out_.held.clear();
  out_.ready.clear();
  return port_.discard_unsent();
}

}  // namespace clamber
