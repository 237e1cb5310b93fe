#include "telemetry/diagnostics.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "telemetry/wire.hpp"

namespace clamber {
namespace {

using diagnostic_msgs::msg::dds_::DiagnosticStatus_;

enum Level : std::uint8_t { kOk = 0, kWarn = 1, kError = 2 };  // diagnostic_msgs' own numbers

constexpr float kLittleMargin = 0.1F;

class Status {
 public:
  Status(const std::string& robot, const char* name) {
    status_.name(robot + ": " + name);
    status_.hardware_id(robot);
    status_.level(kOk);
    status_.message("ok");
  }
  Status& value(const char* key, const std::string& text) {
    diagnostic_msgs::msg::dds_::KeyValue_ pair;
    pair.key(key);
    pair.value(text);
    status_.values().push_back(pair);
    return *this;
  }
  Status& value(const char* key, std::uint64_t number) {
    return value(key, std::to_string(number));
  }
  Status& value(const char* key, float number) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", static_cast<double>(number));
    return value(key, std::string(text));
  }
  /// The worst that was raised is what the status says.
  Status& raise(bool when, Level level, const std::string& message) {
    if (!when || level <= status_.level()) return *this;
    status_.level(level);
    status_.message(message);
    return *this;
  }
  [[nodiscard]] DiagnosticStatus_ take() { return std::move(status_); }

 private:
  DiagnosticStatus_ status_;
};

std::string name_of(const std::vector<std::string>& names, std::uint32_t index) {
  return index < names.size() ? names[index] : std::to_string(index);
}

DiagnosticStatus_ controller(const std::string& robot, const DiagnosticInputs& in) {
  const TelemetryFrame& frame = in.frame;
  const std::string fault = name_of(in.description.faults, frame.fault);
  const std::string joint = frame.fault_joint < kMaxJoints
                                ? " at " + name_of(in.description.joint_names, frame.fault_joint)
                                : "";
  return Status(robot, "controller")
      .raise(frame.fault != 0, kError, "fault: " + fault + joint)
      .value("mode", name_of(in.description.modes, frame.mode))
      .value("fault", fault + joint)
      .value("phase", std::uint64_t{frame.phase})
      .value("plan time (s)", static_cast<float>(frame.plan_time))
      .take();
}

DiagnosticStatus_ torques(const std::string& robot, const DiagnosticInputs& in) {
  const auto& t = in.torques;
  const std::uint32_t worst = std::min(t.worst_joint(), std::uint32_t{kMaxJoints - 1});
  const float margin = t.margin()[worst];
  return Status(robot, "torques")
      .raise(t.joint_count() > 0 && margin < kLittleMargin, kWarn, "little margin")
      .value("worst joint", name_of(in.description.joint_names, worst))
      .value("margin", margin)
      .value("peak (N m)", t.tau_peak()[worst])
      .take();
}

DiagnosticStatus_ loop(const std::string& robot, const DiagnosticInputs& in) {
  const auto& t = in.timing;
  return Status(robot, "loop")
      .raise(t.overruns() > 0, kWarn, "ticks ended late")
      .value("overruns", t.overruns())
      .value("grid points lost", t.skipped())
      .value("wake-up p99 (us)", t.wakeup().p99())
      .value("wake-up max of the run (us)", t.wakeup().max_run())
      .value("tick p99 (us)", t.computing().p99())
      .take();
}

DiagnosticStatus_ buses(const std::string& robot, const DiagnosticInputs& in) {
  const auto& b = in.bus;
  const float hottest = *std::max_element(b.temperature().begin(), b.temperature().end());
  return Status(robot, "buses")
      .raise(b.missing_replies() > 0, kWarn, "replies missing")
      .raise(b.joint_faults() != 0, kError, "a drive reports a fault")
      .raise(b.status() == 2, kError, "down")
      .value("exchanges", b.exchanges())
      .value("missing replies", b.missing_replies())
      .value("late", b.late())
      .value("oldest state (ticks)",
             std::uint64_t{*std::max_element(b.oldest().begin(), b.oldest().end())})
      .value("hottest drive (degree Celsius)", hottest)
      .take();
}

DiagnosticStatus_ telemetry(const std::string& robot, const DiagnosticInputs& in) {
  const auto& t = in.timing;
  return Status(robot, "telemetry")
      .raise(t.gaps() + t.ring_drops() + t.refused() > 0, kWarn, "frames were lost")
      .raise(t.restarts() > 0, kWarn, "the publisher was restarted")
      .value("frames", t.frames())
      .value("ring drops", t.ring_drops())
      .value("gaps", t.gaps())
      .value("refused", t.refused())
      .value("restarts", t.restarts())
      .value("of those hung", t.hangs())
      .take();
}

}  // namespace

diagnostic_msgs::msg::dds_::DiagnosticArray_ diagnose(const std::string& robot,
                                                      const DiagnosticInputs& inputs,
                                                      std::int64_t nanoseconds) {
  diagnostic_msgs::msg::dds_::DiagnosticArray_ array;
  array.header().stamp(to_stamp(nanoseconds));
  array.status() = {controller(robot, inputs), torques(robot, inputs), loop(robot, inputs),
                    buses(robot, inputs), telemetry(robot, inputs)};
  return array;
}

}  // namespace clamber
