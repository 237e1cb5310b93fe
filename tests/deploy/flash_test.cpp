// The flash itself: what it does when all is well, and what is left when something is not.
#include <gmock/gmock.h>

#include <thread>

#include "apps/job_failed.hpp"
#include "robot_model/loader.hpp"
#include "tests/deploy/flash_world.hpp"

namespace clamber {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

class FlashTest : public testing::Test {
 protected:
  SlotContent flash(const std::string& version, FlashOptions options = {}) {
    return Flasher(world.root(), hooks).flash(world.bundle(version), options);
  }
  FlashState state() { return SlotStore(world.root()).load_state(); }

  FlashWorld world;
  FlashHooks hooks;
};

TEST_F(FlashTest, SlotsTakeTurns) {
  for (const char* version : {"v1", "v2", "v3"}) {
    EXPECT_EQ(flash(version).manifest.version, version);
    EXPECT_EQ(world.in_use(), version);
    world.expect_no_half_slot();
  }
  EXPECT_EQ(fs::read_symlink(world.root() / "opt/clamber/current"), "slots/a");
  EXPECT_EQ(FlashWorld::complete_version(world.root() / "opt/clamber/slots/b"), "v2");
  EXPECT_EQ(state().history.size(), 3U);
}

TEST_F(FlashTest, HooksAreAskedInOrderAndFromTheRightPlace) {
  std::vector<std::string> asked;
  hooks.armed = [&] { return asked.emplace_back("armed"), std::string(); };
  hooks.preflight = [&](const fs::path& folder) {
    asked.emplace_back("preflight");
    EXPECT_EQ(FlashWorld::complete_version(folder), "v1");
    EXPECT_EQ(world.in_use(), "");
  };
  hooks.restart = [&] {
    asked.emplace_back("restart");
    EXPECT_EQ(world.in_use(), "v1");
  };
  hooks.gate = [&](const std::string& id) {
    asked.emplace_back("gate");
    EXPECT_EQ(id.size(), 64U);
    EXPECT_TRUE(state().trial);
  };
  flash("v1");
  EXPECT_THAT(asked, ElementsAre("armed", "preflight", "armed", "armed", "restart", "gate"));
}

TEST_F(FlashTest, ADryRunChangesNothing) {
  flash("v1");
  const std::string before = tree_of(world.root());
  EXPECT_EQ(flash("v2", {.dry_run = true}).manifest.version, "v2");
  EXPECT_EQ(tree_of(world.root()), before);
}

TEST_F(FlashTest, RefusedWhileTheDrivesHaveTorque) {
  flash("v1");
  flash("v2");
  const std::string before = tree_of(world.root());
  hooks.armed = [] { return "following"; };
  EXPECT_THAT([&] { flash("v3"); }, ThrowsMessage<JobFailed>(HasSubstr("torque (following)")));
  EXPECT_THAT([&] { Flasher(world.root(), hooks).roll_back("", false, false); },
              ThrowsMessage<JobFailed>(HasSubstr("torque")));
  EXPECT_EQ(tree_of(world.root()), before);
}

// Somebody arms while the bundle is being unpacked.
TEST_F(FlashTest, AskedAgainBeforeTheSlotIsTaken) {
  flash("v1");
  flash("v2");
  bool armed = false;
  hooks.preflight = [&](const fs::path&) { armed = true; };
  hooks.armed = [&] { return armed ? std::string("holding") : std::string(); };
  EXPECT_THAT([&] { flash("v3"); }, ThrowsMessage<JobFailed>(HasSubstr("holding")));
  EXPECT_EQ(world.in_use(), "v2");
  EXPECT_EQ(FlashWorld::complete_version(world.root() / "opt/clamber/slots/a"), "v1");
}

// Somebody arms what is on trial, and then it fails: taken back, but not while it carries a robot.
TEST_F(FlashTest, WhatHasTorqueIsNotRestarted) {
  flash("v1");
  bool armed = false;
  int restarts = 0;
  hooks.restart = [&] { ++restarts; };
  hooks.gate = [&](const std::string&) {
    armed = true;
    throw JobFailed("a joint is not heard");
  };
  hooks.armed = [&] { return armed ? std::string("executing") : std::string(); };
  EXPECT_THAT([&] { flash("v2"); }, ThrowsMessage<JobFailed>(AllOf(
                                        HasSubstr("back to testbot v1; and then: not restarted"),
                                        HasSubstr("torque (executing)"))));
  EXPECT_EQ(world.in_use(), "v1");
  EXPECT_EQ(restarts, 1);
}

TEST_F(FlashTest, AFailedPreflightLeavesBothSlots) {
  flash("v1");
  flash("v2");
  const std::string before = tree_of(world.root());
  hooks.preflight = [](const fs::path&) { throw JobFailed("plans/climb: refused"); };
  EXPECT_THAT([&] { flash("v3"); },
              ThrowsMessage<JobFailed>(HasSubstr("v3: preflight: plans/climb")));
  EXPECT_EQ(tree_of(world.root()), before);
}

TEST_F(FlashTest, WhatDoesNotComeUpIsTakenBackAndRemembered) {
  flash("v1");
  std::vector<std::string> started;
  hooks.restart = [&] { started.push_back(world.in_use()); };
  hooks.gate = [](const std::string&) { throw JobFailed("a joint is not heard"); };
  EXPECT_THAT([&] { flash("v2"); },
              ThrowsMessage<JobFailed>(AllOf(HasSubstr("did not come up: a joint is not heard"),
                                             HasSubstr("back to testbot v1"))));
  EXPECT_THAT(started, ElementsAre("v2", "v1"));
  EXPECT_EQ(world.in_use(), "v1");
  hooks.gate = nullptr;
  const std::string before = tree_of(world.root());
  EXPECT_THAT([&] { flash("v2"); },
              ThrowsMessage<InputError>(HasSubstr("a joint is not heard (--force)")));
  EXPECT_EQ(tree_of(world.root()), before);
  EXPECT_THAT([&] { Flasher(world.root(), {}).roll_back("", false, false); },
              ThrowsMessage<JobFailed>(HasSubstr("which did not come up")));
  flash("v2", {.force = true});
  EXPECT_EQ(world.in_use(), "v2");
  EXPECT_THAT(state().bad, IsEmpty());
}

TEST_F(FlashTest, WhatCannotBeStartedIsTakenBackToo) {
  hooks.restart = [] { throw JobFailed("no such unit"); };
  EXPECT_THAT([&] { flash("v1"); },
              ThrowsMessage<JobFailed>(HasSubstr("nothing is in use, as before")));
  EXPECT_EQ(world.in_use(), "");
}

TEST_F(FlashTest, RollbackGoesToTheOtherSlotAndBack) {
  EXPECT_THAT([&] { Flasher(world.root(), {}).roll_back("", false, false); },
              ThrowsMessage<JobFailed>(HasSubstr("nothing has been flashed")));
  flash("v1");
  EXPECT_THAT([&] { Flasher(world.root(), {}).roll_back("", false, false); },
              ThrowsMessage<JobFailed>(HasSubstr("holds no bundle")));
  flash("v2");
  Flasher(world.root(), hooks).roll_back("asked for", false, false);
  EXPECT_EQ(world.in_use(), "v1");
  Flasher(world.root(), hooks).roll_back("asked for", false, false);
  EXPECT_EQ(world.in_use(), "v2");
  // What failed in operation is not gone back to.
  Flasher(world.root(), hooks).roll_back("kept failing", true, false);
  EXPECT_EQ(world.in_use(), "v1");
  EXPECT_THROW(Flasher(world.root(), hooks).roll_back("", false, false), JobFailed);
}

TEST_F(FlashTest, ADamagedSlotIsNotGoneBackTo) {
  flash("v1");
  flash("v2");
  const fs::path file = world.root() / "opt/clamber/slots/a/plans/climb/plan.json";
  put(file, "plan v2");
  EXPECT_THAT([&] { Flasher(world.root(), {}).roll_back("", false, false); },
              ThrowsMessage<JobFailed>(HasSubstr("another SHA-256")));
  put(file, "plan v1");
  put(file.parent_path() / "more", "");
  EXPECT_THAT([&] { Flasher(world.root(), {}).roll_back("", false, false); },
              ThrowsMessage<JobFailed>(HasSubstr("not in the manifest")));
  EXPECT_EQ(world.in_use(), "v2");
}

TEST_F(FlashTest, OneFlashAtATime) {
  hooks.gate = [&](const std::string&) {
    EXPECT_THAT([&] { Flasher(world.root(), {}).flash(world.bundle("v2"), {}); },
                ThrowsMessage<JobFailed>(HasSubstr("another flash")));
    EXPECT_THAT([&] { Flasher(world.root(), {}).recover(); },
                ThrowsMessage<JobFailed>(HasSubstr("another flash")));
  };
  flash("v1");
  EXPECT_EQ(world.in_use(), "v1");
}

TEST_F(FlashTest, TheSameBundleAgainOnlyWhenForced) {
  flash("v1");
  EXPECT_THAT([&] { flash("v1"); }, ThrowsMessage<InputError>(HasSubstr("in use already")));
  flash("v1", {.force = true});
  EXPECT_EQ(world.in_use(), "v1");
}

TEST_F(FlashTest, ATargetThatDoesNotSayWhatItIsTakesNothing) {
  fs::remove(target_file(world.root()));
  EXPECT_THAT([&] { flash("v1"); }, ThrowsMessage<InputError>(HasSubstr("clamber flash setup")));
}

}  // namespace
}  // namespace clamber
