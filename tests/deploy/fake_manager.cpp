// A service manager for one service, as much of systemd as the tests need: starts it with a notify
// socket and a watchdog, starts it again when it ends, and writes down what it was told.
// Usage: fake_manager FOLDER WATCHDOG_SECONDS COMMAND...
// In FOLDER: events (lines), notify.sock, and the service's runtime and log folders.
// SIGHUP: restart; SIGTERM: stop the service and end.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kStopTimeout{30};  // TimeoutStopSec

volatile sig_atomic_t restart_asked = 0;
volatile sig_atomic_t stop_asked = 0;

class Manager {
 public:
  Manager(const fs::path& folder, double watchdog, char** command)
      : folder_(folder), watchdog_(watchdog), command_(command) {
    fs::create_directories(folder / "run");
    events_ = std::fopen((folder / "events").c_str(), "a");
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string path = (folder / "notify.sock").string();
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    unlink(path.c_str());
    if (bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) std::exit(2);
  }

  int run() {
    while (stop_asked == 0) {
      if (restart_asked != 0) {
        restart_asked = 0;
        stop_service();
      }
      if (child_ == 0) start_service();
      hear();
      reap();
      watch();
    }
    stop_service();
    return 0;
  }

 private:
  void note(const std::string& event) {
    std::fprintf(events_, "%s\n", event.c_str());
    std::fflush(events_);
  }

  void start_service() {
    // Until it has become the service, the child has this program's handlers: a SIGTERM meant for
    // the service would set a flag that nobody reads and be lost.
    sigset_t ours;
    sigset_t before;
    sigemptyset(&ours);
    sigaddset(&ours, SIGTERM);
    sigaddset(&ours, SIGHUP);
    sigprocmask(SIG_BLOCK, &ours, &before);
    child_ = fork();
    if (child_ == 0) {
      signal(SIGTERM, SIG_DFL);
      signal(SIGHUP, SIG_DFL);
      sigprocmask(SIG_SETMASK, &before, nullptr);
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      setenv("NOTIFY_SOCKET", (folder_ / "notify.sock").c_str(), 1);
      setenv("WATCHDOG_USEC", std::to_string(static_cast<long>(1e6 * watchdog_)).c_str(), 1);
      setenv("WATCHDOG_PID", std::to_string(getpid()).c_str(), 1);
      setenv("RUNTIME_DIRECTORY", (folder_ / "run").c_str(), 1);
      setenv("LOGS_DIRECTORY", (folder_ / "logs").c_str(), 1);
      execv(command_[0], command_);
      _exit(127);
    }
    sigprocmask(SIG_SETMASK, &before, nullptr);
    ready_ = false;
    pings_ = 0;
    note("started");
  }

  void stop_service() {
    if (child_ == 0) return;
    kill(child_, SIGTERM);
    const Clock::time_point told = Clock::now();
    while (waitpid(child_, nullptr, WNOHANG) == 0) {
      usleep(5'000);
      if (Clock::now() - told < kStopTimeout) continue;
      note("stop timeout");
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
      break;
    }
    child_ = 0;
    note("stopped");
  }

  void hear() {
    pollfd polled{socket_, POLLIN, 0};
    poll(&polled, 1, 20);
    std::array<char, 1024> text{};
    for (ssize_t got = 0; (got = recv(socket_, text.data(), text.size() - 1, 0)) > 0;)
      take({text.data(), static_cast<std::size_t>(got)});
  }

  void take(const std::string& message) {
    if (message.find("READY=1") != std::string::npos) {
      ready_ = true;
      fed_ = Clock::now();
      note("ready");
    }
    if (message.find("STOPPING=1") != std::string::npos) {
      ready_ = false;  // the real one is told to wait longer
      note("stopping after " + std::to_string(pings_) + " pings");
    }
    if (message.find("WATCHDOG=1") != std::string::npos) {
      fed_ = Clock::now();
      ++pings_;
    }
  }

  void reap() {
    int status = 0;
    if (child_ == 0 || waitpid(child_, &status, WNOHANG) != child_) return;
    hear();  // its last words
    child_ = 0;
    note(WIFEXITED(status) ? "exit " + std::to_string(WEXITSTATUS(status))
                           : "signal " + std::to_string(WTERMSIG(status)));
    usleep(500'000);
  }

  void watch() {
    const std::chrono::duration<double> since = Clock::now() - fed_;
    if (child_ == 0 || !ready_ || since.count() < watchdog_) return;
    note("watchdog");
    kill(child_, SIGABRT);
    ready_ = false;
  }

  fs::path folder_;
  double watchdog_;
  char** command_;
  std::FILE* events_ = nullptr;
  int socket_ = -1;
  pid_t child_ = 0;
  bool ready_ = false;
  int pings_ = 0;
  Clock::time_point fed_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  signal(SIGHUP, [](int) { restart_asked = 1; });
  signal(SIGTERM, [](int) { stop_asked = 1; });
  return Manager(argv[1], std::atof(argv[2]), argv + 3).run();
}
