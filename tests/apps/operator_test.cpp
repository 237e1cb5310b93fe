// The operator's socket: who may speak, what is answered, and that nobody disturbs the others.
#include <gmock/gmock.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <thread>

#include "apps/executor.hpp"
#include "apps/job_failed.hpp"
#include "apps/operator_server.hpp"
#include "apps/operator_socket.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "tests/apps/still_bus.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

int connect_raw(const std::string& path) {
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(&address.sun_path[0], path.c_str(), path.size() + 1);
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return fd;
  close(fd);
  return -1;
}

void say_raw(int fd, const std::string& text) {
  (void)!send(fd, text.data(), text.size(), MSG_NOSIGNAL);
}

std::string hear_raw(int fd) {
  std::string text;
  char block[256];
  for (ssize_t got = 0; (got = recv(fd, block, sizeof block, 0)) > 0;)
    text.append(block, static_cast<std::size_t>(got));
  return text;
}

class OperatorSocket : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / ("clamber_op_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    settings_.socket = (folder_ / "operator.sock").string();
  }
  void TearDown() override {
    stop_ = true;
    if (control_.joinable()) control_.join();
    server_.reset();
    fs::remove_all(folder_);
  }
  void serve() {
    server_ =
        std::make_unique<OperatorServer>(settings_, desk_, std::vector<std::string>{"A", "B"});
  }
  /// A control thread that takes `arm` and refuses all else.
  void control() {
    control_ = std::thread([this] {
      while (!stop_) {
        OperatorRequest request;
        if (desk_.requests.take(request)) {
          const bool done = request.command == OperatorCommand::kArm;
          (void)desk_.answers.put({request.id, done, "for ", "a test"});
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    });
  }
  std::string ask(const std::string& line, double patience = 5.0) {
    return ask_controller(settings_.socket, line, patience);
  }
  std::string refusal() {
    try {
      serve();
    } catch (const InputError& e) {
      return e.what();
    }
    return "no error";
  }

  fs::path folder_;
  OperatorSettings settings_;
  OperatorDesk desk_;
  std::unique_ptr<OperatorServer> server_;
  std::thread control_;
  std::atomic<bool> stop_{false};
};

TEST_F(OperatorSocket, AnswersEveryKindOfLine) {
  OperatorStatus status;
  status.state = "paused";
  status.fault = "tracking error";
  status.fault_joint = 1;
  status.plan_time = 1.25;
  desk_.status.write(status);
  serve();
  control();
  EXPECT_EQ(ask("arm"), "done");
  EXPECT_EQ(ask("start"), "refused for a test");
  EXPECT_THAT(ask("jump"), HasSubstr("bad unknown command"));
  EXPECT_THAT(ask("none"), HasSubstr("bad"));
  EXPECT_THAT(ask("ARM"), HasSubstr("bad"));
  EXPECT_THAT(ask(std::string(200, 'x')), HasSubstr("bad a line of at most"));
  const std::string answer = ask("status");
  ASSERT_TRUE(answer.starts_with("status "));
  const auto json = nlohmann::json::parse(answer.substr(7));
  EXPECT_EQ(json.at("state"), "paused");
  EXPECT_EQ(json.at("fault_joint"), "B");
  EXPECT_EQ(json.at("plan_time"), 1.25);
  EXPECT_EQ(server_->counters().commands, 2u);
  EXPECT_EQ(server_->counters().bad, 4u);
}

TEST_F(OperatorSocket, ServesASecondClientWhileTheFirstSaysNothing) {
  serve();
  control();
  const int silent = connect_raw(settings_.socket);
  say_raw(silent, "ar");
  EXPECT_EQ(ask("arm"), "done");
  say_raw(silent, "m\n");
  EXPECT_EQ(hear_raw(silent), "done\n");
  close(silent);
}

TEST_F(OperatorSocket, AStatusIsAnsweredWhileACommandWaits) {
  serve();  // nobody takes commands
  const int waiting = connect_raw(settings_.socket);
  say_raw(waiting, "arm\n");
  EXPECT_TRUE(ask("status").starts_with("status "));
  control();
  EXPECT_EQ(hear_raw(waiting), "done\n");
  close(waiting);
}

TEST_F(OperatorSocket, TooManyWaitingCommandsAreRefused) {
  serve();
  std::vector<int> clients;
  for (int i = 0; i < 16; ++i) {
    clients.push_back(connect_raw(settings_.socket));
    say_raw(clients.back(), "arm\n");
  }
  const auto full = [&] { return server_->counters().commands == 16; };
  for (int i = 0; i < 2000 && !full(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_THAT(ask("estop"), HasSubstr("refused too many"));
  for (const int fd : clients) close(fd);
}

TEST_F(OperatorSocket, ForgetsWhoTakesTooLong) {
  serve();
  const int silent = connect_raw(settings_.socket);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(hear_raw(silent), "");
  const double waited =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_GT(waited, 1.5);
  close(silent);
}

TEST_F(OperatorSocket, AFloodDoesNotShutTheOperatorOut) {
  serve();
  control();
  // From a process of its own, as a hostile client would be.
  const pid_t flood = fork();
  if (flood == 0) {
    std::vector<int> open;
    for (int i = 0; i < 1000; ++i) {
      open.push_back(connect_raw(settings_.socket));
      if (i % 3 == 0) say_raw(open.back(), std::string(static_cast<std::size_t>(i), '\xff'));
      if (i % 50 == 0) usleep(1000);
    }
    _exit(0);
  }
  for (int i = 0; i < 10; ++i) EXPECT_EQ(ask("arm"), "done") << i;
  int status = 0;
  waitpid(flood, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(ask("arm"), "done");
  EXPECT_GT(server_->counters().dropped, 500u);
}

TEST_F(OperatorSocket, HasItsPermissions) {
  settings_.mode = 0660;
  serve();
  struct stat found {};
  ASSERT_EQ(lstat(settings_.socket.c_str(), &found), 0);
  EXPECT_TRUE(S_ISSOCK(found.st_mode));
  EXPECT_EQ(found.st_mode & 0777U, 0660u);
  server_.reset();
  EXPECT_FALSE(fs::exists(settings_.socket));
  settings_.mode = 0600;
  settings_.group = "nogroup";
  if (geteuid() != 0) GTEST_SKIP() << "the group part: only root may give files away";
  serve();
  ASSERT_EQ(lstat(settings_.socket.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 0777U, 0600u);
  EXPECT_EQ(found.st_gid, getgrnam("nogroup")->gr_gid);
}

TEST_F(OperatorSocket, TakesNoPathThatIsNotItsOwn) {
  std::ofstream(settings_.socket) << "a file";
  EXPECT_THAT(refusal(), HasSubstr("exists and is no socket"));
  EXPECT_TRUE(fs::exists(settings_.socket));
  fs::remove(settings_.socket);
  fs::create_symlink(folder_ / "elsewhere", settings_.socket);
  EXPECT_THAT(refusal(), HasSubstr("is a symbolic link"));
  fs::remove(settings_.socket);
  settings_.group = "no such group";
  EXPECT_THAT(refusal(), HasSubstr("there is no group 'no such group'"));
  settings_.group.clear();
  settings_.socket = (folder_ / "missing" / "x.sock").string();
  EXPECT_THAT(refusal(), HasSubstr("there is no folder"));
  settings_.socket = "/tmp/" + std::string(200, 'x');
  EXPECT_THAT(refusal(), HasSubstr("characters expected"));
  EXPECT_TRUE(fs::is_empty(folder_));  // nothing half made is left behind
}

TEST_F(OperatorSocket, ReplacesADeadOneAndRefusesALiveOne) {
  // What a process leaves that was killed.
  if (const pid_t dead = fork(); dead == 0) {
    (void)listen_for_operator(settings_).release();
    _exit(0);
  } else {
    waitpid(dead, nullptr, 0);
  }
  ASSERT_TRUE(fs::exists(settings_.socket));
  EXPECT_THROW((void)ask("status"), InputError);
  serve();
  EXPECT_TRUE(ask("status").starts_with("status "));
  OperatorDesk other;
  try {
    const OperatorServer second(settings_, other, {});
    ADD_FAILURE() << "two controllers at one socket";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("another controller serves it"));
  }
  EXPECT_TRUE(ask("status").starts_with("status "));
}

TEST_F(OperatorSocket, TheClientSaysWhatIsWrong) {
  const auto error = [&]() -> std::string {
    try {
      return ask("status", 0.3);
    } catch (const InputError& e) {
      return std::string("input: ") + e.what();
    } catch (const JobFailed& e) {
      return std::string("job: ") + e.what();
    }
  };
  EXPECT_THAT(error(), HasSubstr("input: operator socket"));
  EXPECT_THAT(error(), HasSubstr("no controller"));
  // Somebody listens and never answers.
  const Descriptor mute = listen_for_operator(settings_);
  EXPECT_THAT(error(), HasSubstr("job: "));
  EXPECT_THAT(error(), HasSubstr("no answer in time"));
}

// ---- the run behind the socket

class OperatedRun : public OperatorSocket {
 protected:
  /// The operator's answers and the state after each.
  std::string say(const std::string& line) { return ask(line, 20.0); }
  std::string state() {
    return nlohmann::json::parse(ask("status", 20.0).substr(7)).at("state").get<std::string>();
  }
  void start_run() {
    options_.realtime = true;
    options_.desk = &desk_;
    options_.stop = &end_;
    serve();
    run_ = std::thread([this] {
      report_ = execute(plan_.controller, bus_, options_);
      ended_ = true;
    });
    for (int i = 0; i < 5000 && state() != "disabled"; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  void end_run() {
    end_ = true;
    if (run_.joinable()) run_.join();
  }
  void TearDown() override {
    end_run();
    OperatorSocket::TearDown();
  }
  test::ShortPlan plan_;
  test::StillBus bus_{3};
  ExecutorOptions options_;
  ExecutorReport report_;
  std::atomic<bool> end_{false}, ended_{false};
  std::thread run_;
};

/// This process stands still for so long, all threads of it.
void stand_still(std::chrono::milliseconds time) {
  const pid_t child = fork();
  if (child == 0) {
    kill(getppid(), SIGSTOP);
    usleep(static_cast<useconds_t>(1000 * time.count()));
    kill(getppid(), SIGCONT);
    _exit(0);
  }
  waitpid(child, nullptr, 0);
}

// Whoever judges a version before there is torque must see that its loop is late.
TEST_F(OperatedRun, LateLooksForTheOperatorCount) {
  RunPulse pulse;
  std::atomic<int> told{0};
  options_.pulse = &pulse;
  options_.before_enable = [&] {
    EXPECT_EQ(bus_.enabled, 0);
    ++told;
  };
  start_run();
  const std::uint64_t before = pulse.overruns;
  stand_still(std::chrono::milliseconds(30));
  for (int i = 0; i < 5000 && pulse.overruns == before; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_GT(pulse.overruns, before);
  EXPECT_EQ(told, 0);
  EXPECT_EQ(say("arm"), "done");
  EXPECT_EQ(told, 1);
  EXPECT_GT(pulse.overruns, before);  // still those
  end_run();
}

TEST_F(OperatedRun, WaitsForTheOperatorAndObeysHim) {
  start_run();
  EXPECT_EQ(state(), "disabled");
  EXPECT_EQ(say("start"), "refused not while disabled");
  EXPECT_EQ(say("ack"), "refused there is no fault");
  EXPECT_EQ(bus_.enabled, 0);
  EXPECT_EQ(say("arm"), "done");
  EXPECT_EQ(bus_.enabled, 1);
  EXPECT_EQ(state(), "ready");
  EXPECT_EQ(say("arm"), "refused not while ready");
  EXPECT_EQ(say("pause"), "refused not while ready");
  EXPECT_EQ(say("start"), "done");
  EXPECT_EQ(say("pause"), "done");
  EXPECT_EQ(state(), "paused");
  EXPECT_EQ(say("resume"), "done");
  EXPECT_EQ(say("estop"), "done");
  EXPECT_THAT(say("start"), HasSubstr("refused fault, to be acknowledged first: emergency stop"));
  EXPECT_EQ(say("ack"), "done");
  EXPECT_EQ(say("disarm"), "done");
  EXPECT_EQ(state(), "disabled");
  end_run();
  EXPECT_TRUE(report_.stopped);
}

TEST_F(OperatedRun, AnEmergencyStopBeforeArmingIsKept) {
  start_run();
  EXPECT_EQ(say("estop"), "done");
  EXPECT_EQ(state(), "fault");
  EXPECT_THAT(say("arm"), HasSubstr("refused fault, to be acknowledged first"));
  EXPECT_EQ(bus_.enabled, 0);
  EXPECT_EQ(say("ack"), "done");
  EXPECT_EQ(say("arm"), "done");
}

TEST_F(OperatedRun, ExecutesThePlanToItsEnd) {
  start_run();
  EXPECT_EQ(say("arm"), "done");
  EXPECT_EQ(say("start"), "done");
  for (int i = 0; i < 30'000 && !ended_; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  end_run();
  EXPECT_EQ(report_.status, TickStatus::kFinished);
  EXPECT_FALSE(report_.stopped);
}

TEST_F(OperatedRun, AnEstopEndsTheSwitchingOnOfDrives) {
  bus_.slow_to_enable = true;
  start_run();
  std::thread arms([this] { EXPECT_THAT(say("arm"), HasSubstr("refused fault, to be ack")); });
  while (bus_.enabled == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(say("start"), "refused not while the drives are being switched on");
  EXPECT_EQ(say("estop"), "done");
  arms.join();
  EXPECT_EQ(state(), "fault");
  EXPECT_THAT(say("arm"), HasSubstr("refused fault, to be acknowledged first: emergency stop"));
  EXPECT_EQ(bus_.enabled, 1);
  bus_.slow_to_enable = false;
  EXPECT_EQ(say("ack"), "done");
  EXPECT_EQ(say("arm"), "done");
  EXPECT_EQ(bus_.enabled, 2);
  EXPECT_EQ(state(), "ready");
}

TEST_F(OperatedRun, TheSwitchingOnOfDrivesDoesNotOutlastTheRun) {
  bus_.slow_to_enable = true;
  start_run();
  std::thread arms([this] {
    // Nobody is left to answer.
    EXPECT_THROW((void)say("arm"), std::exception);
  });
  while (bus_.enabled == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  end_run();
  server_.reset();
  arms.join();
  EXPECT_EQ(report_.bus, BusStatus::kDown);
  EXPECT_TRUE(report_.stopped);
  EXPECT_EQ(report_.ticks, 0u);
}

/// Connections, garbage, half lines, endless lines, questions, until killed.
[[noreturn]] void be_hostile(const std::string& path) {
  std::mt19937 random(3);
  for (int i = 0;; ++i) {
    const int fd = connect_raw(path);
    if (fd < 0) continue;
    switch (i % 4) {
      case 0:
        break;  // half open
      case 1:
        say_raw(fd, std::string(random() % 70'000, static_cast<char>(random())));
        break;
      case 2:
        say_raw(fd, "status\n");
        break;
      default:
        say_raw(fd, "est");
    }
    if (i % 4 != 0 || i > 500) close(fd);
  }
}

TEST_F(OperatedRun, AHostileClientDoesNotChangeACommand) {
  std::string logs[2];
  for (const bool attacked : {false, true}) {
    test::ShortPlan plan;
    test::StillBus bus(3);
    OperatorDesk desk;
    const OperatorServer server(settings_, desk, {"A", "B", "C"});
    // Taken one a tick: the same ticks in both runs.
    (void)desk.requests.put({.id = 1, .command = OperatorCommand::kArm});
    (void)desk.requests.put({.id = 2, .command = OperatorCommand::kStart});
    pid_t hostile = -1;
    if (attacked && (hostile = fork()) == 0) be_hostile(settings_.socket);
    const fs::path file = folder_ / "run.log";
    RunLogHeader header;
    header.dt = 1e-3;
    RunLogWriter log(file, header, log_capacity(plan.controller, true));
    ExecutorOptions options;
    options.realtime = true;
    options.runtime.guards = parse_guards("faults");
    options.bus_calls = BusCalls::kNone;
    options.desk = &desk;
    options.log = &log;
    const ExecutorReport report = execute(plan.controller, bus, options);
    EXPECT_EQ(report.status, TickStatus::kFinished);
    EXPECT_EQ(report.log_dropped, 0u);
    if (attacked) {
      EXPECT_GT(server.counters().clients, 100u);
      kill(hostile, SIGKILL);
      waitpid(hostile, nullptr, 0);
    }
    logs[attacked ? 1 : 0] = read_file(file);
  }
  EXPECT_GT(logs[0].size(), 1'000'000u);
  EXPECT_TRUE(logs[0] == logs[1]);
}

}  // namespace
}  // namespace clamber
