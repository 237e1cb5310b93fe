#include "apps/progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace clamber {
namespace {

constexpr int kBar = 30;  // characters

}  // namespace

Progress::Progress(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { clear(); }

double Progress::elapsed() const {
  return std::chrono::duration<double>(Clock::now() - start_).count();
}

void Progress::stage(const std::string& name) {
  clear();
  what_.clear();
  percent_ = -1;
  if (!quiet_) std::fprintf(stderr, "[%6.1f s] %s\n", elapsed(), name.c_str());
}

void Progress::update(double share, const std::string& what) {
  if (quiet_) return;
  const int percent = static_cast<int>(100.0 * std::clamp(share, 0.0, 1.0));
  if (!terminal_) {
    if (percent <= percent_) return;
    percent_ = percent;
    std::fprintf(stderr, "[%6.1f s]   %3d %% %s\n", elapsed(), percent, what.c_str());
    return;
  }
  const std::string bar(static_cast<std::size_t>(percent * kBar / 100), '#');
  if (what == what_ && percent == percent_) return;
  what_ = what;
  percent_ = percent;
  std::fprintf(stderr, "\r\033[K[%-*s] %3d %% %.40s", kBar, bar.c_str(), percent, what.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

void Progress::clear() {
  if (drawn_) std::fprintf(stderr, "\r\033[K");
  drawn_ = false;
}

}  // namespace clamber
