// A flash that is killed, or that loses its power, at every change it makes to the file system.
#include <gtest/gtest.h>

#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <optional>

#include "apps/job_failed.hpp"
#include "tests/deploy/crash_lab.hpp"
#include "tests/deploy/flash_world.hpp"

namespace clamber {
namespace {

void flash(const FlashWorld& world, const std::string& version, FlashHooks hooks = {}) {
  Flasher(world.root(), std::move(hooks)).flash(world.bundle(version), {});
}

/// What is interrupted, from which state, and what may be in use afterwards.
struct Story {
  const char* name;
  std::vector<std::string> before;  ///< flashed before
  void (*work)(const FlashWorld&);
  std::string from, to;  ///< in use before and after
};
void PrintTo(const Story& story, std::ostream* out) { *out << story.name; }

void flash_v3(const FlashWorld& world) { flash(world, "v3"); }
void flash_sick(const FlashWorld& world) {
  FlashHooks hooks;
  hooks.gate = [](const std::string&) { throw JobFailed("it is sick"); };
  EXPECT_THROW(flash(world, "v3", hooks), JobFailed);
}
void roll_back(const FlashWorld& world) {
  Flasher(world.root(), {}).roll_back("asked for", false, false);
}

const Story kStories[] = {
    {"the first flash", {}, flash_v3, "", "v3"},
    {"a flash", {"v1", "v2"}, flash_v3, "v2", "v3"},
    {"a flash that does not come up", {"v1", "v2"}, flash_sick, "v2", "v2"},
    {"the first flash, which does not come up", {}, flash_sick, "", ""},
    {"a rollback", {"v1", "v2"}, roll_back, "v2", "v1"},
};

void prepare(const FlashWorld& world, const Story& story) {
  world.reset();
  for (const std::string& version : story.before) flash(world, version);
}

/// What must be true whenever somebody looks.
void expect_sound(const FlashWorld& world, const Story& story) {
  const std::string now = world.in_use();
  // On trial: the new one, complete, until somebody recovers.
  EXPECT_TRUE(now == story.from || now == story.to || now == "v3") << "in use: '" << now << "'";
  world.expect_no_half_slot();
}

/// And what follows: a machine that starts again, and the next flash.
void expect_recovery(const FlashWorld& world, const Story& story) {
  Flasher(world.root(), {}).recover();
  const std::string now = world.in_use();
  EXPECT_TRUE(now == story.from || now == story.to) << "in use after recovery: '" << now << "'";
  world.expect_no_half_slot();
  flash(world, "v4");
  EXPECT_EQ(world.in_use(), "v4");
  world.expect_no_half_slot();
  EXPECT_FALSE(SlotStore(world.root()).load_state().trial);
  for (const auto& entry : fs::directory_iterator(world.root() / "opt/clamber/slots"))
    EXPECT_TRUE(entry.path().filename() == "a" || entry.path().filename() == "b") << entry.path();
}

/// Without recover() before it.
void expect_next_flash(const FlashWorld& world) {
  flash(world, "v4");
  EXPECT_EQ(world.in_use(), "v4");
  world.expect_no_half_slot();
}

/// @return the number of changes
std::uint64_t crash_everywhere(const FlashWorld& world, const Story& story, Crash crash) {
  prepare(world, story);
  const fs::path kept = world.folder() / "kept";
  fs::remove_all(kept);
  fs::copy(world.root(), kept, fs::copy_options::recursive | fs::copy_options::copy_symlinks);
  for (crash.at = 1;; ++crash.at) {
    SCOPED_TRACE(std::string(story.name) + ", change " + std::to_string(crash.at) + ", seed " +
                 std::to_string(crash.seed));
    fs::remove_all(world.root());
    fs::copy(kept, world.root(), fs::copy_options::recursive | fs::copy_options::copy_symlinks);
    const Outcome outcome = run_with(crash, world.root(), [&] { story.work(world); });
    EXPECT_NE(outcome, Outcome::kFailed);
    expect_sound(world, story);
    if (outcome != Outcome::kCrashed) {
      EXPECT_EQ(world.in_use(), story.to);
      return crash.at - 1;
    }
    if (crash.at % 2 == 0)
      expect_recovery(world, story);
    else
      expect_next_flash(world);
    if (testing::Test::HasFailure()) return crash.at;
  }
}

class FlashCrash : public testing::TestWithParam<Story> {
 protected:
  FlashCrash() {
    for (const char* version : {"v1", "v2", "v3", "v4"}) (void)world.bundle(version);
  }
  FlashWorld world;
};

TEST_P(FlashCrash, KilledAtEveryChange) {
  const std::uint64_t changes = crash_everywhere(world, GetParam(), {Crash::Kind::kKill, 0, 0});
  EXPECT_GT(changes, 15U);
  RecordProperty("changes", std::to_string(changes));
}

TEST_P(FlashCrash, PowerCutAtEveryChange) {
  std::uint64_t changes = 0;
  for (const std::uint64_t seed : {0U, 1U, 2U, 3U})
    changes += crash_everywhere(world, GetParam(), {Crash::Kind::kPowerCut, 0, seed});
  EXPECT_GT(changes, 60U);
  RecordProperty("changes", std::to_string(changes));
}

TEST_P(FlashCrash, KilledAfterEveryStep) {
  const Story& story = GetParam();
  if (story.work != flash_v3) return;
  for (int last = 1;; ++last) {
    SCOPED_TRACE("step " + std::to_string(last));
    prepare(world, story);
    const Outcome outcome = run_with({}, world.root(), [&] {
      int step = 0;
      FlashHooks hooks;
      const auto next = [&] {
        if (++step == last) kill(getpid(), SIGKILL);
      };
      hooks.step = [&](const std::string&) { next(); };
      hooks.preflight = [&](const fs::path&) { next(); };
      hooks.restart = next;
      hooks.gate = [&](const std::string&) { next(); };
      flash(world, "v3", hooks);
    });
    expect_sound(world, story);
    if (outcome == Outcome::kFinished) {
      EXPECT_GE(last, 15);
      return;
    }
    ASSERT_EQ(outcome, Outcome::kCrashed);
    expect_recovery(world, story);
  }
}

INSTANTIATE_TEST_SUITE_P(Stories, FlashCrash, testing::ValuesIn(kStories),
                         [](const auto& story) { return "s" + std::to_string(story.index); });

}  // namespace
}  // namespace clamber
