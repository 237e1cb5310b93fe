#include "apps/realtime/syscall_guard.hpp"

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kArchitecture = 0;
#endif

// Clocks are calls only where the vDSO does not serve them. write: what the guards themselves say
// on standard error, see filter(). The last line: how a thread ends and lets go of its stack.
constexpr long kAlways[] = {SYS_clock_nanosleep, SYS_clock_gettime, SYS_restart_syscall,
                            SYS_getrusage,       SYS_rt_sigreturn,  SYS_rt_sigprocmask,
                            SYS_gettid,          SYS_getpid,        SYS_tgkill,
                            SYS_exit_group,      SYS_exit,          SYS_madvise,
                            SYS_munmap,          SYS_futex};

// Frames, waiting for them, an interface's queue and state; then opening it again.
constexpr long kSockets[] = {SYS_sendmmsg, SYS_recvmmsg, SYS_ppoll, SYS_getsockopt, SYS_ioctl,
                             SYS_socket,   SYS_bind,     SYS_close, SYS_setsockopt};

constexpr long kMemory[] = {SYS_brk, SYS_mmap, SYS_mremap, SYS_mprotect, SYS_getrandom};

struct CallName {
  long number;
  const char* name;
};
// Of what strays into a control loop most often; the others are told by their number.
constexpr CallName kNames[] = {{SYS_read, "read"},
                               {SYS_write, "write"},
                               {SYS_writev, "writev"},
                               {SYS_openat, "openat"},
                               {SYS_close, "close"},
                               {SYS_lseek, "lseek"},
                               {SYS_fsync, "fsync"},
                               {SYS_newfstatat, "newfstatat"},
                               {SYS_mmap, "mmap"},
                               {SYS_mremap, "mremap"},
                               {SYS_mprotect, "mprotect"},
                               {SYS_brk, "brk"},
                               {SYS_ppoll, "ppoll"},
                               {SYS_sendto, "sendto"},
                               {SYS_recvfrom, "recvfrom"},
                               {SYS_sendmsg, "sendmsg"},
                               {SYS_recvmsg, "recvmsg"},
                               {SYS_sendmmsg, "sendmmsg"},
                               {SYS_recvmmsg, "recvmmsg"},
                               {SYS_socket, "socket"},
                               {SYS_connect, "connect"},
                               {SYS_clone, "clone"},
                               {SYS_clone3, "clone3"},
                               {SYS_execve, "execve"},
                               {SYS_sched_yield, "sched_yield"},
                               {SYS_nanosleep, "nanosleep"},
                               {SYS_getppid, "getppid"},
                               {SYS_getrandom, "getrandom"}};

void say(const char* text) noexcept {
  const ssize_t ignored = write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(ignored);
}

/// The signal is blocked in its own handler: the second forbidden call cannot be caught and ends
/// the process as an uncaught SIGSYS does, core and all.
void name_the_call(int /*signal*/, siginfo_t* info, void* /*context*/) {
  std::array<char, 24> number{};
  std::to_chars(number.data(), number.data() + number.size() - 1, info->si_syscall);
  say("clamber: guard 'syscalls': the control thread made the system call ");
  for (const CallName& call : kNames)
    if (call.number == info->si_syscall) {
      say(call.name);
      say(" (");
      break;
    }
  say(number.data());
  say(")\n");
  (void)syscall(SYS_getppid);
  _exit(1);
}

constexpr std::uint32_t at(std::size_t offset) { return static_cast<std::uint32_t>(offset); }

void load(std::vector<sock_filter>& program, std::uint32_t offset) {
  program.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offset));
}
void answer(std::vector<sock_filter>& program, std::uint32_t action) {
  program.push_back(BPF_STMT(BPF_RET | BPF_K, action));
}
/// If the loaded value is this, the next `skip` instructions are passed over, else the first.
void skip_unless_equal(std::vector<sock_filter>& program, std::uint32_t value, std::uint8_t skip) {
  program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, skip));
}
void allow(std::vector<sock_filter>& program, std::span<const long> calls) {
  for (const long call : calls) {
    skip_unless_equal(program, static_cast<std::uint32_t>(call), 1);
    answer(program, SECCOMP_RET_ALLOW);
  }
}

std::vector<sock_filter> filter(BusCalls bus) {
  std::vector<sock_filter> program;
  load(program, at(offsetof(seccomp_data, arch)));
  // Numbers of another architecture mean other calls.
  program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0));
  answer(program, SECCOMP_RET_TRAP);
  load(program, at(offsetof(seccomp_data, nr)));
  allow(program, kAlways);
  if (bus == BusCalls::kSockets) allow(program, kSockets);
  if (bus == BusCalls::kSimulation) allow(program, kMemory);
  skip_unless_equal(program, static_cast<std::uint32_t>(SYS_write), 3);
  load(program, at(offsetof(seccomp_data, args)));
  skip_unless_equal(program, STDERR_FILENO, 1);
  answer(program, SECCOMP_RET_ALLOW);
  answer(program, SECCOMP_RET_TRAP);
  return program;
}

[[noreturn]] void fail(const char* what) {
  throw InputError(std::string("guard 'syscalls': ") + what + ": " + std::strerror(errno) +
                   " (the kernel needs CONFIG_SECCOMP_FILTER)");
}

}  // namespace

void install_syscall_guard(BusCalls bus) {
  if (kArchitecture == 0) throw InputError("guard 'syscalls': made for x86-64 and aarch64 only");
  struct sigaction action {};
  action.sa_sigaction = name_the_call;
  action.sa_flags = SA_SIGINFO;
  sigemptyset(&action.sa_mask);
  if (sigaction(SIGSYS, &action, nullptr) != 0) fail("no handler for SIGSYS");
  std::vector<sock_filter> program = filter(bus);
  const sock_fprog code{.len = static_cast<unsigned short>(program.size()),
                        .filter = program.data()};
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) fail("no_new_privs refused");
  if (syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, 0, &code) != 0) fail("filter refused");
}

}  // namespace clamber
