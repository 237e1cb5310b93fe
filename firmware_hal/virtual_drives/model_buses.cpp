#include "firmware_hal/virtual_drives/model_buses.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {

SendResult ModelPort::send(std::span<const CanFrame> frames) noexcept {
  SendResult result;
  if (down_) return {0, SendStatus::kDown};
  for (const CanFrame& frame : frames) {
    if (!model_.send(node_, frame, now_)) {
      ++counters_.refused;
      result.status = SendStatus::kFull;
      return result;
    }
    ++result.sent;
    ++counters_.sent;
  }
  return result;
}

std::size_t ModelPort::receive(std::span<ReceivedFrame> into) noexcept {
  std::size_t count = 0;
  while (count < into.size()) {
    const auto reception = model_.receive(node_);
    if (!reception) break;
    if (down_) continue;
    into[count++] = {reception->frame, reception->time_ns};
    ++counters_.received;
  }
  return count;
}

bool ModelPort::discard_unsent() noexcept {
  counters_.discarded += model_.purge(node_);
  return true;
}

PortState ModelPort::state() const noexcept {
  if (down_) return PortState::kDown;
  switch (model_.state(node_)) {
    case CanState::kActive:
      return PortState::kActive;
    case CanState::kWarning:
      return PortState::kWarning;
    case CanState::kPassive:
      return PortState::kPassive;
    case CanState::kBusOff:
      return PortState::kBusOff;
  }
  return PortState::kActive;
}

void ModelPort::set_down(bool down) {
  if (down == down_) return;
  down_ = down;
  model_.set_connected(node_, !down);
  counters_.losses += down ? 1 : 0;
  counters_.reopened += down ? 0 : 1;
  if (down) model_.reset_node(node_);
}

ModelBuses::ModelBuses(const BusMap& map, VirtualDrives& drives, std::uint64_t seed,
                       const CanNodeSettings& host)
    : drives_(drives),
      turnaround_(std::llround(1e9 * map.turnaround)),
      period_(std::llround(1e9 / map.rate)),
      next_step_(period_) {
  for (std::size_t b = 0; b < map.buses.size(); ++b) {
    Line& line = buses_.emplace_back();
    line.model = std::make_unique<BusModel>(map.buses[b].timing(), seed + b);
    const int node = line.model->add_node(host);
    line.port = std::make_unique<ModelPort>(*line.model, node, now_);
    for (std::size_t i = 0; i < drives.bus(b).size(); ++i)
      (void)line.model->add_node({.urgent_first = true});
  }
}

void ModelBuses::wait(std::int64_t until_ns) noexcept {
  while (now_ < until_ns) {
    const std::int64_t boundary = std::min(until_ns, next_step_);
    const std::size_t behind = furthest_behind();
    now_ = std::max(now_, std::min(boundary, buses_[behind].model->now_ns()));
    if (now_ < boundary) {
      advance(behind, boundary);
      if (buses_[behind].model->waiting(kHostNode) > 0) return;
      continue;
    }
    now_ = boundary;
    if (now_ < next_step_) return;
    next_step_ += period_;
    drives_.step();
    for (std::size_t b = 0; b < buses_.size(); ++b)
      for (std::size_t i = 0; i < drives_.bus(b).size(); ++i) send_outbox(b, i, now_);
  }
}

std::size_t ModelBuses::furthest_behind() const {
  std::size_t behind = 0;
  for (std::size_t b = 1; b < buses_.size(); ++b)
    if (buses_[b].model->now_ns() < buses_[behind].model->now_ns()) behind = b;
  return behind;
}

void ModelBuses::advance(std::size_t bus, std::int64_t until) {
  if (buses_[bus].model->step(until)) hand_over(bus);
}

void ModelBuses::hand_over(std::size_t bus) {
  BusModel& model = *buses_[bus].model;
  for (std::size_t i = 0; i < drives_.bus(bus).size(); ++i) {
    while (const auto reception = model.receive(drive_node(i))) {
      drives_.bus(bus)[i].drive->receive(reception->frame);
      send_outbox(bus, i, reception->time_ns + turnaround_);
    }
  }
}

void ModelBuses::send_outbox(std::size_t bus, std::size_t drive, std::int64_t ready) {
  FrameList& outbox = drives_.bus(bus)[drive].drive->outbox();
  for (const CanFrame& frame : outbox.frames())
    (void)buses_[bus].model->send(drive_node(drive), frame, ready);
  outbox.clear();
}

}  // namespace clamber
