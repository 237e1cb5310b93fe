#include "web/view_rows.hpp"

#include <algorithm>
#include <cmath>

#include "report/image.hpp"

namespace clamber {
namespace {

constexpr double kPeriod = 0.02;   // s
constexpr std::size_t kState = 6;  // time, plan time, phase, mode, fault, its joint
constexpr std::size_t kBase = 7;   // position, orientation w x y z

}  // namespace

ViewRows::ViewRows(std::size_t joints, std::size_t contacts)
    : joints_(joints), contacts_(contacts), row_(kState + kBase + 3 * joints + 2 * contacts) {}

std::string ViewRows::layout() const {
  const std::string joints = std::to_string(joints_);
  const std::string contacts = std::to_string(contacts_);
  return R"([["time",1],["plan_time",1],["phase",1],["mode",1],["fault",1],["fault_joint",1],["base",7],["q",)" +
         joints + R"(],["tau_low",)" + joints + R"(],["tau_high",)" + joints +
         R"(],["force_obstacle",)" + contacts + R"(],["force_floor",)" + contacts + "]]";
}

std::span<const float> ViewRows::add(const TelemetryFrame& frame) {
  // A hair more, so that times that are meant to lie on a boundary lie behind it.
  const double period = std::floor(frame.time / kPeriod + 1e-6);
  const bool first = period_ != period;
  const bool completes = first && period_.has_value();
  if (completes) complete_ = row_;
  period_ = period;
  fill(frame, first);
  return completes ? std::span<const float>(complete_) : std::span<const float>();
}

std::span<const float> ViewRows::rest() {
  return period_ ? std::span<const float>(row_) : std::span<const float>();
}

void ViewRows::fill(const TelemetryFrame& frame, bool first) {
  float* out = row_.data();
  const auto put = [&out](double value) { *out++ = static_cast<float>(value); };
  put(frame.time);
  put(frame.plan_time);
  put(frame.phase);
  put(frame.mode);
  put(frame.fault);
  put(frame.fault_joint);
  const bool truth = (frame.flags & kFrameHasTruth) != 0;
  const std::array<double, 3> somewhere{0.0, 0.0, 0.5};
  const std::array<double, 4> upright{1.0, 0.0, 0.0, 0.0};
  for (const double value : truth ? frame.base_position : somewhere) put(value);
  for (const double value : truth ? frame.base_orientation : upright) put(value);
  for (std::size_t j = 0; j < joints_; ++j) put(frame.q[j]);
  for (std::size_t j = 0; j < joints_; ++j, ++out) {
    const auto torque = static_cast<float>(frame.tau_meas[j]);
    out[0] = first ? torque : std::min(out[0], torque);
    out[joints_] = first ? torque : std::max(out[joints_], torque);
  }
  out += joints_;
  for (std::size_t c = 0; c < contacts_; ++c) put(frame.force_obstacle[c]);
  for (std::size_t c = 0; c < contacts_; ++c) put(frame.force_floor[c]);
}

std::string base64_of(std::span<const float> numbers) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(numbers.data());
  return base64(std::vector<std::uint8_t>(bytes, bytes + numbers.size_bytes()));
}

}  // namespace clamber
