// The buses of a map in simulated time, virtual drives at one end, the host's ports at the other:
// a rehearsal in one process, with arbitration, bit times, errors, bus-off and full queues.
// One thread; allocates: yes; blocks: never (waiting advances the simulated time). Deterministic.
//
// Every drive is a node of its own on its bus's model, and answers `turnaround` after it has heard.
// At every multiple of the map's tick the drives' time goes on (VirtualDrives::step()). A frame
// that is on the wire at that moment reaches the drives before it: they do not notice.
#pragma once

#include <memory>
#include <vector>

#include "firmware_hal/bus_model/bus_model.hpp"
#include "firmware_hal/frame_port.hpp"
#include "firmware_hal/virtual_drives/virtual_drives.hpp"

namespace clamber {

/// The host's end of one bus.
class ModelPort final : public FramePort {
 public:
  /// @param now the time of all buses; a model alone may be behind it
  ModelPort(BusModel& model, int node, const std::int64_t& now)
      : model_(model), node_(node), now_(now) {}

  SendResult send(std::span<const CanFrame> frames) noexcept override;
  std::size_t receive(std::span<ReceivedFrame> into) noexcept override;
  bool discard_unsent() noexcept override;
  [[nodiscard]] bool has_unsent() noexcept override { return model_.queued(node_) > 0; }
  void maintain(std::int64_t /*now_ns*/) noexcept override {}
  [[nodiscard]] PortState state() const noexcept override;
  [[nodiscard]] const PortCounters& counters() const noexcept override { return counters_; }

  /// Mischief: the interface goes down, or is taken out; and comes back.
  void set_down(bool down);

 private:
  BusModel& model_;
  int node_;
  const std::int64_t& now_;
  bool down_ = false;
  PortCounters counters_;
};

class ModelBuses final : public PortClock {
 public:
  /// @param host how the host's controllers are set
  ModelBuses(const BusMap& map, VirtualDrives& drives, std::uint64_t seed = 1,
             const CanNodeSettings& host = {});

  [[nodiscard]] std::int64_t now_ns() noexcept override { return now_; }
  void wait(std::int64_t until_ns) noexcept override;

  [[nodiscard]] ModelPort& port(std::size_t bus) { return *buses_[bus].port; }
  [[nodiscard]] BusModel& model(std::size_t bus) { return *buses_[bus].model; }
  /// Nodes of a bus's model: the host's is 0, then the drives in the map's order.
  static constexpr int kHostNode = 0;
  [[nodiscard]] static int drive_node(std::size_t drive) { return static_cast<int>(drive) + 1; }

 private:
  struct Line {
    std::unique_ptr<BusModel> model;
    std::unique_ptr<ModelPort> port;
  };

  [[nodiscard]] std::size_t furthest_behind() const;
  void advance(std::size_t bus, std::int64_t until);
  void hand_over(std::size_t bus);
  void send_outbox(std::size_t bus, std::size_t drive, std::int64_t ready);

  VirtualDrives& drives_;
  std::vector<Line> buses_;
  std::int64_t turnaround_;
  std::int64_t period_;
  std::int64_t next_step_;
  std::int64_t now_ = 0;
};

}  // namespace clamber
