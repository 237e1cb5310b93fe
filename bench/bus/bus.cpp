// One tick's exchange of all joints of a bus map over its interfaces, the motor bus against the
// plainest C over the same interfaces with the same partner process, in turns.
//
// Usage: bus [bus map] [exchanges]   (tests/vcan/vcan_run --can 9 -- build/release/bench/bus/bus)
// Exit code 1: the motor bus's median is more than 1.5 times the plain one's.
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "bench/bus/plain_echo.h"
#include "bench/stopwatch.hpp"
#include "firmware_hal/socketcan/socketcan_bus.hpp"
#include "robot_model/loader.hpp"

namespace {

using namespace clamber;

struct Plain {
  std::vector<int> sockets;
  std::vector<unsigned> ids;
  std::vector<int> ids_per_bus;
};

Plain open_plain(const BusMap& map) {
  Plain plain;
  for (const Bus& bus : map.buses) {
    plain.sockets.push_back(plain_open(bus.interface.c_str()));
    if (plain.sockets.back() < 0) throw InputError(bus.interface + ": cannot be opened");
    plain.ids_per_bus.push_back(static_cast<int>(bus.drives.size()));
    for (const JointDrive& drive : bus.drives) plain.ids.push_back(drive.node);
  }
  return plain;
}

/// The partner: a process of its own that answers, whoever asks.
pid_t start_partner(const BusMap& map) {
  const pid_t child = fork();
  if (child != 0) return child;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const Plain plain = open_plain(map);
  plain_answer(plain.sockets.data(), static_cast<int>(plain.sockets.size()));
  std::exit(0);
}

constexpr std::int64_t kPatience = 100'000'000;  // ns, as in plain_exchange()

std::int64_t now_ns() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * std::int64_t{1'000'000'000} + t.tv_nsec;
}

struct Figures {
  std::vector<double> times;  ///< us
  double processor = 0.0;     ///< s, of this process
  int failed = 0;
};

template <typename F>
void measure(Figures& figures, int count, const F& exchange) {
  const bench::Stopwatch watch;
  for (int i = 0; i < count; ++i) {
    bool good = false;
    figures.times.push_back(bench::microseconds([&] { good = exchange(); }));
    figures.failed += good ? 0 : 1;
  }
  figures.processor += watch.elapsed().processor;
}

void print(const char* name, const Figures& f) {
  const auto count = static_cast<double>(f.times.size());
  std::printf("%-12s %9.1f %9.1f %9.1f %9.1f %12.1f %8d\n", name, bench::quantile(f.times, 0.5),
              bench::quantile(f.times, 0.9), bench::quantile(f.times, 0.99),
              bench::quantile(f.times, 1.0), 1e6 * f.processor / count, f.failed);
}

int run(int argc, char** argv) {
  // It switches on whatever is there.
  const char* vcan = std::getenv("CLAMBER_VCAN");
  if (vcan == nullptr || std::string(vcan) != "required")
    throw InputError("runs under tests/vcan/vcan_run only: elsewhere can0 may be a robot");
  const std::string source = CLAMBER_SOURCE_DIR;
  const RobotModel robot = load_robot(source + "/configs/robots/coman/robot.yaml");
  BusMap map = load_bus_map(argc > 1 ? argv[1] : source + "/configs/hal/coman_mit.yaml", robot);
  map.rate = 50.0;  // only for switching on: a busy machine must not end it there
  const int exchanges = argc > 2 ? std::atoi(argv[2]) : 10000;
  constexpr int kTurn = 500;  // exchanges before the other one has its turn

  const pid_t partner = start_partner(map);
  SocketCanBus buses(map);
  if (buses.bus().enable() == BusStatus::kDown) throw InputError(buses.trouble());
  const Plain plain = open_plain(map);
  std::vector<JointCommand> commands(static_cast<std::size_t>(map.joint_count));
  std::vector<JointState> states(commands.size());

  Figures ours;
  Figures theirs;
  for (int done = 0; done < exchanges; done += kTurn) {
    measure(theirs, kTurn, [&] {
      return plain_exchange(plain.sockets.data(), static_cast<int>(plain.sockets.size()),
                            plain.ids.data(), plain.ids_per_bus.data()) == 0;
    });
    // Each side's sockets also received what the other one's frames and answers were: they are
    // emptied outside the measurement.
    (void)buses.bus().exchange(commands, states, 0);
    // As patient as the other one, else the slow ones would be cut off.
    measure(ours, kTurn, [&] {
      return buses.bus().exchange(commands, states, now_ns() + kPatience) == BusStatus::kOk;
    });
    char frame[128];
    for (const int socket : plain.sockets)
      while (read(socket, frame, sizeof frame) > 0) {
      }
  }
  buses.bus().disable();
  kill(partner, SIGKILL);
  waitpid(partner, nullptr, 0);

  std::printf("%zu joints on %zu buses, %zu exchanges each, in turns of %d\n", commands.size(),
              map.buses.size(), ours.times.size(), kTurn);
  std::printf("%-12s %9s %9s %9s %9s %12s %8s\n", "us", "p50", "p90", "p99", "max", "processor",
              "failed");
  print("plain C", theirs);
  print("motor bus", ours);
  const double ratio = bench::quantile(ours.times, 0.5) / bench::quantile(theirs.times, 0.5);
  std::printf("ratio of the medians: %.2f (at most 1.5)\n", ratio);
  return ratio <= 1.5 && ours.failed <= static_cast<int>(ours.times.size() / 100) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bus: %s\n", error.what());
    return 2;
  }
}
