#include "apps/rehearsal.hpp"

#include <algorithm>
#include <optional>
#include <sstream>

#include "apps/controller_config.hpp"
#include "apps/run_support.hpp"
#include "firmware_hal/bus_model/bus_budget.hpp"
#include "firmware_hal/frame_log.hpp"
#include "firmware_hal/virtual_drives/rehearsal_bus.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/sha256.hpp"
#include "sim_backend/ode_plant.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kJudgePeriod = 5;      // ticks between two samples
constexpr std::uint64_t kVerdictPeriod = 100;  // ticks between two verdicts

const char* name_of(DrivePower power) {
  switch (power) {
    case DrivePower::kOff:
      return "off";
    case DrivePower::kOn:
      return "on";
    case DrivePower::kDropped:
      return "let go by itself";
  }
  return "?";
}

OdeOptions options(double step) {
  OdeOptions ode;
  ode.step = step;
  return ode;
}

}  // namespace

struct RehearsalWorld::Impl {
  Impl(const RobotModel& model, const Scenario& scenario, double step)
      : world(model, scenario, options(step)), plant(world), judge(model, scenario) {}

  OdeWorld world;
  OdePlant plant;
  ClimbJudge judge;
  ClimbVerdict on_top;
  double on_top_at = -1.0;
  double seen = 0.0;  ///< s, of the last look
  std::uint64_t looks = 0;
};

RehearsalWorld::RehearsalWorld(const RobotModel& model, const Scenario& scenario, double step)
    : impl_(std::make_unique<Impl>(model, scenario, step)) {}
RehearsalWorld::~RehearsalWorld() = default;

JointPlant& RehearsalWorld::plant() { return impl_->plant; }

double RehearsalWorld::time() const { return impl_->world.time(); }

void RehearsalWorld::look() {
  Impl& m = *impl_;
  if (m.world.time() <= m.seen) return;  // it stands still
  m.seen = m.world.time();
  if (++m.looks % kJudgePeriod == 0)
    m.judge.push(m.world.time(), m.world.contacts(), m.world.velocity());
  if (m.looks % kVerdictPeriod != 0) return;
  const ClimbVerdict verdict = m.judge.verdict();
  if (!verdict.success) return;
  m.on_top = verdict;
  m.on_top_at = m.world.time();
}

ClimbVerdict RehearsalWorld::verdict() const {
  const bool just = impl_->on_top_at >= 0.0 && time() - impl_->on_top_at <= kStopAllowance;
  return just ? impl_->on_top : impl_->judge.verdict();
}

bool RehearsalRun::success() const {
  return execution.status == TickStatus::kFinished && execution.bus != BusStatus::kDown &&
         verdict.success;
}

std::string RehearsalRun::failure() const {
  if (success()) return {};
  if (!trouble.empty()) return trouble;
  if (execution.stopped) return "interrupted";
  if (execution.bus == BusStatus::kDown) return "the motor bus went down";
  if (execution.status == TickStatus::kFault)
    return std::string("the controller gave up: ") + clamber::to_string(execution.fault) + "; " +
           describe(verdict);
  return describe(verdict);
}

RehearsalRun rehearse(const RobotModel& model, const Scenario& scenario, const BusMap& map,
                      const std::vector<std::byte>& image, const RehearsalOptions& options) {
  require_budget(map);
  LoadedController loaded(model, options.control, image);
  Controller& controller = loaded.controller;
  std::optional<FrameLog> frame_log;
  if (!options.frame_log.empty()) frame_log.emplace(options.frame_log, map);
  std::optional<RunLogWriter> log;
  if (!options.log.empty())
    log.emplace(options.log, make_run_log_header(model, options.plan_sha256, options.control.dt),
                log_capacity(controller, false));
  const std::unique_ptr<InputLogWriter> inputs =
      log_inputs(options.inputs, model, options.control, image, options.plan_sha256,
                 log_capacity(controller, false));

  RehearsalWorld world(model, scenario, 1.0 / map.rate);
  RehearsalBus bus(map, world.plant(), frame_log ? &*frame_log : nullptr);
  const StopGuard stop;
  ExecutorOptions execution{.stop = stop.flag()};
  execution.log = log ? &*log : nullptr;
  execution.inputs = inputs.get();
  execution.observe = [&world](TelemetryFrame&) { world.look(); };
  RehearsalRun run;
  run.execution = execute(controller, bus, execution);
  run.verdict = world.verdict();
  const BusTroubleReport& trouble = bus.bus().trouble();
  if (trouble.what != BusTrouble::kNone)
    run.trouble = "bus '" + map.buses[trouble.bus].name +
                  "': drives cannot be used: " + clamber::to_string(trouble.link.fault);
  run.missing_replies = bus.counters().missing_replies;
  for (std::size_t b = 0; b < map.buses.size(); ++b)
    run.slowest_reply =
        std::max(run.slowest_reply,
                 1e-9 * static_cast<double>(bus.bus().segment_counters(b).slowest_reply_ns));
  const HottestDrive hot = hottest(bus.drives());
  run.temperature = hot.temperature;
  run.hottest = hot.joint;
  if (frame_log) {
    frame_log->close();
    run.frames = frame_log->frames();
    run.frame_log_sha256 = sha256_file(options.frame_log);
  }
  return run;
}

std::string describe(const RehearsalRun& run) {
  std::ostringstream out;
  out.precision(3);
  out << "rehearsal:   " << clamber::to_string(run.execution.status) << " after "
      << run.execution.ticks << " ticks in " << run.execution.wall_time << " s\n"
      << "buses:       " << run.missing_replies << " replies missing, the slowest "
      << 1e6 * run.slowest_reply << " us after the start of its tick\n"
      << "drives:      hottest " << run.temperature << " C (" << run.hottest << ")\n";
  if (!run.frame_log_sha256.empty())
    out << "frame log:   " << run.frames << " frames, sha256 " << run.frame_log_sha256 << '\n';
  out << "judge:       " << (run.success() ? "success" : "failure: " + run.failure()) << '\n';
  return out.str();
}

HottestDrive hottest(const VirtualDrives& drives) {
  HottestDrive found;
  for (std::size_t b = 0; b < drives.bus_count(); ++b)
    for (const PlacedDrive& placed : drives.bus(b))
      if (placed.drive->temperature() > found.temperature)
        found = {placed.drive->temperature(), placed.name};
  return found;
}

Json to_json(const ClimbVerdict& verdict) {
  return {{"success", verdict.success},
          {"final_contacts", verdict.final_contacts},
          {"floor_contacts", verdict.floor_contacts},
          {"forbidden_contacts", verdict.forbidden_contacts},
          {"side_contacts", verdict.side_contacts},
          {"missing_contacts", verdict.missing_contacts},
          {"weight_on_obstacle", verdict.weight_on_obstacle},
          {"rest_speed", verdict.rest_speed}};
}

Json to_json(const BusMap& map, const VirtualDrives& drives) {
  Json list = Json::array();
  for (std::size_t b = 0; b < drives.bus_count(); ++b)
    for (const PlacedDrive& placed : drives.bus(b))
      list.push_back({{"joint", placed.name},
                      {"bus", map.buses[b].name},
                      {"power", name_of(placed.drive->power())},
                      {"temperature", placed.drive->temperature()},
                      {"heard", placed.drive->traffic().heard},
                      {"malformed", placed.drive->traffic().malformed}});
  return list;
}

}  // namespace clamber
