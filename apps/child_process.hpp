// Another program, run to its end or to the end of one's patience.
// Main thread; allocates, blocks; throws JobFailed when it cannot be started.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace clamber {

struct ChildOptions {
  double patience = 300.0;                 ///< s, then it is killed; 0: no limit
  std::string input = {};                  ///< file for its standard input; empty: none
  bool capture = true;                     ///< its output; else it goes where this program's goes
  std::function<bool()> interrupted = {};  ///< ends it
};

struct ChildResult {
  int status = 0;      ///< exit code; 128 + signal
  std::string output;  ///< both streams, the last 64 KiB
  /// The last line it wrote, or what became of it: for a message.
  [[nodiscard]] std::string last_words() const;
};

[[nodiscard]] ChildResult run_child(const std::vector<std::string>& command,
                                    const ChildOptions& options = {});

}  // namespace clamber
