// What feeds the watchdog, what stops feeding it, and what counts as a version that works.
#include <gmock/gmock.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <thread>

#include "apps/child_process.hpp"
#include "apps/job_failed.hpp"
#include "apps/service_monitor.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;
using namespace std::chrono_literals;

/// A loop that goes round as long as it is let, and a manager that listens.
class ServiceTest : public testing::Test {
 protected:
  ServiceTest() {
    std::string name = (fs::temp_directory_path() / "clamber-service-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    (folder_ / "notify").string().copy(address.sun_path, sizeof address.sun_path - 1);
    manager_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    EXPECT_EQ(bind(manager_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    setenv("NOTIFY_SOCKET", (folder_ / "notify").c_str(), 1);
    setenv("WATCHDOG_USEC", "400000", 1);
    unsetenv("WATCHDOG_PID");
    loop_ = std::jthread([this](const std::stop_token& stop) {
      for (; !stop.stop_requested(); std::this_thread::sleep_for(1ms)) {
        if (beating_) ++pulse_.beats;
        if (publishing_) ++rounds_;
      }
    });
  }
  ~ServiceTest() override {
    close(manager_);
    fs::remove_all(folder_);
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
  }

  [[nodiscard]] ServiceMonitor::Sources sources() {
    return {&pulse_, [this] { return rounds_.load(); }, {}};
  }
  [[nodiscard]] fs::path file() const { return folder_ / "health.json"; }

  /// The next message; empty: none within the time.
  std::string hear(int milliseconds) {
    pollfd polled{manager_, POLLIN, 0};
    if (poll(&polled, 1, milliseconds) <= 0) return {};
    std::array<char, 512> text{};
    const ssize_t got = recv(manager_, text.data(), text.size(), 0);
    return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0))};
  }
  /// Waits for a message that has the text.
  bool hears(const std::string& text) {
    for (const auto end = std::chrono::steady_clock::now() + 10s;
         std::chrono::steady_clock::now() < end;)
      if (hear(1000).find(text) != std::string::npos) return true;
    return false;
  }
  /// After the complaint nothing feeds the watchdog any more.
  void expect_starved(const std::string& complaint) {
    ASSERT_TRUE(hears("STATUS=" + complaint));
    EXPECT_EQ(hear(300).find("WATCHDOG"), std::string::npos);
  }

  RunPulse pulse_;
  std::atomic<std::uint64_t> rounds_{0};
  std::atomic<bool> beating_{true}, publishing_{true};

 private:
  fs::path folder_;
  int manager_ = -1;
  std::jthread loop_;
};

ServiceHealth health_of(const std::string& bundle, int joints, int heard) {
  ServiceHealth health;
  health.bundle = bundle;
  health.process = getpid();
  health.joints = joints;
  health.drives.heard = heard;
  return health;
}

TEST_F(ServiceTest, ReadyOnceThenFed) {
  const ServiceMonitor monitor(sources(), health_of("", 3, 3), file());
  ASSERT_TRUE(hears("READY=1"));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(hear(5000), "WATCHDOG=1");
  const std::optional<ServiceHealth> health = load_health(file());
  ASSERT_TRUE(health);
  EXPECT_TRUE(health->ready);
  EXPECT_GT(health->pings, 0U);
  EXPECT_EQ(health->problem, "");
}

TEST_F(ServiceTest, NotReadyBeforeTheLoopHasBegun) {
  beating_ = false;
  const ServiceMonitor monitor(sources(), {}, {});
  expect_starved("the control loop stands still");
  beating_ = true;
  EXPECT_TRUE(hears("READY=1"));
}

TEST_F(ServiceTest, ALoopThatHangsIsNotFed) {
  const ServiceMonitor monitor(sources(), {}, file());
  ASSERT_TRUE(hears("WATCHDOG=1"));
  beating_ = false;
  expect_starved("the control loop stands still");
  EXPECT_THAT(load_health(file())->problem, HasSubstr("control loop"));
}

TEST_F(ServiceTest, APublisherThatHangsIsNotFed) {
  const ServiceMonitor monitor(sources(), {}, {});
  ASSERT_TRUE(hears("WATCHDOG=1"));
  publishing_ = false;
  expect_starved("telemetry's publisher stands still");
}

TEST_F(ServiceTest, StaleJointsStarveOnlyWhereNobodyActsOnThem) {
  const ServiceMonitor monitor(sources(), {}, {});
  pulse_.stale_joints = 2;  // drives off: not asked
  ASSERT_TRUE(hears("READY=1"));
  pulse_.torque = true;
  expect_starved("2 joints have had no fresh state");
  pulse_.fault = true;  // the supervisor knows
  EXPECT_TRUE(hears("WATCHDOG=1"));
}

TEST_F(ServiceTest, AtTheEndTheManagerIsToldToWait) {
  const ServiceMonitor monitor(sources(), {}, {});
  ASSERT_TRUE(hears("WATCHDOG=1"));
  pulse_.over = true;
  beating_ = false;
  EXPECT_TRUE(hears("STOPPING=1"));
}

TEST_F(ServiceTest, HealthIsWhatTheGateAsksFor) {
  const HealthSettings quick{.time = 0.3, .timeout = 20.0, .overruns = 0};
  const HealthSettings short_one{.time = 0.3, .timeout = 0.5, .overruns = 0};
  ServiceHealth health = health_of("new", 2, 2);
  const auto refused = [&](const std::string& bundle, const char* why) {
    EXPECT_THAT([&] { await_health(file(), bundle, short_one, {}); },
                ThrowsMessage<JobFailed>(HasSubstr(why)));
  };
  refused("new", "no service says how it is");
  {
    const ServiceMonitor monitor(sources(), health, file());
    await_health(file(), "new", quick, {});
    refused("newer", "is of another bundle");
    pulse_.torque = true;
    refused("new", "the drives have torque");
    pulse_.torque = false;
    EXPECT_THAT([&] { await_health(file(), "new", quick, [] { return true; }); },
                ThrowsMessage<JobFailed>(HasSubstr("interrupted")));
  }
  health.drives = {.heard = 1, .faulty = 0, .trouble = "knee: no answer"};
  const ServiceMonitor monitor(sources(), health, file());
  ASSERT_TRUE(hears("READY=1"));
  refused("new", "1 of 2 joints are not well: knee: no answer");
}

// A joint that was heard at the start and then is not: all of the time counts.
TEST_F(ServiceTest, JointsMustBeWellAllTheTime) {
  std::atomic<bool> broken{false};
  int asked = 0;
  ServiceMonitor::Sources watched = sources();
  watched.drives = [&]() -> DriveHealth {
    if (broken) return {.heard = 1, .faulty = 1, .trouble = "knee: error 10"};
    if (++asked < 4) return {.heard = 2, .faulty = 0, .trouble = ""};
    return {.heard = 1, .faulty = 0, .trouble = "knee: no answer"};
  };
  const ServiceMonitor monitor(watched, health_of("new", 2, 2), file());
  EXPECT_THAT([&] { await_health(file(), "new", {.time = 4.0, .timeout = 100.0}, {}); },
              ThrowsMessage<JobFailed>("1 of 2 joints are not well: knee: no answer"));
  // An error does not go away by itself, and is not waited for.
  broken = true;
  EXPECT_THAT(
      [&] { await_health(file(), "new", {.time = 1.0, .timeout = 100.0}, {}); },
      ThrowsMessage<JobFailed>(testing::StartsWith("1 of 2 joints are not well: knee: err")));
  // Armed: the control loop knows.
  pulse_.stale_joints = 2;
  pulse_.torque = pulse_.fault = true;
  for (int i = 0; i < 1000 && load_health(file())->drives.heard != 0; ++i)
    std::this_thread::sleep_for(10ms);
  EXPECT_EQ(load_health(file())->drives.trouble, "no fresh state");
}

TEST_F(ServiceTest, LateTicksAndADeadProcessAreNotHealthy) {
  const HealthSettings settings{.time = 5.0, .timeout = 0.6, .overruns = 3};
  ServiceHealth health = health_of("new", 1, 1);
  health.ready = true;
  std::jthread service([&](const std::stop_token& stop) {
    for (; !stop.stop_requested(); std::this_thread::sleep_for(10ms)) {
      ++health.beats;
      ++health.pings;
      ++health.overruns;
      save_health(health, file());
    }
  });
  EXPECT_THAT([&] { await_health(file(), "new", settings, {}); },
              ThrowsMessage<JobFailed>(HasSubstr("late ticks")));
  service.request_stop();
  service.join();
  health.process = 0x3fffff;
  save_health(health, file());
  EXPECT_THAT([&] { await_health(file(), "new", settings, {}); },
              ThrowsMessage<JobFailed>(HasSubstr("has ended")));
}

TEST(ChildProcess, SaysHowItEnded) {
  EXPECT_EQ(run_child({"true"}).status, 0);
  const ChildResult failed =
      run_child({"sh", "-c", "echo first; echo 'clamber: error: the reason' >&2; exit 3"});
  EXPECT_EQ(failed.status, 3);
  EXPECT_EQ(failed.last_words(), "the reason");
  EXPECT_EQ(run_child({"sh", "-c", "kill -9 $$"}).status, 137);
  EXPECT_THAT(run_child({"false"}).last_words(), HasSubstr("status 1, silently"));
  EXPECT_THROW((void)run_child({"/no/such/program"}), JobFailed);
  EXPECT_THAT(
      [] {
        (void)run_child({"sleep", "60"}, {.patience = 0.1});
      },
      ThrowsMessage<JobFailed>(HasSubstr("did not end in time")));
  const ChildResult much = run_child({"sh", "-c", "yes | head -c 1000000; echo end"});
  EXPECT_EQ(much.last_words(), "end");
}

}  // namespace
}  // namespace clamber
