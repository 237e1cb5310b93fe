// StopGuard: who has asked a run to stop is not forgotten, nor does asking again kill its command.
#include <gtest/gtest.h>

#include <csignal>
#include <optional>

#include "apps/run_support.hpp"

namespace clamber {
namespace {

TEST(StopGuard, CommandHeedsSignalsAfterItsRun) {
  const StopGuard command;
  std::optional<StopGuard> run;
  run.emplace();
  EXPECT_FALSE(run->flag()->load());
  run.reset();
  std::raise(SIGTERM);  // without the command's own guard: the end of this program
  EXPECT_TRUE(command.flag()->load());
}

TEST(StopGuard, RunHearsWhatItsCommandWasTold) {
  const StopGuard command;
  std::raise(SIGINT);
  const StopGuard run;
  EXPECT_TRUE(run.flag()->load());
}

TEST(StopGuard, NextCommandBeginsAnew) {
  {
    const StopGuard told;
    std::raise(SIGTERM);
  }
  const StopGuard next;
  EXPECT_FALSE(next.flag()->load());
}

}  // namespace
}  // namespace clamber
