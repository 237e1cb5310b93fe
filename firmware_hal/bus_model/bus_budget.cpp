#include "firmware_hal/bus_model/bus_budget.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

constexpr std::uint32_t kFdDataBitrate = 5'000'000;
constexpr const char* kHostHeartbeat = "host heartbeat";

std::string megabits(std::uint32_t rate) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", 1e-6 * rate);
  return text;
}

std::string format_name(const Bus& bus) {
  if (bus.data_bitrate == 0) return "classic " + megabits(bus.bitrate) + " Mbit/s";
  return "FD " + megabits(bus.bitrate) + "/" + megabits(bus.data_bitrate) + " Mbit/s";
}

void add_mit(const BusMap& map, const Bus& bus, std::vector<PlannedFrame>& frames) {
  const double tick = 1.0 / map.rate;
  for (const JointDrive& drive : bus.drives)
    frames.push_back({drive.name + " command", drive.node, 8, bus.format(), true, -1, tick});
  for (std::size_t i = 0; i < bus.drives.size(); ++i) {
    const JointDrive& drive = bus.drives[i];
    frames.push_back({drive.name + " reply", drive.reply_id,
                      mit_reply_length(drive.motor.mit.reply), bus.format(), false,
                      static_cast<int>(i), tick});
  }
}

void add_cia402(const BusMap& map, const Bus& bus, std::vector<PlannedFrame>& frames) {
  const double tick = 1.0 / map.rate;
  const std::size_t command = bus.mode == Cia402Mode::kCyclicTorque ? 4 : 8;
  frames.push_back({kHostHeartbeat, 0x700u + bus.host_node, 1, {}, true, -1, bus.heartbeat});
  for (const JointDrive& drive : bus.drives)
    frames.push_back({drive.name + " RPDO1", 0x200u + drive.node, command, {}, true, -1, tick});
  frames.push_back({"SYNC", 0x080, 0, {}, true, -1, tick});
  const int sync = static_cast<int>(frames.size()) - 1;
  for (const JointDrive& drive : bus.drives)
    frames.push_back({drive.name + " TPDO1", 0x180u + drive.node, 8, {}, false, sync, tick});
  for (const JointDrive& drive : bus.drives)
    frames.push_back(
        {drive.name + " heartbeat", 0x700u + drive.node, 1, {}, false, -1, bus.heartbeat});
  // One drive at a time: the one whose identifiers wait longest.
  std::uint16_t last = 0;
  for (const JointDrive& drive : bus.drives) last = std::max(last, drive.node);
  frames.push_back({"failure policy", 0x600u + last, 8, {}, true, -1, bus.heartbeat, true});
  const int question = static_cast<int>(frames.size()) - 1;
  frames.push_back(
      {"failure policy, taken", 0x580u + last, 8, {}, false, question, bus.heartbeat, true});
}

double seconds(const FrameBits& bits, const Bus& bus) {
  return 1e-9 * static_cast<double>(duration_ns(bits, bus.timing()));
}

/// Which other frames of a tick can be sent between the release of one frame and its reception.
///
/// Heartbeats count as frames of every tick: their period is many ticks, and what is left of the
/// drives' ones at the end of a tick has the lowest priority in the next.
/// Every frame of a tick is released by it, at most once, and the bus has no backlog at its start
/// when every response stays below the tick: so each other frame delays this one once at most, if
///   - it wins arbitration against it or, in the host's one queue, against one that waits before
///   it,
///   - it stands before it in that queue,
/// and not if it can only come later (a reply to a command behind this one) or was already sent
/// when this one was released (the commands up to the one that a reply answers). Of those that lose
/// against it, one may have just begun (Davis et al. 2007, section 3: blocking).
class Contention {
 public:
  /// @param beat in a tick with the host's heartbeat, or in one without
  Contention(const std::vector<FrameBudget>& all, std::size_t m, bool beat)
      : all_(all), m_(m), beat_(beat) {
    const PlannedFrame& frame = all[m].frame;
    last_id_ = frame.id;
    for (std::size_t k = 0; frame.from_host && k < m; ++k)
      if (all[k].frame.from_host) last_id_ = std::max(last_id_, all[k].frame.id);
  }

  /// s that the frame waits at worst once it is ready.
  [[nodiscard]] double waiting() const {
    double before = 0.0;
    double blocking = 0.0;
    for (std::size_t k = 0; k < all_.size(); ++k) {
      if (k == m_ || !possible(k)) continue;
      const FrameBudget& other = all_[k];
      if (queued_before(k) || other.frame.id <= last_id_)
        before += other.duration;
      else
        blocking = std::max(blocking, other.duration);
    }
    return before + blocking;
  }

 private:
  [[nodiscard]] bool queued_before(std::size_t k) const {
    return all_[m_].frame.from_host && all_[k].frame.from_host && k < m_;
  }
  [[nodiscard]] bool possible(std::size_t k) const {
    const PlannedFrame& frame = all_[m_].frame;
    const PlannedFrame& other = all_[k].frame;
    if (beat_ ? other.off_beat : other.name == kHostHeartbeat) return false;
    if (frame.from_host) {
      if (other.from_host) return k < m_;
      return other.trigger < 0 || static_cast<std::size_t>(other.trigger) < m_;
    }
    return !(other.from_host && frame.trigger >= 0 && k <= static_cast<std::size_t>(frame.trigger));
  }

  const std::vector<FrameBudget>& all_;
  std::size_t m_;
  bool beat_;
  std::uint32_t last_id_ = 0;
};

/// Response of the rare frames, over as many ticks as it takes: all of each tick's frames and all
/// other rare ones go first.
double rare_response(double tick_sum, double rare_sum, double tick) {
  double response = rare_sum;
  for (int i = 0; i < 1000; ++i) {
    const double next = rare_sum + tick_sum * (std::ceil(response / tick) + 1.0);
    if (next <= response) return response;
    response = next;
  }
  return INFINITY;
}

/// Responses of a tick's frames, counted from its start.
std::vector<double> tick_responses(const std::vector<FrameBudget>& frames, double turnaround,
                                   double at_most, bool beat) {
  std::vector<double> responses;
  for (std::size_t m = 0; m < frames.size(); ++m) {
    const int trigger = frames[m].frame.trigger;
    const double ready =
        trigger < 0 ? 0.0 : responses[static_cast<std::size_t>(trigger)] + turnaround;
    responses.push_back(
        std::min(at_most, ready + Contention(frames, m, beat).waiting() + frames[m].duration));
  }
  return responses;
}

void respond(std::vector<FrameBudget>& frames, double turnaround, double tick) {
  double tick_sum = 0.0;
  double rare_sum = 0.0;
  for (const FrameBudget& f : frames) (f.frame.period == tick ? tick_sum : rare_sum) += f.duration;
  // Within a tick the bus idles only while drives prepare replies: once, after the last command.
  const double at_most = tick_sum + rare_sum + turnaround;
  const std::vector<double> with_beat = tick_responses(frames, turnaround, at_most, true);
  const std::vector<double> without = tick_responses(frames, turnaround, at_most, false);
  for (std::size_t m = 0; m < frames.size(); ++m)
    frames[m].response = frames[m].frame.period == tick ? std::max(with_beat[m], without[m])
                                                        : rare_response(tick_sum, rare_sum, tick);
}

BusBudget budget_of(const BusMap& map, const Bus& bus) {
  BusBudget budget;
  budget.bus = bus.name;
  budget.interface = bus.interface;
  budget.format = format_name(bus);
  budget.joints = bus.drives.size();
  double joints = 0.0;  // load that every joint adds, against what the bus needs anyway
  double overhead = 0.0;
  double slow = 0.0;  // load that does not scale with the rate
  const double tick = 1.0 / map.rate;
  for (const PlannedFrame& frame : planned_frames(map, bus)) {
    const FrameBits worst = worst_bits(frame.length, frame.format);
    const double duration = seconds(worst, bus);
    const double load = duration / frame.period;
    const bool shared = frame.from_host && (frame.name == "SYNC" || frame.name == kHostHeartbeat);
    (shared ? overhead : joints) += load;
    if (frame.period != tick) slow += load;
    budget.busy += duration;
    budget.frames.push_back({frame, worst, duration, 0.0});
  }
  respond(budget.frames, map.turnaround, tick);
  budget.load = joints + overhead;
  bool in_time = true;
  for (const FrameBudget& f : budget.frames) {
    if (f.frame.period == tick) budget.response = std::max(budget.response, f.response);
    in_time = in_time && f.response <= f.frame.period;
  }
  budget.fits = budget.load <= map.max_load && in_time;
  const double per_joint = joints / static_cast<double>(bus.drives.size());
  budget.max_joints = static_cast<int>(std::max(0.0, (map.max_load - overhead) / per_joint));
  budget.max_rate = std::max(0.0, map.max_load - slow) / (budget.load - slow) * map.rate;
  return budget;
}

bool can_be_fd(const Bus& bus) {
  return bus.protocol == BusProtocol::kMit && bus.data_bitrate == 0 &&
         std::all_of(bus.drives.begin(), bus.drives.end(),
                     [](const JointDrive& drive) { return drive.motor.mit.fd; });
}

std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f %%", 100.0 * share);
  return text;
}

}  // namespace

std::vector<PlannedFrame> planned_frames(const BusMap& map, const Bus& bus) {
  std::vector<PlannedFrame> frames;
  if (bus.protocol == BusProtocol::kMit)
    add_mit(map, bus, frames);
  else
    add_cia402(map, bus, frames);
  return frames;
}

std::vector<BusBudget> bus_budgets(const BusMap& map) {
  std::vector<BusBudget> budgets;
  for (const Bus& bus : map.buses) {
    budgets.push_back(budget_of(map, bus));
    if (!can_be_fd(bus)) continue;
    Bus fd = bus;
    fd.data_bitrate = std::max(kFdDataBitrate, bus.bitrate);
    budgets.back().fd_load = budget_of(map, fd).load;
  }
  return budgets;
}

std::string explain_refusal(const BusMap& map, const BusBudget& budget) {
  char numbers[200];
  std::snprintf(numbers, sizeof numbers,
                "%zu joints at %g Hz on %s need %s of the bus time at worst (%.0f us of %.0f us), "
                "at most %s is allowed",
                budget.joints, map.rate, budget.format.c_str(), percent(budget.load).c_str(),
                1e6 * budget.busy, 1e6 / map.rate, percent(map.max_load).c_str());
  std::string text = map.file + ": bus '" + budget.bus + "': " + numbers;
  if (budget.load <= map.max_load) {
    std::snprintf(numbers, sizeof numbers,
                  ", and the last frame arrives after up to %.0f us, behind the end of its tick",
                  1e6 * budget.response);
    text += numbers;
  }
  text += ": ";
  if (budget.fd_load > 0.0 && budget.fd_load <= map.max_load)
    text += "use CAN FD (bitrate: 1000000, data_bitrate: 5000000: " + percent(budget.fd_load) +
            "), or ";
  if (budget.max_joints > 0 && static_cast<std::size_t>(budget.max_joints) < budget.joints)
    text += "at most " + std::to_string(budget.max_joints) + " joints per bus, or ";
  std::snprintf(numbers, sizeof numbers, "at most %.0f Hz", std::floor(budget.max_rate));
  return text + numbers;
}

void require_budget(const BusMap& map) {
  for (const BusBudget& budget : bus_budgets(map))
    if (!budget.fits) throw InputError(explain_refusal(map, budget));
}

}  // namespace clamber
