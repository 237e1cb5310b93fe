// Runs a recorded climb through the control loop and compares every block of ticks with the host's
// checksum. Exit code 0: all the same bits; 1: not, the block's records are in the mismatch file;
// 2: the stream is none for this program.
#include <algorithm>
#include <array>
#include <new>

#include "control/crc32c.hpp"
#include "firmware_hal/bare_metal/climb_loop.hpp"
#include "firmware_hal/bare_metal/mps2_an500/semihosting.hpp"

std::size_t stack_used() noexcept;
extern "C" [[noreturn]] void run();

namespace {

using namespace clamber;

constexpr const char* kStream = "climb.stream";
constexpr const char* kMismatch = "mismatch.bin";

// Plan image, spline workspace, checksums, and a block's states and records.
alignas(8) std::array<std::byte, 3u << 20> arena;
std::size_t arena_used = 0;
StreamHeader header;
alignas(ClimbLoop) std::array<std::byte, sizeof(ClimbLoop)> loop_memory;

[[noreturn]] void refuse(const char* why) {
  semihosting::print("refused: ");
  semihosting::print(why);
  semihosting::print("\n");
  semihosting::exit(2);
}

template <class T>
std::span<T> take(std::size_t count) {
  const std::size_t bytes = (count * sizeof(T) + 7u) & ~std::size_t{7};
  if (bytes > arena.size() - arena_used) refuse("the stream does not fit into the memory");
  const std::span<T> taken(reinterpret_cast<T*>(arena.data() + arena_used), count);
  arena_used += bytes;
  return taken;
}

void read(std::int32_t file, std::span<std::byte> bytes) {
  if (!semihosting::read(file, bytes)) refuse("the stream ends early");
}

template <class T>
std::span<T> read_some(std::int32_t file, std::size_t count) {
  const std::span<T> taken = take<T>(count);
  read(file, std::as_writable_bytes(taken));
  return taken;
}

// SysTick counts the processor's clock down in 24 bits. The emulator, run with -icount, advances
// that clock with the instructions executed.
volatile std::uint32_t* const kSysTick = reinterpret_cast<volatile std::uint32_t*>(0xE000E010u);
std::uint32_t clock_now() { return kSysTick[2]; }
std::uint32_t counts_since(std::uint32_t start) { return (start - clock_now()) & 0xFFFFFFu; }
void start_clock() {
  kSysTick[1] = 0xFFFFFFu;
  kSysTick[2] = 0;
  kSysTick[0] = 5;  // on, processor clock, no interrupt
}

/// Instructions per count of the clock, from a loop of two that is known to the instruction.
std::uint32_t instructions_per_count() {
  std::uint32_t turns = 500'000;
  const std::uint32_t start = clock_now();
  asm volatile("1: subs %0, #1\n bne 1b" : "+l"(turns) : : "cc");
  const std::uint32_t counts = counts_since(start);
  return counts == 0 ? 0 : (1'000'000 + counts / 2) / counts;
}

/// Counts of the clock.
struct Cost {
  std::uint64_t sum = 0;
  std::uint32_t most = 0;
};
std::array<Cost, kLoopParts> costs;
std::uint32_t part_began = 0;

void part_done(LoopPart part) {
  const std::uint32_t counts = counts_since(part_began);
  Cost& cost = costs[static_cast<std::size_t>(part)];
  cost.sum += counts;
  cost.most = std::max(cost.most, counts);
  part_began = clock_now();
}

void print_line(const char* what, std::uint64_t number, const char* unit) {
  semihosting::print(what);
  semihosting::print(number);
  semihosting::print(unit);
}

void tell(std::uint32_t scale) {
  constexpr std::array<const char*, kLoopParts> kNames{
      "  drives      ", "  decode      ", "  control     ", "  encode      ", "  record      "};
  print_line("ticks:        ", header.tick_count, ", all outputs as on the host\n");
  print_line("instructions per tick, mean and most (", scale, " to a count of the clock):\n");
  for (std::size_t i = 0; i < kLoopParts; ++i) {
    print_line(kNames[i], costs[i].sum * scale / header.tick_count, " ");
    print_line("", std::uint64_t{costs[i].most} * scale, "\n");
  }
  print_line("stack:        ", stack_used(), " bytes\n");
  print_line("loop object:  ", sizeof(ClimbLoop), " bytes\n");
  print_line("plan:         ", header.image_bytes, " bytes of image\n");
}

[[noreturn]] void report_mismatch(std::uint32_t block, std::span<const std::byte> records) {
  const std::int32_t file = semihosting::open(kMismatch, semihosting::kWriteBinary);
  static_cast<void>(semihosting::write(file, std::as_bytes(std::span(&block, 1))));
  static_cast<void>(semihosting::write(file, records));
  call(semihosting::kClose, &file);
  print_line("MISMATCH in block ", block, "\n");
  semihosting::exit(1);
}

}  // namespace

extern "C" [[noreturn]] void run() {
  const std::int32_t file = semihosting::open(kStream, semihosting::kReadBinary);
  if (file < 0) refuse("no file climb.stream");
  read(file, std::as_writable_bytes(std::span(&header, 1)));
  if (header.magic != StreamHeader().magic || header.header_bytes != sizeof(StreamHeader) ||
      header.state_bytes != sizeof(JointState) || header.joint_count > kMaxJoints)
    refuse("a stream of another layout");
  const std::size_t joints = header.joint_count;
  const auto image = read_some<std::byte>(file, header.image_bytes);
  const auto checksums = read_some<std::uint32_t>(file, header.block_count());
  const auto workspace =
      take<double>(Controller::workspace_size(header.image_bytes / sizeof(ImageKeyframe)));
  const auto states = take<JointState>(header.block_ticks * joints);
  const auto records = take<std::byte>(header.block_ticks * record_size(joints));

  auto& loop = *new (loop_memory.data()) ClimbLoop(header, part_done);
  start_clock();
  const std::uint32_t scale = instructions_per_count();
  std::uint32_t tick = 0;
  for (std::uint32_t block = 0; block < header.block_count(); ++block) {
    const std::uint32_t ticks = std::min(header.block_ticks, header.tick_count - tick);
    read(file, std::as_writable_bytes(states.first(ticks * joints)));
    if (block == 0 && loop.start(image, workspace, states.first(joints)).status != LoadStatus::kOk)
      refuse("the controller does not accept the plan");
    if (block == 0) costs = {};  // switching the drives on is no tick
    for (std::uint32_t i = 0; i < ticks; ++i) {
      part_began = clock_now();
      loop.tick(states.subspan(i * joints, joints),
                records.subspan(i * record_size(joints), record_size(joints)));
    }
    const auto block_records = records.first(ticks * record_size(joints));
    if (crc32c(block_records) != checksums[block]) report_mismatch(block, block_records);
    tick += ticks;
  }
  tell(scale);
  semihosting::exit(0);
}
