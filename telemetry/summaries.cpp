#include "telemetry/summaries.hpp"

#include <algorithm>
#include <cmath>

namespace clamber {
namespace {

// A commanded torque is clipped to the limit exactly; what is measured may be off by this share.
constexpr double kSaturated = 0.999;

void keep_larger(double& kept, double torque) noexcept {
  if (std::abs(torque) > std::abs(kept)) kept = torque;
}

}  // namespace

void TorqueSummary::add(const TelemetryFrame& frame) noexcept {
  last_ = frame;
  for (std::size_t j = 0; j < frame.joint_count; ++j) {
    keep_larger(window_[j], frame.tau_meas[j]);
    keep_larger(run_[j], frame.tau_meas[j]);
    const double limit = frame.tau_limit[j];
    const double torque = std::max(std::abs(frame.tau_cmd[j]), std::abs(frame.tau_meas[j]));
    if (limit > 0.0 && torque >= kSaturated * limit) ++saturated_[j];
  }
}

void TorqueSummary::take(msg::dds_::TorqueMargins_& wire) noexcept {
  wire.tick(last_.sequence);
  wire.time(last_.time);
  wire.joint_count(last_.joint_count);
  double least = INFINITY;
  std::uint32_t worst = 0;
  for (std::uint32_t j = 0; j < last_.joint_count; ++j) {
    const double limit = last_.tau_limit[j];
    const double margin = limit > 0.0 ? 1.0 - std::abs(window_[j]) / limit : 1.0;
    if (margin < least) {
      least = margin;
      worst = j;
    }
    wire.tau_limit()[j] = static_cast<float>(limit);
    wire.tau_peak()[j] = static_cast<float>(window_[j]);
    wire.margin()[j] = static_cast<float>(margin);
    wire.tau_peak_run()[j] = static_cast<float>(run_[j]);
    wire.saturated()[j] = static_cast<float>(dt_ * static_cast<double>(saturated_[j]));
    window_[j] = 0.0;
  }
  wire.worst_joint(worst);
}

void TimingSummary::Times::add(std::int64_t ns) {
  const auto us = static_cast<float>(1e-3 * static_cast<double>(ns));
  window.push_back(us);
  max_run = std::max(max_run, us);
}

void TimingSummary::Times::take(msg::dds_::Spread_& wire) {
  std::sort(window.begin(), window.end());
  const auto at = [this](double share) {
    const auto index = static_cast<std::size_t>(share * static_cast<double>(window.size()));
    return window.empty() ? 0.0F : window[std::min(index, window.size() - 1)];
  };
  wire.p50(at(0.5));
  wire.p99(at(0.99));
  wire.max(at(1.0));
  wire.max_run(max_run);
  window.clear();
}

void TimingSummary::add(const TelemetryRecord& record) {
  last_ = record.loop;
  last_tick_ = record.frame.sequence;
  last_time_ = record.frame.time;
  wakeup_.add(record.loop.wakeup_ns);
  tick_.add(record.loop.tick_ns);
  exchange_.add(record.loop.exchange_ns);
}

void TimingSummary::take(msg::dds_::Timing_& wire) {
  wire.tick(last_tick_);
  wire.time(last_time_);
  wakeup_.take(wire.wakeup());
  tick_.take(wire.computing());
  exchange_.take(wire.exchange());
  wire.paced(wire.computing().max_run() > 0.0F ? 1 : 0);
  wire.overruns(last_.overruns);
  wire.skipped(last_.skipped);
}

void BusSummary::add(const TelemetryRecord& record) noexcept {
  last_ = record;
  for (std::size_t j = 0; j < record.frame.joint_count; ++j)
    oldest_[j] = std::max(oldest_[j], record.frame.age[j]);
}

void BusSummary::take(msg::dds_::BusHealth_& wire) noexcept {
  wire.tick(last_.frame.sequence);
  wire.time(last_.frame.time);
  wire.status(static_cast<std::uint32_t>(last_.loop.bus_status));
  wire.exchanges(last_.loop.exchanges);
  wire.missing_replies(last_.loop.missing_replies);
  wire.late(last_.loop.late_exchanges);
  wire.joint_count(last_.frame.joint_count);
  wire.joint_faults(last_.frame.joint_faults);
  for (std::size_t j = 0; j < oldest_.size(); ++j) {
    wire.oldest()[j] = static_cast<std::uint16_t>(std::min(oldest_[j], 65535.0));
    wire.temperature()[j] = static_cast<float>(last_.frame.temperature[j]);
  }
  oldest_.fill(0.0);
}

}  // namespace clamber
