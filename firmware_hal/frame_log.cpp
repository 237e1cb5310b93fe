#include "firmware_hal/frame_log.hpp"

#include <cmath>

#include "firmware_hal/candump.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr std::size_t kBuffer = 1 << 20;  // bytes: few system calls

}  // namespace

FrameLog::FrameLog(const std::filesystem::path& file, const BusMap& map)
    : file_(file), buffer_(kBuffer), tick_us_(1e6 / map.rate) {
  out_.rdbuf()->pubsetbuf(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
  out_.open(file, std::ios::binary);
  if (!out_) throw InputError(file_.string() + ": cannot write the frame log");
  for (const Bus& bus : map.buses) {
    buses_.push_back({bus.interface, {}, {}});
    buses_.back().sent.reserve(64);
    buses_.back().received.reserve(64);
  }
}

void FrameLog::sent(std::size_t bus, const CanFrame& frame) noexcept {
  buses_[bus].sent.push_back(frame);
}

void FrameLog::received(std::size_t bus, const CanFrame& frame) noexcept {
  buses_[bus].received.push_back(frame);
}

void FrameLog::tick_ended(std::uint64_t tick) noexcept {
  const std::int64_t time = std::llround(static_cast<double>(tick) * tick_us_);
  for (Traffic& bus : buses_) {
    for (std::vector<CanFrame>* frames : {&bus.sent, &bus.received}) {
      for (const CanFrame& frame : *frames)
        out_ << format_candump(time, bus.interface, frame) << '\n';
      frames_ += frames->size();
      frames->clear();
    }
  }
}

void FrameLog::close() {
  out_.close();
  if (!out_) throw InputError(file_.string() + ": cannot write the frame log");
}

}  // namespace clamber
