#include "web/live_feed.hpp"

#include <algorithm>

namespace clamber {

void LiveFeed::push(std::span<const float> row) {
  {
    const std::lock_guard lock(mutex_);
    std::copy_n(row.begin(), std::min(row.size(), width_),
                rows_.begin() + static_cast<std::ptrdiff_t>(written_ % kRows * width_));
    ++written_;
  }
  more_.notify_all();
}

void LiveFeed::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  more_.notify_all();
}

bool LiveFeed::stopped() const {
  const std::lock_guard lock(mutex_);
  return stopped_;
}

std::vector<float> LiveFeed::read(std::uint64_t& position, std::size_t most,
                                  std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  // A position from before a restart of the server lies ahead of what this one has written.
  if (position > written_) position = 0;
  more_.wait_for(lock, timeout, [&] { return stopped_ || written_ > position; });
  position = std::max(position, written_ > kRows ? written_ - kRows : 0);
  const std::uint64_t end = std::min(written_, position + most);
  std::vector<float> rows;
  rows.reserve((end - position) * width_);
  for (; position < end; ++position) {
    const auto row = rows_.begin() + static_cast<std::ptrdiff_t>(position % kRows * width_);
    rows.insert(rows.end(), row, row + static_cast<std::ptrdiff_t>(width_));
  }
  return rows;
}

}  // namespace clamber
