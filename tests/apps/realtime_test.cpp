// The control thread: its settings, its guards, its times. Every guard is shown to fire, in a
// process of its own, and to leave a clean loop alone.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <random>
#include <thread>

#include "apps/executor.hpp"
#include "apps/realtime/control_thread.hpp"
#include "apps/realtime/mailbox.hpp"
#include "apps/realtime/snapshot.hpp"
#include "apps/timing_report.hpp"
#include "robot_model/loader.hpp"
#include "tests/apps/still_bus.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

// ---- histogram

TEST(Histogram, PercentilesAreAtMostABinHigh) {
  std::mt19937_64 random(7);
  std::lognormal_distribution<double> times(9.0, 2.0);
  LatencyHistogram histogram;
  std::vector<std::int64_t> all;
  for (int i = 0; i < 100'000; ++i) {
    all.push_back(static_cast<std::int64_t>(times(random)));
    histogram.add(all.back());
  }
  std::sort(all.begin(), all.end());
  for (const double share : {0.001, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999, 1.0}) {
    const auto rank = static_cast<std::size_t>(share * 1e5);
    const auto exact = static_cast<double>(all[std::max<std::size_t>(rank, 1) - 1]);
    const auto found = static_cast<double>(histogram.percentile(share));
    EXPECT_GE(found, exact) << share;
    EXPECT_LE(found, exact * (1.0 + 1.0 / 64.0) + 1.0) << share;
  }
  EXPECT_EQ(histogram.percentile(1.0), all.back());
  EXPECT_EQ(histogram.max(), all.back());
  EXPECT_EQ(histogram.count(), all.size());
}

TEST(Histogram, HasABinForEveryTime) {
  for (const std::int64_t ns : {std::int64_t{-5}, std::int64_t{0}, std::int64_t{127},
                                std::int64_t{128}, std::int64_t{1} << 40, INT64_MAX}) {
    LatencyHistogram histogram;
    histogram.add(ns);
    EXPECT_EQ(histogram.max(), std::max<std::int64_t>(ns, 0));
    EXPECT_LE(histogram.percentile(0.5), std::max<std::int64_t>(ns, 0));
    if (ns < 1000) {
      EXPECT_EQ(histogram.percentile(0.5), std::max<std::int64_t>(ns, 0)) << ns;
    }
  }
  EXPECT_EQ(LatencyHistogram().percentile(0.99), 0);
}

// ---- passing messages

TEST(MailboxTest, KeepsOrderAndRefusesWhenFull) {
  Mailbox<int, 4> box;
  int got = -1;
  EXPECT_FALSE(box.take(got));
  for (int lap = 0; lap < 3; ++lap) {
    for (int i = 0; i < 4; ++i) EXPECT_TRUE(box.put(i));
    EXPECT_FALSE(box.put(9));
    for (int i = 0; i < 4; ++i) {
      ASSERT_TRUE(box.take(got));
      EXPECT_EQ(got, i);
    }
  }
}

TEST(SnapshotTest, IsNeverReadHalfWritten) {
  struct Pair {
    std::uint64_t a = 0, rest[5] = {}, b = 7;
  };
  Snapshot<Pair> snapshot;
  std::atomic<bool> stop{false};
  std::thread writer([&] {
    for (std::uint64_t i = 0; !stop; ++i) snapshot.write({i, {i, i, i, i, i}, ~i});
  });
  std::uint64_t torn = 0;
  while (snapshot.read().a < 100) std::this_thread::yield();
  for (int i = 0; i < 20'000; ++i) {
    const Pair pair = snapshot.read();
    torn += pair.a != ~pair.b || pair.rest[2] != pair.a ? 1 : 0;
  }
  stop = true;
  writer.join();
  EXPECT_EQ(torn, 0u);
}

// ---- settings

class Settings : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              (std::string("clamber_rt_") +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  RuntimeSettings load(const std::string& text) {
    std::ofstream(folder_ / "runtime.yaml") << text;
    return load_runtime_settings(folder_ / "runtime.yaml");
  }
  std::string error(const std::string& text) {
    try {
      (void)load(text);
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  }
  fs::path folder_;
};

TEST_F(Settings, TheShippedFileStatesTheDefaults) {
  const RuntimeSettings shipped =
      load_runtime_settings(fs::path(CLAMBER_SOURCE_DIR) / "configs/runtime/default.yaml");
  const RuntimeSettings built_in;
  EXPECT_EQ(shipped.priority, built_in.priority);
  EXPECT_EQ(shipped.processors, built_in.processors);
  EXPECT_EQ(shipped.lock_memory, built_in.lock_memory);
  EXPECT_EQ(shipped.stack, built_in.stack);
  EXPECT_EQ(shipped.required, built_in.required);
  EXPECT_EQ(shipped.warm_up, built_in.warm_up);
  EXPECT_FALSE(shipped.guards.any());
  EXPECT_EQ(shipped.operator_socket.socket, "");
  EXPECT_EQ(shipped.operator_socket.mode, built_in.operator_socket.mode);
}

TEST_F(Settings, ReadsEveryKey) {
  const RuntimeSettings read = load(R"(
priority: 42
processors: [1, 3]
lock_memory: false
stack_kb: 1024
required: true
warm_up: 2
guards: {malloc: count, syscalls: abort, faults: count}
operator: {socket: /run/x.sock, group: robots, mode: 0600}
)");
  EXPECT_EQ(read.priority, 42);
  EXPECT_THAT(read.processors, ElementsAre(1, 3));
  EXPECT_FALSE(read.lock_memory);
  EXPECT_EQ(read.stack, 1024u * 1024u);
  EXPECT_TRUE(read.required);
  EXPECT_EQ(read.warm_up, 2.0);
  EXPECT_EQ(read.guards.malloc, GuardAction::kCount);
  EXPECT_EQ(read.guards.syscalls, GuardAction::kAbort);
  EXPECT_EQ(read.guards.faults, GuardAction::kCount);
  EXPECT_EQ(read.operator_socket.socket, "/run/x.sock");
  EXPECT_EQ(read.operator_socket.group, "robots");
  EXPECT_EQ(read.operator_socket.mode, 0600u);
}

TEST_F(Settings, NamesFileAndKeyOfWhatIsWrong) {
  EXPECT_THAT(error("priority: 100"), HasSubstr("runtime.yaml:1: priority: expected a whole"));
  EXPECT_THAT(error("priority: 1.5"), HasSubstr("priority"));
  EXPECT_THAT(error("processors: [0, -1]"), HasSubstr("processors[1]"));
  EXPECT_THAT(error("stack_kb: 16"), HasSubstr("stack_kb"));
  EXPECT_THAT(error("required: maybe"), HasSubstr("required"));
  EXPECT_THAT(error("prority: 3"), HasSubstr("prority"));
  EXPECT_THAT(error("guards: {malloc: yes}"), HasSubstr("expected off, count, abort, found yes"));
  EXPECT_THAT(error("guards: {syscalls: count}"), HasSubstr("expected off, abort, found count"));
  EXPECT_THAT(error("guards: {faults: abort}"), HasSubstr("expected off, count, found abort"));
  EXPECT_THAT(error("operator: {mode: 660}"), HasSubstr("expected four octal digits"));
  EXPECT_THAT(error("operator: {mode: 0060}"), HasSubstr("read and write for the owner"));
  EXPECT_THAT(error("operator: {mode: 0777}"), HasSubstr("nothing executable"));
  EXPECT_THROW((void)parse_guards("malloc,heap"), InputError);
  EXPECT_TRUE(parse_guards("faults").any());
}

// ---- the thread

TEST(ControlThread, HasWhatWasAskedForOrSaysWhyNot) {
  RuntimeSettings settings;
  settings.priority = 10;
  cpu_set_t mine;
  sched_getaffinity(0, sizeof mine, &mine);
  int processor = 0;
  while (!CPU_ISSET(static_cast<std::size_t>(processor), &mine)) ++processor;
  settings.processors = {processor};
  std::vector<std::string> refused;
  int policy = -1, cpus = 0;
  run_in_control_thread(settings, [&](std::vector<std::string> said) {
    refused = std::move(said);
    policy = sched_getscheduler(0);
    cpu_set_t own;
    sched_getaffinity(0, sizeof own, &own);
    cpus = CPU_COUNT(&own);
  });
  EXPECT_EQ(cpus, 1);
  // Where a machine grants it (root) the thread has it; else the line says how to get it.
  const auto says = [&](const char* key) {
    return std::any_of(refused.begin(), refused.end(),
                       [&](const std::string& line) { return line.starts_with(key); });
  };
  EXPECT_NE(policy == SCHED_FIFO, says("priority: "));
  for (const std::string& line : refused) EXPECT_THAT(line, HasSubstr("limits.conf"));
  EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER);  // the caller is what it was
}

TEST(ControlThread, RefusesWhatIsRequiredAndNotGranted) {
  RuntimeSettings settings = ordinary_thread();
  settings.processors = {1023};
  bool ran = false;
  std::vector<std::string> refused;
  run_in_control_thread(settings, [&](std::vector<std::string> said) { refused = said; });
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_THAT(refused[0], HasSubstr("processors: [1023] not granted"));
  settings.required = true;
  try {
    run_in_control_thread(settings, [&](const std::vector<std::string>&) { ran = true; });
    ADD_FAILURE() << "accepted";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("required, but processors: [1023]"));
  }
  EXPECT_FALSE(ran);
}

TEST(ControlThread, PassesExceptionsOn) {
  EXPECT_THROW(
      run_in_control_thread(ordinary_thread(),
                            [](const std::vector<std::string>&) { throw InputError("x"); }),
      InputError);
}

// ---- guards

GuardSettings only(const char* which) { return parse_guards(which); }

/// One guarded tick in a control thread.
GuardReport guarded(const GuardSettings& settings, BusCalls bus, void (*tick)(), int ticks = 20,
                    std::uint64_t warm_up = 10) {
  GuardReport report;
  run_in_control_thread(ordinary_thread(), [&](const std::vector<std::string>&) {
    TickGuards guards(settings, warm_up);
    guards.install(bus);
    for (int i = 0; i < ticks; ++i) {
      guards.enter();
      tick();
      guards.leave();
    }
    report = guards.report();
  });
  return report;
}

void* volatile block = nullptr;  // so that the compiler keeps the calls

void clean() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}
void allocates() {
  block = ::operator new(24);
  ::operator delete(block);
}
void frees_null() { free(nullptr); }
void opens_a_file() { (void)syscall(SYS_openat, AT_FDCWD, "/dev/null", O_RDONLY); }
void makes_a_socket() { (void)syscall(SYS_socket, 1, 1, 0); }
void makes_an_odd_call() { (void)syscall(SYS_sync); }

/// Touches a page that the kernel has not given yet.
void touches_new_memory() {
  static char* memory = static_cast<char*>(
      mmap(nullptr, 1 << 20, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
  static std::size_t page = 0;
  static_cast<volatile char*>(memory)[4096 * page++] = 1;
}

class Guards : public testing::Test {
 protected:
  void SetUp() override {
    testing::GTEST_FLAG(death_test_style) = "threadsafe";
    if (!malloc_guard_works()) GTEST_SKIP() << "a sanitizer's allocator cannot be replaced";
  }
};

TEST_F(Guards, LeaveACleanLoopAlone) {
  const GuardReport report =
      guarded(only("malloc,syscalls,faults"), BusCalls::kNone, clean, 1000, 500);
  EXPECT_EQ(report.ticks, 1000u);
  EXPECT_EQ(report.malloc_calls, 0u);
  EXPECT_EQ(report.page_faults, 0u);
  EXPECT_FALSE(report.found());
}

TEST_F(Guards, HeapCallsEndTheProcess) {
  EXPECT_DEATH((void)guarded(only("malloc"), BusCalls::kNone, allocates),
               "guard 'malloc': the control thread called malloc in its tick");
  EXPECT_DEATH((void)guarded(only("malloc"), BusCalls::kNone, frees_null), "called free");
}

TEST_F(Guards, HeapCallsAreCounted) {
  GuardSettings settings;
  settings.malloc = GuardAction::kCount;
  const GuardReport report = guarded(settings, BusCalls::kNone, allocates);
  EXPECT_EQ(report.malloc_calls, 40u);
  EXPECT_TRUE(report.found());
  EXPECT_THAT(report.finding(), HasSubstr("heap"));
}

TEST_F(Guards, OtherThreadsMayAllocate) {
  const auto tick = [] { std::thread([] { allocates(); }).join(); };
  GuardSettings settings;
  settings.malloc = GuardAction::kCount;
  const GuardReport here = guarded(settings, BusCalls::kNone, +tick, 1);
  const GuardReport alone = guarded(
      settings, BusCalls::kNone, [] { std::thread([] {}).join(); }, 1);
  EXPECT_EQ(here.malloc_calls, alone.malloc_calls);  // what making a thread takes, no more
}

TEST_F(Guards, UnlistedSystemCallsEndTheProcess) {
  const GuardSettings settings = only("syscalls");
  EXPECT_EXIT((void)guarded(settings, BusCalls::kNone, opens_a_file),
              testing::KilledBySignal(SIGSYS),
              "guard 'syscalls': the control thread made the system call openat");
  EXPECT_EXIT((void)guarded(settings, BusCalls::kNone, makes_a_socket),
              testing::KilledBySignal(SIGSYS), "socket");
  EXPECT_EXIT((void)guarded(settings, BusCalls::kSockets, makes_an_odd_call),
              testing::KilledBySignal(SIGSYS), std::to_string(SYS_sync));
}

TEST_F(Guards, ListedSystemCallsAreAllowed) {
  EXPECT_EQ(guarded(only("syscalls"), BusCalls::kSockets, makes_a_socket).ticks, 20u);
}

TEST_F(Guards, PageFaultsAreCountedAfterTheWarmUp) {
  const GuardReport report = guarded(only("faults"), BusCalls::kNone, touches_new_memory, 30, 10);
  EXPECT_GE(report.warm_up_faults, 1u);
  EXPECT_GE(report.page_faults, 1u);
  EXPECT_THAT(report.finding(), HasSubstr("page faults"));
}

// ---- the whole loop under guards

class PacedRun : public Guards {
 protected:
  PacedRun() {
    options_.realtime = true;
    options_.bus_calls = BusCalls::kNone;
    options_.runtime.guards = only("malloc,syscalls,faults");
  }
  test::ShortPlan plan_;
  Controller& controller_ = plan_.controller;
  test::StillBus bus_{3};
  ExecutorOptions options_;
};

TEST_F(PacedRun, TheExecutorKeepsWhatTheGuardsDemand) {
  const ExecutorReport report = execute(controller_, bus_, options_);
  EXPECT_EQ(report.status, TickStatus::kFinished);
  EXPECT_EQ(report.guards.ticks, report.ticks);
  EXPECT_TRUE(report.guards.exchange);
  EXPECT_FALSE(report.guards.found()) << report.guards.finding();
  EXPECT_EQ(report.timing.wakeup.count(), report.ticks);
  EXPECT_EQ(report.timing.tick.count(), report.ticks);
  EXPECT_EQ(report.timing.exchange.count(), report.ticks - 1);
  EXPECT_GT(report.timing.tick.percentile(0.5), 0);
  EXPECT_THAT(describe_timing(report), HasSubstr("0 heap calls, 0 page faults"));
}

TEST_F(PacedRun, ABusThatAllocatesIsFoundOut) {
  bus_.misbehave = allocates;
  EXPECT_DEATH((void)execute(controller_, bus_, options_), "guard 'malloc'");
}

TEST_F(PacedRun, ASimulationsBusMayDoAsItLikes) {
  bus_.misbehave = allocates;
  options_.bus_calls = BusCalls::kSimulation;
  const ExecutorReport report = execute(controller_, bus_, options_);
  EXPECT_EQ(report.status, TickStatus::kFinished);
  EXPECT_FALSE(report.guards.exchange);
  EXPECT_FALSE(report.guards.found()) << report.guards.finding();
}

}  // namespace
}  // namespace clamber
