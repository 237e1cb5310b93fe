// A motor bus whose drives, buses and time are all simulated, in this process: the host's own code
// (CanMotorBus and its hosts) on ModelBuses. One thread; allocates: the simulation does; blocks:
// never. Deterministic.
//
// An exchange is a tick of the map's rate in simulated time: it begins at the next multiple of it
// and its deadline is the one after that.
#pragma once

#include <memory>
#include <vector>

#include "firmware_hal/can_motor_bus.hpp"
#include "firmware_hal/virtual_drives/faulty_port.hpp"
#include "firmware_hal/virtual_drives/model_buses.hpp"

namespace clamber {

class RehearsalBus final : public MotorBus {
 public:
  /// The plant must outlive it. @param observer sees every frame of the hosts
  RehearsalBus(const BusMap& map, JointPlant& plant, FrameObserver* observer = nullptr,
               std::uint64_t seed = 1);
  ~RehearsalBus() override;

  [[nodiscard]] int joint_count() const noexcept override { return bus_->joint_count(); }
  [[nodiscard]] BusStatus enable() override;
  /// `deadline_ns` is of another clock and ignored.
  [[nodiscard]] BusStatus exchange(std::span<const JointCommand> commands,
                                   std::span<JointState> states,
                                   std::int64_t deadline_ns) noexcept override;
  [[nodiscard]] bool set_failure_policy(FailurePolicy policy) noexcept override {
    return bus_->set_failure_policy(policy);
  }
  [[nodiscard]] double failure_policy_delay() const noexcept override {
    return bus_->failure_policy_delay();
  }
  void set_give_up(GiveUp asked) override { bus_->set_give_up(std::move(asked)); }
  void disable() noexcept override { bus_->disable(); }
  [[nodiscard]] BusCounters counters() const noexcept override { return bus_->counters(); }

  [[nodiscard]] CanMotorBus& bus() { return *bus_; }
  [[nodiscard]] VirtualDrives& drives() { return drives_; }
  [[nodiscard]] ModelBuses& buses() { return buses_; }
  [[nodiscard]] FaultyPort& port(std::size_t bus) { return *ports_[bus]; }
  [[nodiscard]] const BusHost& host(std::size_t bus) const { return *hosts_[bus]; }

 private:
  VirtualDrives drives_;
  ModelBuses buses_;
  std::int64_t period_;
  std::int64_t next_ = 0;
  std::vector<std::unique_ptr<FaultyPort>> ports_;
  std::vector<std::unique_ptr<BusHost>> hosts_;
  std::unique_ptr<CanMotorBus> bus_;
};

}  // namespace clamber
