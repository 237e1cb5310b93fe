#include "firmware_hal/virtual_drives/rehearsal_bus.hpp"

#include <algorithm>
#include <cmath>

#include "firmware_hal/make_host.hpp"

namespace clamber {

RehearsalBus::RehearsalBus(const BusMap& map, JointPlant& plant, FrameObserver* observer,
                           std::uint64_t seed)
    : drives_(map, plant), buses_(map, drives_, seed), period_(std::llround(1e9 / map.rate)) {
  std::vector<CanSegment> segments;
  for (std::size_t b = 0; b < map.buses.size(); ++b) {
    ports_.push_back(std::make_unique<FaultyPort>(buses_.port(b), buses_, seed + 100 + b));
    hosts_.push_back(make_host(map, map.buses[b]));
    segments.push_back({hosts_.back().get(), ports_.back().get()});
  }
  CanBusSettings settings;
  settings.joint_count = map.joint_count;
  settings.tick = 1.0 / map.rate;
  settings.observer = observer;
  bus_ = std::make_unique<CanMotorBus>(settings, buses_, segments);
  drives_.boot();
}

RehearsalBus::~RehearsalBus() = default;

BusStatus RehearsalBus::enable() { return bus_->enable(); }

BusStatus RehearsalBus::exchange(std::span<const JointCommand> commands,
                                 std::span<JointState> states,
                                 std::int64_t /*deadline_ns*/) noexcept {
  const std::int64_t now = buses_.now_ns();
  const std::int64_t grid = (now + period_ - 1) / period_ * period_;
  next_ = std::max(next_ + period_, grid);
  while (buses_.now_ns() < next_) buses_.wait(next_);
  return bus_->exchange(commands, states, next_ + period_);
}

}  // namespace clamber
