// Flashes a bundle into the slot that is not in use, tries it, and keeps it or goes back.
// One thread; allocates, blocks on disk and service; throws InputError (the bundle is refused and
// nothing has been changed) and JobFailed (it did not work; what was in use is in use).
//
// Killed or without power at any point: `current` leads to a slot that is complete and verified,
// and the next flash, or recover() when the machine starts, clears up.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "deploy/slots.hpp"
#include "deploy/target.hpp"

namespace clamber {

/// What a flash needs of the world around the slots. Each may be left out.
struct FlashHooks {
  /// A step has been done.
  std::function<void(const std::string& step)> step;
  /// The controller's state, if the drives have torque; else empty.
  std::function<std::string()> armed;
  /// Everything in the folder can be used. @throws what is wrong
  std::function<void(const std::filesystem::path& folder)> preflight;
  /// The service is started again from `current`. @throws JobFailed
  std::function<void()> restart;
  /// The bundle of that id runs and is well. @throws JobFailed
  std::function<void(const std::string& id)> gate;
};

struct FlashOptions {
  bool force = false;    ///< also a bundle that was found bad, or that is in use already
  bool dry_run = false;  ///< checks what can be checked without writing
};

class Flasher {
 public:
  Flasher(const std::filesystem::path& root, FlashHooks hooks);

  /// @return the bundle that is in use now
  SlotContent flash(const std::filesystem::path& bundle, const FlashOptions& options);
  /// Back to the other slot. @param why  for the history; @param bad  what is in use is remembered
  /// as bad
  SlotContent roll_back(const std::string& why, bool bad, bool force);
  /// Ends what was interrupted. @return what was done; empty: there was nothing to do
  std::string recover();

 private:
  void done(const std::string& step) const;
  void require_unarmed() const;
  /// @throws JobFailed when the drives have torque, or what the hook throws
  void restart() const;
  void require_acceptable(const Bundle& bundle, const FlashState& state,
                          const FlashOptions& options) const;
  void require_room(const Manifest& manifest) const;
  /// `current` leads to the slot, the service runs from it and is well; else all is as before.
  void try_slot(Slot slot, const SlotContent& content, const char* what);
  void give_up(Slot slot, const SlotContent& content, const std::string& why);
  std::string end_trial(FlashState& state) const;

  std::filesystem::path root_;
  FlashHooks hooks_;
  SlotStore store_;
};

}  // namespace clamber
