#include "apps/doctor/machine_checks.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/statvfs.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "apps/realtime/control_thread.hpp"
#include "robot_model/loader.hpp"
#include "telemetry/frame.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

constexpr double kGoodLatency = 100.0;  // us: a tenth of the period
constexpr double kTick = 1000.0;        // us
constexpr double kHourOfFrames = 3.6e6 * sizeof(TelemetryFrame);

/// The first line of a small file; empty when there is none.
std::string line_of(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

/// "1,3-5" as the kernel writes lists of processors.
std::set<int> parse_processors(const std::string& list) {
  std::set<int> processors;
  std::istringstream parts(list);
  for (std::string part; std::getline(parts, part, ',');) {
    int first = 0;
    int last = 0;
    const int read = std::sscanf(part.c_str(), "%d-%d", &first, &last);
    if (read < 1) continue;
    for (int i = first; i <= (read == 2 ? last : first); ++i) processors.insert(i);
  }
  return processors;
}

std::string join(const std::set<int>& processors) {
  std::string text;
  for (const int i : processors) {
    if (!text.empty()) text += ',';
    text += std::to_string(i);
  }
  return text;
}

std::string gigabytes(double bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f GB", 1e-9 * bytes);
  return text;
}

/// Fast DDS keeps a lock on "<segment>_el" or "_sl" as long as somebody uses the segment.
bool is_dead(const fs::path& lock) {
  const int file = open(lock.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return false;
  const bool taken = flock(file, LOCK_EX | LOCK_NB) == 0;
  close(file);
  return taken;
}

}  // namespace

Finding check_kernel(const MachineRoot& root) {
  const std::string version = line_of(root.path / "proc/version");
  if (line_of(root.path / "sys/kernel/realtime") == "1" ||
      version.find("PREEMPT_RT") != std::string::npos)
    return {"kernel", Verdict::kFine, "PREEMPT_RT", ""};
  return {"kernel", Verdict::kAdvice, "no PREEMPT_RT: a tick's worst lateness has no bound",
          "apt install linux-image-rt-amd64, then reboot into it"};
}

Finding check_clocksource(const MachineRoot& root) {
  const std::string source =
      line_of(root.path / "sys/devices/system/clocksource/clocksource0/current_clocksource");
  if (source.empty()) return {"clocksource", Verdict::kSkipped, "the kernel does not say", ""};
  if (source == "tsc" || source == "arch_sys_counter" || source == "kvm-clock")
    return {"clocksource", Verdict::kFine, source, ""};
  return {"clocksource", Verdict::kAdvice, source + ": reading the time is slow",
          "boot with clocksource=tsc tsc=reliable, if the processor's TSC is stable"};
}

Finding check_governor(const MachineRoot& root) {
  std::set<std::string> governors;
  const fs::path processors = root.path / "sys/devices/system/cpu";
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(processors, none)) {
    const std::string governor = line_of(entry.path() / "cpufreq/scaling_governor");
    if (!governor.empty()) governors.insert(governor);
  }
  if (governors.empty())
    return {"governor", Verdict::kSkipped, "no frequency scaling here (a virtual machine?)", ""};
  if (governors == std::set<std::string>{"performance"})
    return {"governor", Verdict::kFine, "performance", ""};
  governors.erase("performance");
  return {"governor", Verdict::kAdvice, *governors.begin() + ": processors slow down between ticks",
          "cpupower frequency-set -g performance (package linux-cpupower)"};
}

Finding check_isolation(const MachineRoot& root, const RuntimeSettings& settings) {
  const std::set<int> isolated =
      parse_processors(line_of(root.path / "sys/devices/system/cpu/isolated"));
  const std::set<int> online =
      parse_processors(line_of(root.path / "sys/devices/system/cpu/online"));
  const std::set<int> used(settings.processors.begin(), settings.processors.end());
  if (isolated.empty()) {
    const int last = online.empty() ? 1 : *online.rbegin();
    return {"isolation", Verdict::kAdvice, "no processor is kept free for the control thread",
            "boot with isolcpus=managed_irq,domain," + std::to_string(last) +
                " nohz_full=" + std::to_string(last) + " and set processors: [" +
                std::to_string(last) + "] in the runtime file"};
  }
  if (used.empty())
    return {"isolation", Verdict::kAdvice,
            "processors " + join(isolated) + " are isolated, the control thread uses none of them",
            "set processors: [" + join(isolated) + "] in the runtime file"};
  if (!std::includes(isolated.begin(), isolated.end(), used.begin(), used.end()))
    return {"isolation", Verdict::kAdvice,
            "the control thread uses processors " + join(used) + ", isolated are " + join(isolated),
            "make processors in the runtime file and isolcpus= the same"};
  return {"isolation", Verdict::kFine, "control thread on isolated processors " + join(used), ""};
}

Findings check_permissions(const RuntimeSettings& settings) {
  std::vector<std::string> refused;
  RuntimeSettings asked = settings;
  asked.required = false;
  run_in_control_thread(asked, [&](std::vector<std::string> lines) { refused = std::move(lines); });
  if (refused.empty())
    return {{"permissions", Verdict::kFine,
             "priority " + std::to_string(settings.priority) +
                 (settings.lock_memory ? ", locked memory" : "") + " granted",
             ""}};
  Findings findings;
  for (const std::string& line : refused) {
    // "what was refused: how to put it right", the remedy behind the last colon of the sentence.
    const std::size_t colon = line.find(": ", line.find(": ") + 2);
    findings.push_back({"permissions", settings.required ? Verdict::kProblem : Verdict::kAdvice,
                        line.substr(0, colon),
                        colon == std::string::npos ? "" : line.substr(colon + 2)});
  }
  return findings;
}

Finding check_disk(const fs::path& folder) {
  fs::path existing = fs::absolute(folder);
  while (!fs::exists(existing) && existing.has_relative_path()) existing = existing.parent_path();
  struct statvfs answer {};
  if (statvfs(existing.c_str(), &answer) != 0)
    return {"disk", Verdict::kProblem, existing.string() + ": cannot be looked at",
            "give a folder that exists"};
  const double free = static_cast<double>(answer.f_bavail) * static_cast<double>(answer.f_frsize);
  const std::string seen = gigabytes(free) + " free at " + existing.string() +
                           ", an hour of frames takes " + gigabytes(kHourOfFrames);
  if (free > kHourOfFrames) return {"disk", Verdict::kFine, seen, ""};
  return {"disk", free > 0.1 * kHourOfFrames ? Verdict::kAdvice : Verdict::kProblem, seen,
          "delete old logs, or write them elsewhere (-o)"};
}

Finding check_shared_memory(const MachineRoot& root) {
  std::uintmax_t bytes = 0;
  int dead = 0;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(root.path / "dev/shm", none)) {
    const std::string name = entry.path().filename().string();
    const bool lock =
        name.starts_with("fastrtps_") && (name.ends_with("_el") || name.ends_with("_sl"));
    if (!lock || !is_dead(entry.path())) continue;
    ++dead;
    const std::string segment = entry.path().string();
    const std::uintmax_t size = fs::file_size(segment.substr(0, segment.size() - 3), none);
    if (!none) bytes += size;
  }
  if (dead == 0) return {"shared_memory", Verdict::kFine, "no leftovers of dead processes", ""};
  return {"shared_memory", Verdict::kAdvice,
          std::to_string(dead) + " segments of dead DDS processes, " +
              std::to_string(bytes / 1024) + " kB",
          "fastdds shm clean (package fastdds-tools), or remove /dev/shm/fastrtps_* while no DDS "
          "program runs"};
}

Finding judge_cyclictest(const std::string& json) {
  const auto result = nlohmann::json::parse(json, nullptr, false);
  double worst = -1.0;
  if (result.is_object() && result.contains("thread") && result["thread"].is_object())
    for (const auto& thread : result["thread"])
      if (thread.contains("max") && thread["max"].is_number())
        worst = std::max(worst, thread["max"].get<double>());
  if (worst < 0.0)
    return {"latency", Verdict::kProblem, "cyclictest measured nothing",
            "run it by hand: cyclictest -m -Sp90 -i1000 -D10"};
  char seen[96];
  std::snprintf(seen, sizeof seen, "cyclictest: at most %.0f us late", worst);
  if (worst <= kGoodLatency) return {"latency", Verdict::kFine, seen, ""};
  const std::string remedy =
      "PREEMPT_RT, isolated processors, performance governor, no virtual machine";
  return {"latency", worst < kTick ? Verdict::kAdvice : Verdict::kProblem,
          seen + std::string(worst < kTick ? "; good is 100" : ": more than a tick"), remedy};
}

Finding check_latency(double seconds, int priority) {
  if (seconds <= 0.0)
    return {"latency", Verdict::kSkipped, "not measured", "ask for it: --latency 10"};
  char file[] = "/tmp/clamber_cyclictest_XXXXXX";
  const int descriptor = mkstemp(file);
  if (descriptor < 0) throw InputError("/tmp: no file can be made there");
  close(descriptor);
  const std::string command = "cyclictest -m -q -S -p " + std::to_string(std::max(1, priority)) +
                              " -i 1000 -D " + std::to_string(std::max(1L, std::lround(seconds))) +
                              " --json=" + file + " >/dev/null 2>&1";
  // NOLINTNEXTLINE(cert-env33-c): a fixed command with two numbers and our own file in it.
  const int status = std::system(command.c_str());
  std::ifstream in(file);
  const std::string json{std::istreambuf_iterator<char>(in), {}};
  unlink(file);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 127)
    return {"latency", Verdict::kSkipped, "cyclictest is not installed", "apt install rt-tests"};
  if (status != 0)
    return {"latency", Verdict::kAdvice, "cyclictest may not run at a real-time priority",
            "the remedy of 'permissions', then again"};
  return judge_cyclictest(json);
}

}  // namespace clamber
