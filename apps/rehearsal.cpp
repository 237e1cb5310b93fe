#include "apps/rehearsal.hpp"

#include "sim_backend/ode_plant.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kJudgePeriod = 5;      // ticks between two samples
constexpr std::uint64_t kVerdictPeriod = 100;  // ticks between two verdicts

const char* to_string(DrivePower power) {
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
                      {"power", to_string(placed.drive->power())},
                      {"temperature", placed.drive->temperature()},
                      {"heard", placed.drive->traffic().heard},
                      {"malformed", placed.drive->traffic().malformed}});
  return list;
}

}  // namespace clamber
