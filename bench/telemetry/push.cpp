// What telemetry costs the tick: one push, beside a plain copy of the same frame.
//
// Steady: the consumer runs in a thread of its own and takes the frames away as the publisher
// does. Full: every push is refused, the cost when the publisher has died.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <thread>
#include <vector>

#include "telemetry/port.hpp"

namespace clamber {
namespace {

void copy_frame(benchmark::State& state) {
  std::vector<TelemetryRecord> slots(4096);
  const TelemetryRecord frame;
  std::size_t next = 0;
  for (auto _ : state) {
    slots[next++ % slots.size()] = frame;
    benchmark::ClobberMemory();
  }
}
BENCHMARK(copy_frame);

void push_full(benchmark::State& state) {
  TelemetryMemory memory;
  TelemetryPort port(memory.block());
  const TelemetryFrame frame;
  while (port.push(frame, {})) {
  }
  for (auto _ : state) benchmark::DoNotOptimize(port.push(frame, {}));
}
BENCHMARK(push_full);

/// Paced like the tick, so that caches cool down in between as they do there: single pushes are
/// timed, the clock's own cost (about 25 ns) included.
void push_at_one_kilohertz(benchmark::State& state) {
  using Clock = std::chrono::steady_clock;
  TelemetryMemory memory;
  TelemetryPort port(memory.block());
  std::jthread consumer([&memory](const std::stop_token& stop) {
    RingConsumer<TelemetryRecord> ring(memory.block().records, memory.block().record_positions);
    std::array<TelemetryRecord, 10> out;
    while (!stop.stop_requested()) {
      while (ring.pop(out) > 0) benchmark::DoNotOptimize(out);
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  const TelemetryFrame frame;
  std::vector<double> nanoseconds;
  nanoseconds.reserve(100'000);
  for (auto _ : state) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const auto before = Clock::now();
    benchmark::DoNotOptimize(port.push(frame, {}));
    const std::chrono::duration<double, std::nano> took = Clock::now() - before;
    nanoseconds.push_back(took.count());
    state.SetIterationTime(took.count() * 1e-9);
  }
  std::sort(nanoseconds.begin(), nanoseconds.end());
  state.counters["p50_ns"] = nanoseconds[nanoseconds.size() / 2];
  state.counters["p99_ns"] = nanoseconds[nanoseconds.size() * 99 / 100];
  state.counters["dropped"] = static_cast<double>(memory.block().record_positions.dropped.load());
}
BENCHMARK(push_at_one_kilohertz)->UseManualTime()->Iterations(5000);

}  // namespace
}  // namespace clamber
