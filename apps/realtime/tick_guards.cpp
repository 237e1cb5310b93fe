#include "apps/realtime/tick_guards.hpp"

#include <sys/resource.h>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

std::uint64_t page_faults() noexcept {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return static_cast<std::uint64_t>(usage.ru_minflt + usage.ru_majflt);
}

}  // namespace

const char* GuardReport::finding() const noexcept {
  if (malloc_calls > 0) return "the control thread used the heap in its tick";
  if (page_faults > 0) return "the control thread met page faults after its warm-up";
  return "";
}

void TickGuards::install(BusCalls bus) {
  if (settings_.malloc != GuardAction::kOff && !malloc_guard_works())
    throw InputError("guard 'malloc': not in a build with a sanitizer, which has its own malloc");
  report_ = {};
  report_.malloc = settings_.malloc != GuardAction::kOff;
  report_.syscalls = settings_.syscalls != GuardAction::kOff;
  report_.faults = settings_.faults != GuardAction::kOff;
  report_.exchange = bus != BusCalls::kSimulation;
  if (report_.syscalls) install_syscall_guard(bus);
}

void TickGuards::enter() noexcept {
  if (report_.faults) faults_before_ = page_faults();
  if (report_.malloc) malloc_.emplace(settings_.malloc);
}

void TickGuards::leave() noexcept {
  if (malloc_) {
    report_.malloc_calls += malloc_->calls();
    malloc_.reset();
  }
  if (report_.faults) {
    const std::uint64_t met = page_faults() - faults_before_;
    (report_.ticks < warm_up_ ? report_.warm_up_faults : report_.page_faults) += met;
  }
  ++report_.ticks;
}

}  // namespace clamber
