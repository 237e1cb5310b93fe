// Keys that sign bundles (Ed25519) and the ones that a target trusts.
// Start-up and tools; allocates, reads and writes files; throws InputError, JobFailed.
//
// A key file is one line: `clamber-public-key BASE64 NAME` or, readable by its owner only,
// `clamber-secret-key BASE64 NAME`. A target trusts the public keys in etc/clamber/keys/.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace clamber {

struct PublicKey {
  std::array<unsigned char, 32> bytes{};
  std::string name;  ///< for people

  /// What is said for the key: 16 hexadecimal digits of its hash.
  [[nodiscard]] std::string id() const;
  [[nodiscard]] std::string line() const;  ///< as in its file
};

struct SecretKey {
  std::array<unsigned char, 64> bytes{};
  std::string name;

  SecretKey() = default;
  ~SecretKey();  ///< leaves nothing of it in memory
  SecretKey(const SecretKey&) = default;
  SecretKey& operator=(const SecretKey&) = default;

  [[nodiscard]] PublicKey public_key() const;
};

/// Writes `file` (mode 0600) and `file`.pub; neither may exist. @return the public one
PublicKey new_key(const std::filesystem::path& file, const std::string& name);

/// @throws InputError: unreadable, no key, or readable by others than its owner
[[nodiscard]] SecretKey load_secret_key(const std::filesystem::path& file);
[[nodiscard]] PublicKey load_public_key(const std::filesystem::path& file);

/// A signature as a line of kSignatureBytes. What it is for is signed with it, so that a signature
/// of one kind of text never passes for one of another.
enum class Purpose : unsigned char { kManifest, kRotation };
inline constexpr std::size_t kSignatureBytes = 124;
[[nodiscard]] std::string sign(std::string_view text, Purpose purpose, const SecretKey& key);

/// The key among `trusted` whose valid signature of `text` this is.
/// @throws InputError beginning with `what`: no signature, no such key, or not valid
[[nodiscard]] PublicKey check_signature(std::string_view signature, std::string_view text,
                                        Purpose purpose, const std::vector<PublicKey>& trusted,
                                        const std::string& what);

/// The statement that `successor` takes the place of the key that signs it.
[[nodiscard]] std::string rotation_statement(const SecretKey& old, const PublicKey& successor);

/// Below ROOT/etc/clamber/keys. @throws InputError when one of them is unusable
[[nodiscard]] std::vector<PublicKey> pinned_keys(const std::filesystem::path& root);
/// @return false when it was pinned before
bool pin_key(const std::filesystem::path& root, const PublicKey& key);
/// @return false when it was not pinned
bool unpin_key(const std::filesystem::path& root, const std::string& id);
/// Pins the successor, then takes the old key away: a crash between the two leaves both.
/// @throws InputError when a pinned key did not sign the statement
struct Rotation {
  PublicKey old;
  PublicKey successor;
};
Rotation follow_rotation(const std::filesystem::path& root, const std::filesystem::path& statement);

}  // namespace clamber
