#include "telemetry/publisher_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstring>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <thread>

#include "telemetry/publisher.hpp"
#include "telemetry/setup_text.hpp"

extern char** environ;

namespace clamber {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// Open files that the process is born with, beside the standard three.
constexpr int kMemoryFile = 3;
constexpr int kSetupFile = 4;
constexpr int kLifeline = 5;  ///< a pipe that nobody writes to: its end is the signal to stop
constexpr int kFirstOther = 16;

constexpr auto kStartTime = 10s;
constexpr auto kStopTime = 5s;
constexpr auto kLook = 20ms;
constexpr auto kFirstPause = 100ms;
constexpr auto kLongestPause = 5s;
// A publisher whose pulse stands for so many looks hangs. Counted in looks and not by the clock, so
// that a machine that has no time for either of them, or sleeps, accuses nobody; 2 s, so that the
// ring, with room for 4 s, loses nothing before the next one has come up.
constexpr int kLooksWithoutPulse = 100;
constexpr int kLooksToComeUp = 500;
constexpr auto kStable = 10s;  ///< having lived so long, the next death counts as the first

[[noreturn]] void give_up(const std::string& what) {
  throw std::runtime_error("telemetry: " + what + ": " + std::strerror(errno));
}

/// An open file that closes itself.
class File {
 public:
  explicit File(int file = -1) : file_(file) {}
  ~File() { reset(); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  void reset(int file = -1) {
    if (file_ >= 0) close(file_);
    file_ = file;
  }
  [[nodiscard]] int get() const noexcept { return file_; }

 private:
  int file_;
};

/// Beyond the numbers that the child will use, so that giving them away cannot overwrite them.
int out_of_the_way(int file) {
  const int other = fcntl(file, F_DUPFD_CLOEXEC, kFirstOther);
  if (other < 0) give_up("no open file left");
  return other;
}

int file_with(const std::string& text) {
  const int file = memfd_create("clamber-telemetry-setup", MFD_CLOEXEC);
  if (file < 0) give_up("no shared memory");
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t count = write(file, text.data() + written, text.size() - written);
    if (count <= 0) give_up("no shared memory");
    written += static_cast<std::size_t>(count);
  }
  return file;
}

std::string text_in(int file) {
  struct stat status {};
  if (fstat(file, &status) != 0) give_up("not started by a run");
  std::string text(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t got = 0;
  while (got < text.size()) {
    const ssize_t count =
        pread(file, text.data() + got, text.size() - got, static_cast<off_t>(got));
    if (count <= 0) give_up("the setup cannot be read");
    got += static_cast<std::size_t>(count);
  }
  return text;
}

}  // namespace

class PublisherProcess::Impl {
 public:
  Impl(const std::string& setup, TelemetryMemory& memory, std::vector<std::string> command)
      : block_(memory.block()), command_(std::move(command)) {
    memory_.reset(out_of_the_way(memory.file()));
    const File written(file_with(setup));
    setup_.reset(out_of_the_way(written.get()));
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) give_up("no pipe");
    const File reading(ends[0]);
    const File writing(ends[1]);
    lifeline_.reset(out_of_the_way(reading.get()));
    hold_.reset(out_of_the_way(writing.get()));
  }

  void begin() {
    start();
    wait_until_ready();
    looks_left_ = kLooksWithoutPulse;
    watch_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
  }

  ~Impl() { stop(); }

  void stop() {
    if (watch_.joinable()) {
      watch_.request_stop();
      watch_.join();
    }
    hold_.reset();
    const auto until = Clock::now() + kStopTime;
    for (auto next_look = Clock::now(); !ended(); std::this_thread::sleep_for(1ms)) {
      if (Clock::now() > until) kill(pid_, SIGKILL);
      if (Clock::now() < next_look) continue;
      next_look += kLook;
      kill_if_it_hangs();
    }
    count_the_rest();
  }

  [[nodiscard]] int process_id() const noexcept { return pid_; }

 private:
  void start() {
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, memory_.get(), kMemoryFile);
    posix_spawn_file_actions_adddup2(&files, setup_.get(), kSetupFile);
    posix_spawn_file_actions_adddup2(&files, lifeline_.get(), kLifeline);
    std::vector<char*> arguments;
    for (std::string& argument : command_) arguments.push_back(argument.data());
    arguments.push_back(nullptr);
    pid_t pid = -1;
    const int error = posix_spawn(&pid, arguments[0], &files, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (error != 0) {
      errno = error;
      give_up("cannot start " + command_.front());
    }
    started_ = Clock::now();
    looks_left_ = kLooksToComeUp;
    pid_ = pid;
  }

  void wait_until_ready() {
    const auto until = Clock::now() + kStartTime;
    while (block_.publisher.starts == 0) {
      if (ended()) throw std::runtime_error("telemetry: the publisher's process ended at once");
      if (Clock::now() > until)
        throw std::runtime_error("telemetry: the publisher's process does not come up");
      std::this_thread::sleep_for(1ms);
    }
  }

  /// Buries it, too.
  [[nodiscard]] bool ended() noexcept {
    if (pid_ <= 0) return true;
    if (waitpid(pid_, nullptr, WNOHANG) == 0) return false;
    pid_ = -1;
    return true;
  }

  void watch(const std::stop_token& stop) {
    std::mutex mutex;
    std::condition_variable_any wake;
    std::unique_lock lock(mutex);
    Clock::duration before_next = kFirstPause;
    std::optional<Clock::time_point> start_at;
    while (!stop.stop_requested()) {
      // Whoever watches the run must not take a DDS that is down for a run that is stuck.
      ++block_.publisher.watches;
      const auto now = Clock::now();
      if (!ended()) {
        start_at.reset();
        kill_if_it_hangs();
      } else if (!start_at) {
        if (now - started_ > kStable) before_next = kFirstPause;
        start_at = now + before_next;
        before_next = std::min<Clock::duration>(2 * before_next, kLongestPause);
      } else if (now >= *start_at) {
        start_at.reset();
        start_again();
      }
      wake.wait_for(lock, stop, kLook, [] { return false; });
    }
  }

  /// Its end is seen by the looks that follow.
  void kill_if_it_hangs() {
    const std::uint64_t rounds = block_.publisher.rounds;
    if (rounds != rounds_seen_) looks_left_ = kLooksWithoutPulse;
    rounds_seen_ = rounds;
    if (--looks_left_ != 0) return;
    ++block_.publisher.hangs;
    kill(pid_, SIGKILL);
  }

  /// What a publisher that is no more has left in the ring: nobody will publish it.
  void count_the_rest() {
    RingConsumer<TelemetryRecord> ring(block_.records, block_.record_positions);
    PublisherState& state = block_.publisher;
    for (TelemetryRecord record; ring.pop(std::span(&record, 1)) == 1;) {
      const std::uint64_t next = record.frame.sequence + 1;
      state.gaps += next - std::min<std::uint64_t>(next, state.next_tick);
      state.next_tick = next;
    }
  }

  void start_again() {
    ++block_.publisher.restarts;
    try {
      start();
    } catch (const std::runtime_error&) {
      started_ = Clock::now();  // the pause before the next attempt is longer
    }
  }

  TelemetryBlock& block_;
  std::vector<std::string> command_;
  File memory_, setup_, lifeline_, hold_;
  Clock::time_point started_;
  std::uint64_t rounds_seen_ = 0;
  int looks_left_ = 0;  ///< until it hangs
  std::atomic<pid_t> pid_{-1};
  std::jthread watch_;
};

PublisherProcess::PublisherProcess(const TelemetryConfig& config,
                                   const TelemetryDescription& description, TelemetryMemory& memory,
                                   std::vector<std::string> command) {
  // Here its message reaches the user, and not only the other process's standard error.
  check(config, description);
  static_cast<void>(interface_addresses(config));
  refuse_real_time_thread();
  impl_ = std::make_unique<Impl>(format_setup({config, description}), memory, std::move(command));
  impl_->begin();
}

PublisherProcess::~PublisherProcess() = default;

void PublisherProcess::stop() { impl_->stop(); }

int PublisherProcess::process_id() const noexcept { return impl_->process_id(); }

void run_publisher_process() {
  // Ctrl-C reaches the whole group: this process ends when the other one says so.
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_IGN);
  TelemetryMemory memory(kMemoryFile);
  const TelemetrySetup setup = parse_setup(text_in(kSetupFile));
  Publisher publisher(setup.config, setup.description, memory.block());
  ++memory.block().publisher.starts;
  pollfd lifeline{.fd = kLifeline, .events = POLLIN, .revents = 0};
  while (poll(&lifeline, 1, -1) < 0 && errno == EINTR) {
  }
  publisher.stop();
}

}  // namespace clamber
