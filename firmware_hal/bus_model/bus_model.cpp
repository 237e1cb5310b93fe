#include "firmware_hal/bus_model/bus_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace clamber {
namespace {

constexpr int kWarningLimit = 96;
constexpr int kPassiveLimit = 128;
constexpr int kBusOffLimit = 256;
constexpr std::int64_t kSuspendBits = 8;
constexpr std::int64_t kRecessiveBits = 11;
constexpr std::int64_t kRecoverySequences = 128;
constexpr std::uint32_t kBitsAfterAckSlot = 1 + 7 + 3;
constexpr std::int64_t kErrorFrameBits = 6 + 6 + 8 + 3;
constexpr std::int64_t kErrorFrameBitsAlone = 6 + 8 + 3;
constexpr std::uint32_t kFirstBitAfterArbitration = 13;
constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

bool is_passive(int tec, int rec) { return tec >= kPassiveLimit || rec >= kPassiveLimit; }

}  // namespace

int BusModel::add_node(const CanNodeSettings& settings) {
  nodes_.emplace_back().settings = settings;
  return static_cast<int>(nodes_.size()) - 1;
}

bool BusModel::send(int node, const CanFrame& frame, std::int64_t ready_ns) {
  Node& n = at(node);
  const std::size_t queued = n.tx.size() + (n.sending_until > now_ ? 1 : 0);
  if (n.bus_off || queued >= n.settings.tx_queue || !is_valid(frame) || frame.error) {
    ++n.counters.refused;
    return false;
  }
  n.tx.push_back({frame, std::max(ready_ns, now_)});
  return true;
}

std::optional<CanReception> BusModel::receive(int node) {
  Node& n = at(node);
  if (n.rx.empty() || n.rx.front().time_ns > now_) return std::nullopt;
  const CanReception reception = n.rx.front();
  n.rx.pop_front();
  return reception;
}

std::size_t BusModel::purge(int node) {
  Node& n = at(node);
  const std::size_t dropped = n.tx.size();
  n.counters.dropped += dropped;
  n.tx.clear();
  return dropped;
}

void BusModel::disturb(int node, std::uint32_t bit, int count) {
  at(node).disturbed_bit = bit;
  at(node).disturbances = count;
}

void BusModel::set_connected(int node, bool connected) { at(node).connected = connected; }

void BusModel::reset_node(int node) {
  Node& n = at(node);
  const CanNodeSettings settings = n.settings;
  const CanNodeCounters counters = n.counters;
  const bool connected = n.connected;
  n = {};
  n.settings = settings;
  n.counters = counters;
  n.connected = connected;
}

CanState BusModel::state(int node) const {
  const Node& n = at(node);
  if (n.bus_off) return CanState::kBusOff;
  if (is_passive(n.tec, n.rec)) return CanState::kPassive;
  return std::max(n.tec, n.rec) >= kWarningLimit ? CanState::kWarning : CanState::kActive;
}

std::int64_t BusModel::start_of(const Node& node) const {
  if (!online(node) || node.tx.empty()) return kNever;
  std::int64_t ready = node.tx.front().ready;
  if (node.settings.urgent_first)
    for (const Pending& pending : node.tx) ready = std::min(ready, pending.ready);
  return std::max({free_, ready, node.suspended_until});
}

bool BusModel::step(std::int64_t until_ns) {
  recover_nodes(now_);
  std::int64_t start = kNever;
  for (const Node& node : nodes_) start = std::min(start, start_of(node));
  if (start > until_ns) {
    now_ = std::max(now_, until_ns);
    recover_nodes(now_);
    return false;
  }
  recover_nodes(start);
  if (start > free_) count_recessive(free_, start, 0);
  transmit(arbitrate(contenders(start)), start);
  now_ = std::max(now_, free_);
  return true;
}

void BusModel::run_until(std::int64_t until_ns) {
  while (step(until_ns)) {
  }
}

std::vector<int> BusModel::contenders(std::int64_t start) {
  std::vector<int> found;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (start_of(nodes_[i]) > start) continue;
    if (nodes_[i].settings.urgent_first) bring_forward(nodes_[i], start);
    found.push_back(static_cast<int>(i));
  }
  return found;
}

/// Puts the most urgent frame that is ready at the head of the queue, the others in their order.
void BusModel::bring_forward(Node& node, std::int64_t start) {
  auto best = node.tx.end();
  for (auto it = node.tx.begin(); it != node.tx.end(); ++it) {
    if (it->ready > start) continue;
    if (best == node.tx.end() || arbitration_key(it->frame) < arbitration_key(best->frame))
      best = it;
  }
  std::rotate(node.tx.begin(), best, best + 1);
}

std::vector<int> BusModel::arbitrate(const std::vector<int>& contenders) {
  std::uint32_t best = ~0u;
  for (const int i : contenders) best = std::min(best, arbitration_key(at(i).tx.front().frame));
  std::vector<int> senders;
  for (const int i : contenders) {
    Node& node = at(i);
    if (arbitration_key(node.tx.front().frame) == best) {
      senders.push_back(i);
      continue;
    }
    ++node.counters.arbitration_lost;
    if (node.settings.retransmit) continue;
    node.tx.pop_front();
    ++node.counters.dropped;
  }
  return senders;
}

bool BusModel::acknowledged(const std::vector<int>& senders) const {
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    if (online(nodes_[i]) &&
        std::find(senders.begin(), senders.end(), static_cast<int>(i)) == senders.end())
      return true;
  // Nodes that send the same frame at once do not acknowledge each other.
  return false;
}

std::optional<std::uint32_t> BusModel::disturbed_bit(const std::vector<int>& senders,
                                                     std::uint32_t bits) {
  const CanFrame& frame = at(senders.front()).tx.front().frame;
  for (const int i : senders)
    if (!(at(i).tx.front().frame == frame)) return kFirstBitAfterArbitration;
  for (const int i : senders) {
    Node& node = at(i);
    if (node.disturbances == 0) continue;
    --node.disturbances;
    return std::min(node.disturbed_bit, bits - 1);
  }
  if (bit_error_rate_ <= 0.0) return std::nullopt;
  // Number of bits until the first disturbed one: geometric.
  const double uniform = static_cast<double>((random_() >> 11) + 1) * 0x1p-53;
  const double first = std::log(uniform) / std::log1p(-std::min(bit_error_rate_, 1.0 - 1e-9));
  if (first >= bits) return std::nullopt;
  return static_cast<std::uint32_t>(first);
}

/// Time of the first `count` bits of a frame: header, data phase, rest.
std::int64_t BusModel::time_of(const FrameBits& bits, std::uint32_t count) const {
  constexpr std::uint32_t kTail = 1 + 1 + 1 + 7 + 3;  // from the CRC delimiter on
  const std::uint32_t header = bits.data > 0 ? bits.nominal - kTail : bits.nominal;
  const std::uint32_t data = count <= header ? 0 : std::min(count - header, bits.data);
  return static_cast<std::int64_t>(duration_ns({count - data, data, 0}, timing_));
}

void BusModel::transmit(const std::vector<int>& senders, std::int64_t start) {
  const CanFrame frame = at(senders.front()).tx.front().frame;
  const FrameBits bits = exact_bits(frame);
  const std::int64_t nominal = timing_.nominal_ns;
  if (const auto bit = disturbed_bit(senders, bits.total())) {
    const std::int64_t end = start + time_of(bits, *bit + 1) + kErrorFrameBits * nominal;
    fail(senders, false, end);
  } else if (!acknowledged(senders)) {
    const std::int64_t end =
        start + time_of(bits, bits.total() - kBitsAfterAckSlot) + kErrorFrameBitsAlone * nominal;
    fail(senders, true, end);
  } else {
    succeed(senders, frame, start + static_cast<std::int64_t>(duration_ns(bits, timing_)));
  }
  busy_ += free_ - start;
  // End of frame and intermission, or delimiter and intermission: 11 recessive bits either way.
  count_recessive(start, start, 1);
}

void BusModel::succeed(const std::vector<int>& senders, const CanFrame& frame, std::int64_t end) {
  const std::int64_t nominal = timing_.nominal_ns;
  free_ = end;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node& node = nodes_[i];
    if (!online(node)) continue;
    const bool sender =
        std::find(senders.begin(), senders.end(), static_cast<int>(i)) != senders.end();
    if (sender) {
      node.tx.pop_front();
      node.sending_until = end;
      ++node.counters.sent;
      if (is_passive(node.tec, node.rec)) node.suspended_until = end + kSuspendBits * nominal;
      node.tec = std::max(0, node.tec - 1);
      continue;
    }
    // From above the passive limit back to between 119 and 127 (12.1.4.2 h).
    node.rec = node.rec >= kPassiveLimit ? kPassiveLimit - 1 : std::max(0, node.rec - 1);
    if (node.rx.size() >= node.settings.rx_queue) {
      ++node.counters.overruns;
      continue;
    }
    node.rx.push_back({frame, end - 3 * nominal, senders.front()});
    ++node.counters.received;
  }
}

void BusModel::fail(const std::vector<int>& senders, bool acknowledge_missing, std::int64_t end) {
  free_ = end;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node& node = nodes_[i];
    if (!online(node)) continue;
    if (std::find(senders.begin(), senders.end(), static_cast<int>(i)) == senders.end()) {
      node.rec = std::min(node.rec + 1, 255);
      continue;
    }
    ++node.counters.errors;
    const bool passive = is_passive(node.tec, node.rec);
    if (!(acknowledge_missing && passive)) node.tec += 8;
    if (node.tec >= kBusOffLimit) {
      go_bus_off(node);
      continue;
    }
    if (is_passive(node.tec, node.rec))
      node.suspended_until = end + kSuspendBits * std::int64_t{timing_.nominal_ns};
    if (node.settings.retransmit) continue;
    node.tx.pop_front();
    ++node.counters.dropped;
  }
}

void BusModel::go_bus_off(Node& node) {
  node.bus_off = true;
  node.recessive = -1;  // the error delimiter of the frame that led here does not count
  node.counters.dropped += node.tx.size();
  node.tx.clear();
}

void BusModel::count_recessive(std::int64_t from, std::int64_t to, std::int64_t sequences) {
  const std::int64_t idle = (to - from) / (kRecessiveBits * timing_.nominal_ns);
  for (Node& node : nodes_)
    if (node.bus_off) node.recessive += idle + sequences;
}

void BusModel::recover_nodes(std::int64_t now) {
  const std::int64_t idle = now > free_ ? (now - free_) / (kRecessiveBits * timing_.nominal_ns) : 0;
  for (Node& node : nodes_) {
    if (!node.bus_off || !node.settings.recover || node.recessive + idle < kRecoverySequences)
      continue;
    node.bus_off = false;
    node.tec = node.rec = 0;
    node.recessive = 0;
  }
}

}  // namespace clamber
