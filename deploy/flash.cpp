#include "deploy/flash.hpp"

#include <sys/statvfs.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <iomanip>
#include <sstream>

#include "apps/job_failed.hpp"
#include "deploy/durable.hpp"
#include "deploy/keys.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBusy = "another flash is under way here";

std::string now() {
  const std::time_t time = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm utc{};
  gmtime_r(&time, &utc);
  std::ostringstream out;
  out << std::put_time(&utc, "%FT%TZ");
  return out.str();
}

FlashEvent event(const char* what, const SlotContent& content, std::string detail) {
  return {now(), what, content.manifest.name(), content.id, std::move(detail)};
}

const FlashEvent* find_bad(const FlashState& state, const std::string& id) {
  const auto found = std::find_if(state.bad.begin(), state.bad.end(),
                                  [&](const FlashEvent& e) { return e.id == id; });
  return found == state.bad.end() ? nullptr : &*found;
}

void forget_bad(FlashState& state, const std::string& id) {
  std::erase_if(state.bad, [&](const FlashEvent& e) { return e.id == id; });
}

}  // namespace

Flasher::Flasher(const fs::path& root, FlashHooks hooks)
    : root_(root), hooks_(std::move(hooks)), store_(root) {}

SlotContent Flasher::flash(const fs::path& file, const FlashOptions& options) {
  // Reads only, until the bundle is known to be one for this target and whole.
  const Target target = load_target(root_);
  Bundle bundle(file, pinned_keys(root_));
  done("signature of key " + bundle.signer().id() + " (" + bundle.signer().name + ")");
  require_match(bundle.manifest(), target, this_machine(), file.string());
  done("made for " + target.robot + " and this machine");
  bundle.read_files();
  done(std::to_string(bundle.manifest().files.size()) + " files whole");
  require_acceptable(bundle, store_.load_state(), options);
  require_unarmed();
  require_room(bundle.manifest());
  const SlotContent content{bundle.manifest(), bundle.id()};
  if (options.dry_run) return content;

  store_.make();
  const FolderLock lock(store_.lock_file(), kBusy);
  FlashState state = store_.load_state();
  if (const std::string found = end_trial(state); !found.empty()) done(found);
  const Slot slot = state.committed ? other(*state.committed) : Slot::kA;
  const fs::path unpacked = store_.unpack(bundle);
  done("unpacked");
  if (verify_slot(unpacked).id != bundle.id()) throw JobFailed("the manifest reads back otherwise");
  done("read back");
  try {
    if (hooks_.preflight) hooks_.preflight(unpacked);
  } catch (const std::exception& error) {
    store_.remove_leavings();
    throw JobFailed(content.manifest.name() + ": preflight: " + error.what());
  }
  done("preflight");
  require_unarmed();  // unpacking takes its time
  store_.take_over(unpacked, slot);
  done(std::string("slot ") + to_string(slot));
  try_slot(slot, content, "flashed");
  return content;
}

SlotContent Flasher::roll_back(const std::string& why, bool bad, bool force) {
  (void)load_target(root_);
  if (!fs::exists(store_.folder())) throw JobFailed("nothing has been flashed here");
  const FolderLock lock(store_.lock_file(), kBusy);
  FlashState state = store_.load_state();
  if (const std::string found = end_trial(state); !found.empty()) done(found);
  if (!state.committed) throw JobFailed("nothing has been flashed here");
  const Slot slot = other(*state.committed);
  const SlotContent content = verify_slot(store_.slot(slot));
  if (const FlashEvent* before = find_bad(state, content.id); before != nullptr && !force)
    throw JobFailed("slot " + std::string(to_string(slot)) + " holds " + content.manifest.name() +
                    ", which did not come up: " + before->detail + " (--force)");
  require_unarmed();
  if (bad) {
    const SlotContent now = verify_slot(store_.slot(*state.committed));
    forget_bad(state, now.id);
    state.bad.push_back(event("bad", now, why));
    store_.save_state(state);
  }
  try_slot(slot, content, "rolled back");
  return content;
}

std::string Flasher::recover() {
  if (!fs::exists(store_.folder())) return {};
  const FolderLock lock(store_.lock_file(), kBusy);
  FlashState state = store_.load_state();
  return end_trial(state);
}

void Flasher::try_slot(Slot slot, const SlotContent& content, const char* what) {
  FlashState state = store_.load_state();
  state.trial = slot;
  store_.save_state(state);
  done("on trial");
  store_.switch_to(slot);
  done("switched");
  try {
    restart();
    done("restarted");
    if (hooks_.gate) hooks_.gate(content.id);
    done("healthy");
  } catch (const std::exception& error) {
    give_up(slot, content, error.what());
  }
  state.committed = slot;
  state.trial.reset();
  forget_bad(state, content.id);
  state.history.push_back(event(what, content, std::string("slot ") + to_string(slot)));
  store_.save_state(state);
  done("committed");
}

void Flasher::give_up(Slot slot, const SlotContent& content, const std::string& why) {
  FlashState state = store_.load_state();
  store_.switch_to(state.committed);
  state.trial.reset();
  forget_bad(state, content.id);
  state.bad.push_back(event("bad", content, why));
  state.history.push_back(event("failed", content, why));
  store_.save_state(state);
  done(std::string("back from slot ") + to_string(slot));
  std::string after;
  try {
    restart();  // with nothing in use it only stops
  } catch (const std::exception& error) {
    after = std::string("; and then: ") + error.what();
  }
  std::string in_use = "nothing is in use, as before";
  if (state.committed)
    if (const std::optional<SlotContent> old = read_slot(store_.slot(*state.committed)))
      in_use = "back to " + old->manifest.name();
  throw JobFailed(content.manifest.name() + " did not come up: " + why + "; " + in_use + after);
}

std::string Flasher::end_trial(FlashState& state) const {
  store_.remove_leavings();
  if (!state.trial) return {};
  const Slot slot = *state.trial;
  const std::optional<SlotContent> content = read_slot(store_.slot(slot));
  const bool switched = store_.current() != state.committed;
  if (switched) store_.switch_to(state.committed);
  state.trial.reset();
  if (content)
    state.history.push_back(event("interrupted", *content, "a flash that did not come to its end"));
  store_.save_state(state);
  try {
    if (switched && state.committed) restart();
  } catch (const std::exception& error) {
    done(error.what());  // the slots are right again, which is what this is about
  }
  return "an interrupted flash of slot " + std::string(to_string(slot)) + " taken back";
}

void Flasher::done(const std::string& step) const {
  if (hooks_.step) hooks_.step(step);
}

void Flasher::require_unarmed() const {
  const std::string state = hooks_.armed ? hooks_.armed() : std::string();
  if (!state.empty())
    throw JobFailed("the drives have torque (" + state + "): `clamber disarm` first");
  done("drives are off");
}

void Flasher::restart() const {
  if (!hooks_.restart) return;
  // Somebody may have armed what is on trial: it would fall.
  const std::string state = hooks_.armed ? hooks_.armed() : std::string();
  if (!state.empty())
    throw JobFailed("not restarted, the drives have torque (" + state +
                    "): `clamber disarm`, then restart it");
  hooks_.restart();
}

void Flasher::require_acceptable(const Bundle& bundle, const FlashState& state,
                                 const FlashOptions& options) const {
  if (options.force) return;
  const std::string name = bundle.manifest().name();
  if (const FlashEvent* bad = find_bad(state, bundle.id()))
    throw InputError(name + ": did not come up here on " + bad->time + ": " + bad->detail +
                     " (--force)");
  if (!state.committed || state.trial) return;
  const std::optional<SlotContent> now = read_slot(store_.slot(*state.committed));
  if (now && now->id == bundle.id()) throw InputError(name + ": is in use already (--force)");
}

void Flasher::require_room(const Manifest& manifest) const {
  std::uint64_t wanted = std::uint64_t{16} << 20;
  for (const BundleFile& file : manifest.files) wanted += file.size + 4096;
  struct statvfs found {};
  const fs::path at = fs::exists(store_.folder()) ? store_.folder() : root_;
  if (statvfs(at.c_str(), &found) != 0) return;
  const std::uint64_t free = std::uint64_t{found.f_bavail} * found.f_frsize;
  if (free < wanted)
    throw JobFailed(at.string() + ": " + std::to_string(free >> 20) +
                    " MiB free, the bundle needs " + std::to_string(wanted >> 20));
  done("room on the disk");
}

}  // namespace clamber
