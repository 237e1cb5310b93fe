#include "telemetry/port.hpp"

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>

namespace clamber {
namespace {

[[noreturn]] void give_up(const char* what) {
  throw std::runtime_error(std::string("telemetry: ") + what + ": " + std::strerror(errno));
}

}  // namespace

TelemetryMemory::TelemetryMemory(Kind kind) {
  if (kind == Kind::kShared) {
    // Not in /dev/shm: that may be full, and what a killed process leaves there stays.
    file_ = memfd_create("clamber-telemetry", MFD_CLOEXEC);
    if (file_ < 0) give_up("no shared memory");
    if (ftruncate(file_, sizeof(TelemetryBlock)) != 0) {
      close(file_);
      give_up("no shared memory");
    }
  }
  map(kind == Kind::kShared ? MAP_SHARED : MAP_PRIVATE | MAP_ANONYMOUS);
  new (block_) TelemetryBlock();
  block_->bytes = sizeof(TelemetryBlock);
}

TelemetryMemory::TelemetryMemory(int file) : file_(file) {
  struct stat status {};
  if (fstat(file_, &status) != 0 || status.st_size != static_cast<off_t>(sizeof(TelemetryBlock)))
    throw std::runtime_error("telemetry: the shared memory has another size than this program's");
  map(MAP_SHARED);
  if (block_->layout != TelemetryBlock::kLayout || block_->bytes != sizeof(TelemetryBlock)) {
    munmap(block_, sizeof(TelemetryBlock));
    throw std::runtime_error("telemetry: the shared memory is another program's");
  }
}

TelemetryMemory::~TelemetryMemory() {
  munmap(block_, sizeof(TelemetryBlock));
  if (file_ >= 0) close(file_);
}

void TelemetryMemory::map(int flags) {
  void* memory = mmap(nullptr, sizeof(TelemetryBlock), PROT_READ | PROT_WRITE, flags, file_, 0);
  if (memory == MAP_FAILED) {
    if (file_ >= 0) close(file_);
    give_up("no memory");
  }
  block_ = static_cast<TelemetryBlock*>(memory);
}

}  // namespace clamber
