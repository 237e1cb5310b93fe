// A CAN bus in simulated time with what vcan lacks: arbitration, bit times, error counters,
// bus-off, retransmission, full queues. Deterministic: same calls and seed, same result. One
// thread; allocates: yes; blocks: never. Tests and rehearsals, not the control thread.
//
// Model (ISO 11898-1:2015; what is simplified is said):
// - Nodes whose frame is ready when the bus becomes free start together; the lowest arbitration key
//   wins, losers try again (a node without retransmission drops its frame instead).
// - A frame lasts its exact bits with stuffing (frame_bits.hpp), the payload of an FD frame with
// BRS at
//   the data rate; then 3 bits of intermission. Receivers have it at the end of "end of frame".
// - A disturbed frame ends behind its disturbed bit with 6 bits of error flag, 6 of the others'
// flags,
//   8 of delimiter and 3 of intermission, at the nominal rate: 23 bits (they may be 17 to 23). The
//   transmitter counts 8, receivers count 1 (12.1.4.2 a, c; never the 8 of rule b).
// - Nobody there to acknowledge: the same behind the ACK slot, 17 bits, as no other flags follow.
// An
//   error-passive transmitter does not count it (rule c, exception A), so it never goes bus-off.
// - TEC or REC from 128: error passive, 8 bits of suspended transmission after own frames. TEC from
//   256: bus-off, the queue is lost; back after 128 times 11 recessive bits, if the node recovers.
// - Two nodes that send the same id with different content disturb each other (14th bit).
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <vector>

#include "firmware_hal/bus_model/frame_bits.hpp"

namespace clamber {

enum class CanState : std::uint8_t { kActive, kWarning, kPassive, kBusOff };

struct CanNodeSettings {
  std::size_t tx_queue = 10;   ///< frames, the one being sent included; Linux' default for CAN
  std::size_t rx_queue = 512;  ///< frames
  bool urgent_first = false;   ///< sends the lowest id that is ready (mailboxes), not the oldest
  bool retransmit = true;      ///< false: one attempt per frame, as bgkatz' drives are set
  bool recover = true;         ///< false: bus-off until power is cycled (reset_node), ditto
};

struct CanNodeCounters {
  std::uint64_t sent = 0;
  std::uint64_t received = 0;
  std::uint64_t errors = 0;            ///< own transmissions disturbed or not acknowledged
  std::uint64_t arbitration_lost = 0;  ///< own transmissions that had to wait
  std::uint64_t refused = 0;           ///< send() calls: queue full (ENOBUFS) or bus-off
  std::uint64_t dropped = 0;           ///< queued frames lost: bus-off, purge, one attempt only
  std::uint64_t overruns = 0;          ///< receptions lost: receive queue full
};

struct CanReception {
  CanFrame frame;
  std::int64_t time_ns = 0;
  int sender = 0;
};

class BusModel {
 public:
  explicit BusModel(BitTiming timing, std::uint64_t seed = 1) : timing_(timing), random_(seed) {}

  /// @return the node's number
  int add_node(const CanNodeSettings& settings = {});

  /// Queues a frame that is ready at `ready_ns`, or now if that is over. @return false: refused
  [[nodiscard]] bool send(int node, const CanFrame& frame, std::int64_t ready_ns = 0);
  /// The next frame that the node has by now, oldest first.
  [[nodiscard]] std::optional<CanReception> receive(int node);
  /// Empties the node's transmit queue (e-stop); a frame on the wire is finished. @return dropped
  std::size_t purge(int node);

  /// Lets the next thing happen on the bus if it begins by `until_ns`; time goes to its end.
  /// @return false: nothing begins by then; time is now `until_ns`
  bool step(std::int64_t until_ns);
  void run_until(std::int64_t until_ns);

  // ---- faults
  /// Every transmitted bit is disturbed with this probability.
  void set_bit_error_rate(double rate) { bit_error_rate_ = rate; }
  /// Disturbs the given bit (0: start of frame) of each of the node's next `count` transmissions.
  void disturb(int node, std::uint32_t bit, int count = 1);
  /// A node that is unplugged neither sends, receives nor acknowledges; its queue stays.
  void set_connected(int node, bool connected);
  /// Power cycle: counters and queues empty, error active.
  void reset_node(int node);

  [[nodiscard]] std::int64_t now_ns() const { return now_; }
  [[nodiscard]] CanState state(int node) const;
  /// Frames in the node's transmit queue, the one on the wire not counted.
  [[nodiscard]] std::size_t queued(int node) const { return at(node).tx.size(); }
  /// Frames that receive() would give now.
  [[nodiscard]] std::size_t waiting(int node) const { return at(node).rx.size(); }
  [[nodiscard]] int transmit_errors(int node) const { return at(node).tec; }
  [[nodiscard]] int receive_errors(int node) const { return at(node).rec; }
  [[nodiscard]] const CanNodeCounters& counters(int node) const { return at(node).counters; }
  /// Time in which the bus was not idle (frames, error frames, intermissions).
  [[nodiscard]] std::int64_t busy_ns() const { return busy_; }

 private:
  struct Pending {
    CanFrame frame;
    std::int64_t ready = 0;
  };
  struct Node {
    CanNodeSettings settings;
    std::deque<Pending> tx;
    std::deque<CanReception> rx;
    int tec = 0;
    int rec = 0;
    bool bus_off = false;
    bool connected = true;
    std::int64_t suspended_until = 0;
    std::int64_t sending_until = 0;  ///< its frame is on the wire and takes a place in the queue
    std::int64_t recessive = 0;      ///< sequences of 11 recessive bits seen since bus-off
    std::uint32_t disturbed_bit = 0;
    int disturbances = 0;
    CanNodeCounters counters;
  };

  [[nodiscard]] Node& at(int node) { return nodes_[static_cast<std::size_t>(node)]; }
  [[nodiscard]] const Node& at(int node) const { return nodes_[static_cast<std::size_t>(node)]; }
  [[nodiscard]] static bool online(const Node& node) { return node.connected && !node.bus_off; }
  [[nodiscard]] std::int64_t start_of(const Node& node) const;
  [[nodiscard]] std::vector<int> contenders(std::int64_t start);
  static void bring_forward(Node& node, std::int64_t start);
  [[nodiscard]] std::vector<int> arbitrate(const std::vector<int>& contenders);
  [[nodiscard]] bool acknowledged(const std::vector<int>& senders) const;
  [[nodiscard]] std::optional<std::uint32_t> disturbed_bit(const std::vector<int>& senders,
                                                           std::uint32_t bits);
  [[nodiscard]] std::int64_t time_of(const FrameBits& bits, std::uint32_t count) const;
  void transmit(const std::vector<int>& senders, std::int64_t start);
  void succeed(const std::vector<int>& senders, const CanFrame& frame, std::int64_t end);
  void fail(const std::vector<int>& senders, bool acknowledge_missing, std::int64_t end);
  void count_recessive(std::int64_t from, std::int64_t to, std::int64_t sequences);
  void recover_nodes(std::int64_t now);
  void go_bus_off(Node& node);

  BitTiming timing_;
  std::mt19937_64 random_;
  double bit_error_rate_ = 0.0;
  std::vector<Node> nodes_;
  std::int64_t now_ = 0;
  std::int64_t free_ = 0;  ///< when the next frame may start; idle since then if it is over
  std::int64_t busy_ = 0;
};

}  // namespace clamber
