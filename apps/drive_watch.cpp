#include "apps/drive_watch.hpp"

namespace clamber {
namespace {

constexpr std::int64_t kRound = 100'000'000;  // ns between two questions to a drive
constexpr int kUnanswered = 3;                // questions: a frame may get lost
constexpr auto kOld = std::chrono::seconds(1);

}  // namespace

DriveWatch::DriveWatch(BusMap map) : map_(std::move(map)), listener_(map_) {
  for (std::size_t b = 0; b < map_.buses.size(); ++b)
    for (std::size_t i = 0; i < map_.buses[b].drives.size(); ++i)
      drives_.push_back({.bus = b, .place = i, .answer = 0, .unanswered = kUnanswered});
  listener_.listen(listener_.now() + 2 * kRound);  // is there somebody who commands them?
  go_round();
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

void DriveWatch::watch(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    {
      const std::lock_guard guard(lock_);
      if (silent_) return;
    }
    go_round();
  }
}

void DriveWatch::go_round() {
  const std::uint64_t commands = listener_.commands();
  if (commands == commands_) ask();
  commands_ = commands;
  listener_.listen(listener_.now() + kRound);
  look();
}

void DriveWatch::ask() {
  for (std::size_t b = 0; b < map_.buses.size(); ++b) {
    std::vector<std::uint8_t> nodes;
    for (const JointDrive& drive : map_.buses[b].drives)
      nodes.push_back(static_cast<std::uint8_t>(drive.node));
    for (const CanFrame& question : questions_to(map_.buses[b], 0x1001, nodes)) {
      const std::lock_guard guard(lock_);
      if (silent_) return;
      listener_.send(b, question);
    }
  }
}

void DriveWatch::look() {
  DriveHealth seen;
  for (Drive& drive : drives_) {
    const std::uint64_t answer = answer_of(drive);
    drive.unanswered = answer == drive.answer ? drive.unanswered + 1 : 0;
    drive.answer = answer;
    const bool heard = drive.unanswered < kUnanswered;
    const std::string error = heard ? error_of(drive) : "no answer";
    seen.heard += heard && error.empty() ? 1 : 0;
    seen.faulty += heard && !error.empty() ? 1 : 0;
    if (error.empty()) continue;
    const std::string& name = map_.buses[drive.bus].drives[drive.place].name;
    seen.trouble += (seen.trouble.empty() ? "" : ", ") + name + ": " + error;
  }
  const std::lock_guard guard(lock_);
  seen_ = std::move(seen);
  seen_at_ = Clock::now();
}

std::uint64_t DriveWatch::answer_of(const Drive& drive) const {
  const JointDrive& joint = map_.buses[drive.bus].drives[drive.place];
  const auto node = listener_.nodes(drive.bus).find(static_cast<std::uint8_t>(joint.node));
  const bool answered = node != listener_.nodes(drive.bus).end();
  return listener_.watch(drive.bus).drive(drive.place).replies +
         (answered ? node->second.answers : 0);
}

std::string DriveWatch::error_of(const Drive& drive) const {
  const std::string& state = listener_.watch(drive.bus).drive(drive.place).state;
  if (state.starts_with("error") || state.starts_with("fault")) return state;
  const JointDrive& joint = map_.buses[drive.bus].drives[drive.place];
  const auto node = listener_.nodes(drive.bus).find(static_cast<std::uint8_t>(joint.node));
  if (node == listener_.nodes(drive.bus).end() || node->second.error == 0) return {};
  return "error register " + std::to_string(node->second.error);
}

void DriveWatch::fall_silent() {
  const std::lock_guard guard(lock_);
  silent_ = true;
}

DriveHealth DriveWatch::seen() const {
  const std::lock_guard guard(lock_);
  if (silent_ || Clock::now() - seen_at_ < kOld) return seen_;
  return {.heard = 0, .faulty = 0, .trouble = "the drives are not asked any more"};
}

}  // namespace clamber
