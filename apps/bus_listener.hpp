// The interfaces of a bus map, and what passes on them, for those who look on or ask questions that
// move nothing. One thread; allocates; blocks: as long as it is told to listen; throws InputError
// at the start only.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "firmware_hal/bus_map.hpp"
#include "firmware_hal/bus_watch.hpp"
#include "firmware_hal/socketcan/open_ports.hpp"

namespace clamber {

/// What a CANopen node has answered to questions_to().
struct NodeAnswer {
  std::uint32_t device_type = 0;  ///< object 1000h
  std::uint32_t error = 0;        ///< object 1001h, error register
  std::uint64_t answers = 0;      ///< whatever they were
};

class BusListener {
 public:
  /// `map` must outlive it. @throws InputError for an interface that is not fit for its bus
  explicit BusListener(const BusMap& map);

  /// Takes everything until `until`, or until `stop`.
  void listen(std::int64_t until, const std::atomic<bool>* stop = nullptr);
  /// Sends with a pause after each frame, so that no queue of an interface overflows.
  void send(std::size_t bus, const CanFrame& frame);

  [[nodiscard]] std::int64_t now() const { return ports_.clock->now_ns(); }
  [[nodiscard]] std::size_t size() const { return watches_.size(); }
  [[nodiscard]] const BusWatch& watch(std::size_t bus) const { return watches_[bus]; }
  [[nodiscard]] const SocketCanPort& port(std::size_t bus) const { return *ports_.ports[bus]; }
  /// CANopen nodes that have answered.
  [[nodiscard]] const std::map<std::uint8_t, NodeAnswer>& nodes(std::size_t bus) const {
    return nodes_[bus];
  }
  /// Commands to drives of the map that somebody else has sent.
  [[nodiscard]] std::uint64_t commands() const;

 private:
  void note_node(std::size_t bus, const CanFrame& frame);

  const BusMap& map_;
  SocketCanPorts ports_;
  std::vector<BusWatch> watches_;
  std::vector<ReceivedFrame> inbox_;
  std::vector<std::map<std::uint8_t, NodeAnswer>> nodes_;
};

/// Questions that move nothing: drives of mit are told to be off, which on a silent bus they are
/// (and which makes those without a command for it forget an error); CANopen nodes are asked for an
/// object.
[[nodiscard]] std::vector<CanFrame> questions_to(const Bus& bus, std::uint16_t object,
                                                 std::span<const std::uint8_t> nodes);

}  // namespace clamber
