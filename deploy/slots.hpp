// The two slots of a target and which one is in use, below ROOT/opt/clamber:
//   slots/a, slots/b   each absent or one complete, verified bundle
//   current            symbolic link to the slot in use; changes in one step
//   state.json         what is committed, what is on trial, what was found bad, what happened
// One thread, one process (FolderLock); allocates, blocks on the disk; throws JobFailed,
// InputError.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "deploy/bundle.hpp"
#include "deploy/manifest.hpp"

namespace clamber {

enum class Slot : unsigned char { kA, kB };
[[nodiscard]] const char* to_string(Slot slot) noexcept;
[[nodiscard]] inline Slot other(Slot slot) noexcept {
  return slot == Slot::kA ? Slot::kB : Slot::kA;
}

struct FlashEvent {
  std::string time;  ///< UTC, ISO 8601
  std::string what;  ///< flashed, rolled back, refused, interrupted, ...
  std::string name;  ///< of the bundle
  std::string id;
  std::string detail;
};

/// `current` points to `committed` unless something is on trial.
struct FlashState {
  std::optional<Slot> committed;
  std::optional<Slot> trial;
  std::vector<FlashEvent> bad;      ///< bundles that did not come up, refused from then on
  std::vector<FlashEvent> history;  ///< the last ones
};

/// What lies in a slot.
struct SlotContent {
  Manifest manifest;
  std::string id;
};

class SlotStore {
 public:
  explicit SlotStore(const std::filesystem::path& root);

  [[nodiscard]] std::filesystem::path folder() const { return folder_; }
  [[nodiscard]] std::filesystem::path slot(Slot slot) const;
  [[nodiscard]] std::filesystem::path current_link() const { return folder_ / "current"; }
  [[nodiscard]] std::filesystem::path lock_file() const { return folder_ / "lock"; }
  void make() const;

  /// The slot that `current` points to. @throws JobFailed when it points elsewhere
  [[nodiscard]] std::optional<Slot> current() const;
  void switch_to(std::optional<Slot> slot) const;

  [[nodiscard]] FlashState load_state() const;
  void save_state(const FlashState& state) const;

  /// Unpacks into a folder beside the slots, every byte durable, and returns it.
  [[nodiscard]] std::filesystem::path unpack(Bundle& bundle) const;
  /// The unpacked folder becomes the slot at once; what was in the slot is removed.
  void take_over(const std::filesystem::path& unpacked, Slot slot) const;
  /// Removes what an unpacking left that did not come to its end.
  void remove_leavings() const;

 private:
  [[nodiscard]] std::filesystem::path unpacked() const;

  std::filesystem::path folder_;
};

/// Reads the manifest in an unpacked folder; nullopt: there is none.
[[nodiscard]] std::optional<SlotContent> read_slot(const std::filesystem::path& folder);
/// Reads every file back from the disk: kind, mode, size, SHA-256, and nothing else is there.
/// @throws JobFailed
SlotContent verify_slot(const std::filesystem::path& folder);

}  // namespace clamber
