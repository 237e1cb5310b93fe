#include "apps/timing_report.hpp"

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

double microseconds(std::int64_t ns) { return 1e-3 * static_cast<double>(ns); }

template <typename... Values>
std::string line(const char* format, Values... values) {
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

std::string row(const char* name, const LatencyHistogram& times) {
  return line("  %-9s %9.1f %9.1f %9.1f %9.1f\n", name, microseconds(times.percentile(0.5)),
              microseconds(times.percentile(0.99)), microseconds(times.percentile(0.999)),
              microseconds(times.max()));
}

Json to_json(const LatencyHistogram& times) {
  const auto seconds = [](std::int64_t ns) { return 1e-9 * static_cast<double>(ns); };
  return {{"count", times.count()},
          {"mean", 1e-9 * times.mean()},
          {"p50", seconds(times.percentile(0.5))},
          {"p99", seconds(times.percentile(0.99))},
          {"p99.9", seconds(times.percentile(0.999))},
          {"max", seconds(times.max())}};
}

std::string describe(const GuardReport& guards) {
  if (!guards.malloc && !guards.syscalls && !guards.faults) return "";
  std::string out = "guards:      ";
  if (guards.malloc)
    out += line("%llu heap calls, ", static_cast<unsigned long long>(guards.malloc_calls));
  if (guards.faults)
    out += line("%llu page faults (%llu in the warm-up), ",
                static_cast<unsigned long long>(guards.page_faults),
                static_cast<unsigned long long>(guards.warm_up_faults));
  if (guards.syscalls) out += "system calls from the list only, ";
  return out + line("in %llu ticks of the controller%s\n",
                    static_cast<unsigned long long>(guards.ticks),
                    guards.exchange ? " and the bus" : "");
}

}  // namespace

std::string describe_timing(const ExecutorReport& report) {
  const Timing& timing = report.timing;
  if (timing.wakeup.count() == 0) return "";
  std::string out;
  for (const std::string& what : report.refused) out += "note: not in real time: " + what + '\n';
  out += "late:        " + std::to_string(report.overruns) + " ticks, " +
         std::to_string(report.skipped) + " grid points lost\n";
  out += "timing (us):       p50       p99     p99.9       max\n" + row("wake-up", timing.wakeup) +
         row("tick", timing.tick) + row("exchange", timing.exchange);
  if (report.log_dropped > 0)
    out +=
        "note: the log had no room for the last " + std::to_string(report.log_dropped) + " ticks\n";
  return out + describe(report.guards);
}

Json to_json(const ExecutorReport& report) {
  Json json{{"status", to_string(report.status)},
            {"fault", to_string(report.fault)},
            {"ticks", report.ticks},
            {"duration_s", report.duration},
            {"wall_time_s", report.wall_time},
            {"log_dropped", report.log_dropped}};
  if (report.timing.wakeup.count() == 0) return json;
  json["overruns"] = report.overruns;
  json["skipped_ticks"] = report.skipped;
  json["not_granted"] = report.refused;
  json["timing_s"] = {{"wakeup", to_json(report.timing.wakeup)},
                      {"tick", to_json(report.timing.tick)},
                      {"exchange", to_json(report.timing.exchange)}};
  const GuardReport& guards = report.guards;
  json["guards"] = {{"ticks", guards.ticks}, {"with_exchange", guards.exchange}};
  if (guards.malloc) json["guards"]["heap_calls"] = guards.malloc_calls;
  if (guards.syscalls) json["guards"]["system_calls"] = "listed ones only";
  if (guards.faults) {
    json["guards"]["page_faults"] = guards.page_faults;
    json["guards"]["warm_up_faults"] = guards.warm_up_faults;
  }
  return json;
}

}  // namespace clamber
