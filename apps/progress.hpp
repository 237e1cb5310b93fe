// What a long job tells the terminal while it works.
// One thread; allocates; blocks on the terminal.
#pragma once

#include <chrono>
#include <string>
#include <utility>

namespace clamber {

/// Lines on standard error: "[   1.2 s] planning", and on a terminal a bar below the last one.
class Progress {
 public:
  explicit Progress(bool quiet = false);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// A new stage begins.
  void stage(const std::string& name);
  /// Share done of the current stage (0..1) and what is being done. Without a terminal: a line
  /// when the share is larger than ever in this stage (a search goes back and forth).
  void update(double share, const std::string& what);
  /// Takes the bar off the terminal.
  void clear();

  /// Runs the stage and returns how long it took, s.
  template <typename Work>
  double time(const std::string& name, Work&& work) {
    stage(name);
    const auto from = Clock::now();
    std::forward<Work>(work)();
    clear();
    return std::chrono::duration<double>(Clock::now() - from).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  [[nodiscard]] double elapsed() const;

  bool quiet_;
  bool terminal_;
  bool drawn_ = false;
  std::string what_;
  int percent_ = -1;
  Clock::time_point start_ = Clock::now();
};

}  // namespace clamber
