#include "apps/service_health.hpp"

#include <signal.h>

#include <cerrno>
#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "apps/job_failed.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr auto kLook = std::chrono::milliseconds(100);
constexpr auto kBeat = std::chrono::milliseconds(1000);  // in which something must have gone on

bool alive(int process) { return process > 0 && (kill(process, 0) == 0 || errno == EPERM); }

/// Follows the file from look to look.
class HealthWatch {
 public:
  HealthWatch(const std::string& bundle, int overruns) : bundle_(bundle), allowed_(overruns) {}

  /// Empty: well.
  std::string look(const std::optional<ServiceHealth>& health, Clock::time_point now) {
    const std::string wrong = judge(health);
    if (!wrong.empty()) {
      last_.reset();
      return wrong;
    }
    if (!last_) {
      last_ = first_ = *health;
      moved_ = now;
    }
    if (health->beats > last_->beats && health->pings > last_->pings) {
      last_ = *health;
      moved_ = now;
    }
    if (health->overruns > first_->overruns + static_cast<std::uint64_t>(allowed_)) {
      last_.reset();
      return std::to_string(health->overruns - first_->overruns) + " late ticks";
    }
    return now - moved_ > kBeat ? "its control loop or its watchdog stands still" : "";
  }

 private:
  [[nodiscard]] std::string judge(const std::optional<ServiceHealth>& health) const {
    if (!health) return "no service says how it is";
    if (health->bundle != bundle_) return "the service that runs is of another bundle";
    if (!alive(health->process)) return "the service has ended";
    if (!health->problem.empty()) return health->problem;
    if (!health->ready) return "the service is not ready yet";
    if (health->torque) return "the drives have torque";
    if (health->heard < health->joints)
      return std::to_string(health->joints - health->heard) + " of " +
             std::to_string(health->joints) + " joints are not well: " + health->trouble;
    return "";
  }

  std::string bundle_;
  int allowed_;
  std::optional<ServiceHealth> first_, last_;
  Clock::time_point moved_;
};

}  // namespace

void save_health(const ServiceHealth& health, const fs::path& file) {
  const Json json{
      {"bundle", health.bundle},     {"process", health.process}, {"ready", health.ready},
      {"torque", health.torque},     {"beats", health.beats},     {"pings", health.pings},
      {"overruns", health.overruns}, {"joints", health.joints},   {"heard", health.heard},
      {"problem", health.problem},   {"trouble", health.trouble}};
  const fs::path draft = file.string() + ".new";
  std::ofstream out(draft);
  out << json.dump(1) << '\n';
  out.close();
  std::error_code error;
  if (out) fs::rename(draft, file, error);
  if (!out || error) throw JobFailed(file.string() + ": cannot be written");
}

std::optional<ServiceHealth> load_health(const fs::path& file) {
  try {
    const Json json = Json::parse(read_file(file));
    return ServiceHealth{json.at("bundle"),   json.at("process"), json.at("ready"),
                         json.at("torque"),   json.at("beats"),   json.at("pings"),
                         json.at("overruns"), json.at("joints"),  json.at("heard"),
                         json.at("problem"),  json.at("trouble")};
  } catch (const InputError&) {
    return std::nullopt;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

void await_health(const fs::path& file, const std::string& bundle, const HealthSettings& settings,
                  const std::function<bool()>& interrupted) {
  const auto seconds = [](double s) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s));
  };
  HealthWatch watch(bundle, settings.overruns);
  const auto end = Clock::now() + seconds(settings.timeout);
  std::optional<Clock::time_point> well_since;
  std::string wrong;
  for (auto now = Clock::now(); now < end; now = Clock::now()) {
    if (interrupted && interrupted()) throw JobFailed("interrupted");
    const std::string found = watch.look(load_health(file), now);
    if (found.empty()) {
      if (!well_since) well_since = now;
      if (now - *well_since >= seconds(settings.time)) return;
    } else {
      well_since.reset();
      wrong = found;
    }
    std::this_thread::sleep_for(kLook);
  }
  if (wrong.empty()) wrong = "well, but not for long enough";
  throw JobFailed("not healthy within " + std::to_string(static_cast<int>(settings.timeout)) +
                  " s: " + wrong);
}

}  // namespace clamber
