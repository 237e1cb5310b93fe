#include "apps/realtime/control_thread.hpp"

#include <alloca.h>
#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

// What the thread's start and the libraries below it may already have used of its stack.
constexpr std::size_t kStackInUse = 64 * 1024;

bool has_capability(unsigned capability) noexcept {
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  __user_cap_data_struct data[2] = {};
  if (syscall(SYS_capget, &header, &data[0]) != 0) return false;
  return (data[capability / 32].effective & (1U << (capability % 32))) != 0;
}

std::string because(int error) { return std::string(" (") + std::strerror(error) + ')'; }

void ask_for_priority(int priority, std::vector<std::string>& refused) {
  if (priority == 0) return;
  sched_param param{};
  param.sched_priority = priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &param);
  if (error != 0)
    refused.push_back(
        "priority: SCHED_FIFO " + std::to_string(priority) + " not granted" + because(error) +
        ": put '<user> - rtprio 99' into /etc/security/limits.conf and log in again, or run "
        "`setcap cap_sys_nice,cap_ipc_lock=ep` on the program");
}

void ask_for_processors(const std::vector<int>& processors, std::vector<std::string>& refused) {
  if (processors.empty()) return;
  cpu_set_t wanted;
  CPU_ZERO(&wanted);
  std::string names;
  for (const int processor : processors) {
    CPU_SET(static_cast<std::size_t>(processor), &wanted);
    names += (names.empty() ? "" : ", ") + std::to_string(processor);
  }
  cpu_set_t got;
  int error = pthread_setaffinity_np(pthread_self(), sizeof wanted, &wanted);
  if (error == 0) error = pthread_getaffinity_np(pthread_self(), sizeof got, &got);
  if (error == 0 && CPU_EQUAL(&wanted, &got) != 0) return;
  refused.push_back("processors: [" + names + "] not granted" +
                    (error != 0 ? because(error) : std::string()) + ": name some of those that " +
                    "`taskset -p $$` and /sys/devices/system/cpu/online show");
}

void ask_for_memory(bool lock, std::vector<std::string>& refused) {
  if (!lock) return;
  const std::string remedy =
      ": put '<user> - memlock unlimited' into /etc/security/limits.conf and log in again, or run "
      "`setcap cap_sys_nice,cap_ipc_lock=ep` on the program";
  rlimit limit{};
  // Under a limit that is met later, allocations would fail: rather no lock than that.
  const bool limited = getrlimit(RLIMIT_MEMLOCK, &limit) != 0 || limit.rlim_cur != RLIM_INFINITY;
  if (limited && !has_capability(CAP_IPC_LOCK))
    refused.push_back("lock_memory: the limit on locked memory is " +
                      std::to_string(limit.rlim_cur / 1024) + " kB" + remedy);
  else if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
    refused.push_back("lock_memory: not granted" + because(errno) + remedy);
}

/// A page of stack that was never used costs a fault in the tick that uses it first.
__attribute__((noinline)) void touch_stack(std::size_t bytes) noexcept {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  auto* stack = static_cast<volatile char*>(alloca(bytes));
  for (std::size_t i = 0; i < bytes; i += page) stack[i] = 0;
}

struct Job {
  const RuntimeSettings& settings;
  const std::function<void(std::vector<std::string>)>& body;
  std::exception_ptr error;
};

void* run_job(void* argument) noexcept {
  Job& job = *static_cast<Job*>(argument);
  try {
    std::vector<std::string> refused = enter_realtime(job.settings);
    if (job.settings.required && !refused.empty())
      throw InputError("runtime: required, but " + refused.front());
    touch_stack(job.settings.stack - kStackInUse);
    job.body(std::move(refused));
  } catch (...) {
    job.error = std::current_exception();
  }
  return nullptr;
}

}  // namespace

std::vector<std::string> enter_realtime(const RuntimeSettings& settings) {
  std::vector<std::string> refused;
  ask_for_memory(settings.lock_memory, refused);
  ask_for_processors(settings.processors, refused);
  ask_for_priority(settings.priority, refused);
  // Without real-time priority every wait may end 50 us late.
  (void)prctl(PR_SET_TIMERSLACK, 1UL);
  return refused;
}

void run_in_control_thread(const RuntimeSettings& settings,
                           const std::function<void(std::vector<std::string> refused)>& body) {
  Job job{settings, body, nullptr};
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes,
                            std::max(settings.stack, static_cast<std::size_t>(4 * kStackInUse)));
  // The thread inherits a mask that leaves signals to the others; only its own errors reach it.
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  for (const int own : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGSYS}) sigdelset(&all, own);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  pthread_t thread{};
  const int error = pthread_create(&thread, &attributes, run_job, &job);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_attr_destroy(&attributes);
  if (error != 0) throw InputError(std::string("runtime: no control thread") + because(error));
  pthread_join(thread, nullptr);
  if (settings.lock_memory) munlockall();
  if (job.error) std::rethrow_exception(job.error);
}

}  // namespace clamber
