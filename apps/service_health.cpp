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
// Drives that have power answer within milliseconds, and in this time a lost cable was seen.
constexpr auto kSilence = std::chrono::seconds(5);
constexpr auto kBeat = std::chrono::milliseconds(1000);  // in which something must have gone on

bool alive(int process) { return process > 0 && (kill(process, 0) == 0 || errno == EPERM); }

/// Empty: all are well.
std::string unwell_joints(const ServiceHealth& health) {
  const int unwell = health.joints - health.drives.heard;
  if (unwell == 0) return {};
  return std::to_string(unwell) + " of " + std::to_string(health.joints) +
         " joints are not well: " + health.drives.trouble;
}

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

  /// What waiting does not heal: a drive's error, or one that leaves question after question
  /// unanswered. Empty: nothing of the kind.
  std::string hopeless(const std::optional<ServiceHealth>& health, Clock::time_point now) {
    const bool ours = health && health->bundle == bundle_ && health->ready;
    const std::string joints = ours ? unwell_joints(*health) : "";
    if (joints.empty()) joints_well_ = now;
    const bool error = ours && health->drives.faulty > 0;
    return error || now - joints_well_ > kSilence ? joints : "";
  }

 private:
  [[nodiscard]] std::string judge(const std::optional<ServiceHealth>& health) const {
    if (!health) return "no service says how it is";
    if (health->bundle != bundle_) return "the service that runs is of another bundle";
    if (!alive(health->process)) return "the service has ended";
    if (!health->problem.empty()) return health->problem;
    if (!health->ready) return "the service is not ready yet";
    if (health->torque) return "the drives have torque";
    return unwell_joints(*health);
  }

  std::string bundle_;
  int allowed_;
  std::optional<ServiceHealth> first_, last_;
  Clock::time_point moved_;
  Clock::time_point joints_well_ = Clock::now();
};

}  // namespace

void save_health(const ServiceHealth& health, const fs::path& file) {
  const Json json{{"bundle", health.bundle},
                  {"process", health.process},
                  {"ready", health.ready},
                  {"torque", health.torque},
                  {"beats", health.beats},
                  {"pings", health.pings},
                  {"overruns", health.overruns},
                  {"joints", health.joints},
                  {"heard", health.drives.heard},
                  {"faulty", health.drives.faulty},
                  {"trouble", health.drives.trouble},
                  {"problem", health.problem}};
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
    return ServiceHealth{json.at("bundle"),
                         json.at("process"),
                         json.at("ready"),
                         json.at("torque"),
                         json.at("beats"),
                         json.at("pings"),
                         json.at("overruns"),
                         json.at("joints"),
                         {json.at("heard"), json.at("faulty"), json.at("trouble")},
                         json.at("problem")};
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
  auto well_since = Clock::now();
  std::string wrong;
  for (auto now = Clock::now(); now < end; now = Clock::now()) {
    if (interrupted && interrupted()) throw JobFailed("interrupted");
    const std::optional<ServiceHealth> health = load_health(file);
    const std::string found = watch.look(health, now);
    if (const std::string joints = watch.hopeless(health, now); !joints.empty())
      throw JobFailed(joints);
    if (!found.empty()) {
      well_since = now;
      wrong = found;
    } else if (now - well_since >= seconds(settings.time)) {
      return;
    }
    std::this_thread::sleep_for(kLook);
  }
  if (wrong.empty()) wrong = "well, but not for long enough";
  throw JobFailed("not healthy within " + std::to_string(static_cast<int>(settings.timeout)) +
                  " s: " + wrong);
}

}  // namespace clamber
