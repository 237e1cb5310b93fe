#include "deploy/keys.hpp"

#include <sodium.h>
#include <sys/stat.h>

#include <algorithm>
#include <sstream>

#include "deploy/digest.hpp"
#include "deploy/durable.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPublic = "clamber-public-key";
constexpr const char* kSecret = "clamber-secret-key";
constexpr const char* kSignature = "clamber-signature";
constexpr const char* kRotation = "clamber-key-rotation";
constexpr std::uintmax_t kKeyFileBytes = 4096;

const char* context_of(Purpose purpose) {
  return purpose == Purpose::kManifest ? "clamber bundle manifest 1\n" : "clamber key rotation 1\n";
}

void require_sodium() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium cannot be used");
}

std::string base64(const unsigned char* bytes, std::size_t size) {
  std::string text(sodium_base64_encoded_len(size, sodium_base64_VARIANT_ORIGINAL), '\0');
  sodium_bin2base64(text.data(), text.size(), bytes, size, sodium_base64_VARIANT_ORIGINAL);
  text.pop_back();  // its terminating zero
  return text;
}

template <std::size_t kSize>
bool from_base64(std::string_view text, std::array<unsigned char, kSize>& bytes) {
  std::size_t size = 0;
  const char* end = nullptr;
  return sodium_base642bin(bytes.data(), kSize, text.data(), text.size(), nullptr, &size, &end,
                           sodium_base64_VARIANT_ORIGINAL) == 0 &&
         size == kSize && end == text.data() + text.size();
}

bool good_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && name[0] != '.' && name[0] != '-' &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-' || c == '@';
         });
}

/// The three words of a key's line, the first of which must be `kind`.
template <std::size_t kSize>
std::string read_key_line(const std::string& text, const char* kind, const std::string& file,
                          std::array<unsigned char, kSize>& bytes) {
  std::istringstream words(text);
  std::string found, key, name, more;
  words >> found >> key >> name;
  if (found != kind)
    throw InputError(file + ": no " + (kind == kSecret ? "secret" : "public") + " key, expected `" +
                     kind + " BASE64 NAME`");
  if (!from_base64(key, bytes) || !good_name(name) || words >> more)
    throw InputError(file + ": the key is damaged, expected `" + kind + " BASE64 NAME`");
  return name;
}

PublicKey parse_public_key(const std::string& text, const std::string& file) {
  PublicKey key;
  key.name = read_key_line(text, kPublic, file, key.bytes);
  return key;
}

fs::path key_folder(const fs::path& root) { return root / "etc/clamber/keys"; }

std::string to_be_signed(std::string_view text, Purpose purpose) {
  return context_of(purpose) + std::string(text);
}

const unsigned char* raw(const std::string& text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

}  // namespace

std::string PublicKey::id() const {
  Digest digest;
  digest.add({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  return digest.hex().substr(0, 16);
}

std::string PublicKey::line() const {
  return std::string(kPublic) + ' ' + base64(bytes.data(), bytes.size()) + ' ' + name + '\n';
}

SecretKey::~SecretKey() { sodium_memzero(bytes.data(), bytes.size()); }

PublicKey SecretKey::public_key() const {
  PublicKey key;
  key.name = name;
  crypto_sign_ed25519_sk_to_pk(key.bytes.data(), bytes.data());
  return key;
}

PublicKey new_key(const fs::path& file, const std::string& name) {
  require_sodium();
  if (!good_name(name))
    throw InputError("key name '" + name + "': expected 1 to 64 of a-z A-Z 0-9 . _ - @");
  const fs::path beside = file.string() + ".pub";
  std::error_code error;
  for (const fs::path& path : {file, beside})
    if (fs::exists(fs::symlink_status(path, error)))
      throw InputError(path.string() + ": exists; a key is never overwritten");
  SecretKey secret;
  PublicKey key;
  key.name = name;
  crypto_sign_keypair(key.bytes.data(), secret.bytes.data());
  std::string line = std::string(kSecret) + ' ' + base64(secret.bytes.data(), secret.bytes.size()) +
                     ' ' + name + '\n';
  if (file.has_parent_path()) make_folders(file.parent_path());
  write_new_file(file, line, 0600);
  sodium_memzero(line.data(), line.size());
  write_new_file(beside, key.line(), 0644);
  sync_folder(file.parent_path());
  return key;
}

SecretKey load_secret_key(const fs::path& file) {
  require_sodium();
  struct stat found {};
  if (stat(file.c_str(), &found) == 0 && (found.st_mode & 077U) != 0)
    throw InputError(file.string() + ": others than its owner can read it: chmod 600 " +
                     file.string());
  SecretKey key;
  std::string text = read_file(file, kKeyFileBytes);
  key.name = read_key_line(text, kSecret, file.string(), key.bytes);
  sodium_memzero(text.data(), text.size());
  return key;
}

PublicKey load_public_key(const fs::path& file) {
  return parse_public_key(read_file(file, kKeyFileBytes), file.string());
}

std::string sign(std::string_view text, Purpose purpose, const SecretKey& key) {
  require_sodium();
  const std::string message = to_be_signed(text, purpose);
  std::array<unsigned char, crypto_sign_BYTES> signature{};
  crypto_sign_detached(signature.data(), nullptr, raw(message), message.size(), key.bytes.data());
  return std::string(kSignature) + ' ' + key.public_key().id() + ' ' +
         base64(signature.data(), signature.size()) + '\n';
}

PublicKey check_signature(std::string_view signature, std::string_view text, Purpose purpose,
                          const std::vector<PublicKey>& trusted, const std::string& what) {
  require_sodium();
  std::istringstream words{std::string(signature)};
  std::string kind, id, value;
  words >> kind >> id >> value;
  std::array<unsigned char, crypto_sign_BYTES> bytes{};
  if (kind != kSignature || id.size() != 16 || !from_base64(value, bytes) ||
      signature != std::string(kSignature) + ' ' + id + ' ' + value + '\n')
    throw InputError(what + ": is not signed, or its signature is damaged");
  if (trusted.empty())
    throw InputError(what + ": no key is pinned here: `clamber key pin KEY.pub` once");
  const auto key = std::find_if(trusted.begin(), trusted.end(),
                                [&](const PublicKey& k) { return k.id() == id; });
  if (key == trusted.end())
    throw InputError(what + ": signed by key " + id + ", which is not pinned here");
  const std::string message = to_be_signed(text, purpose);
  if (crypto_sign_verify_detached(bytes.data(), raw(message), message.size(), key->bytes.data()) !=
      0)
    throw InputError(what + ": its signature by key " + id + " (" + key->name + ") is not valid");
  return *key;
}

std::string rotation_statement(const SecretKey& old, const PublicKey& successor) {
  const std::string text =
      std::string(kRotation) + ' ' + old.public_key().id() + '\n' + successor.line();
  return text + sign(text, Purpose::kRotation, old);
}

std::vector<PublicKey> pinned_keys(const fs::path& root) {
  std::vector<PublicKey> keys;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(key_folder(root), error))
    if (entry.path().extension() == ".pub" && entry.path().filename().string()[0] != '.')
      keys.push_back(load_public_key(entry.path()));
  std::sort(keys.begin(), keys.end(),
            [](const PublicKey& a, const PublicKey& b) { return a.bytes < b.bytes; });
  return keys;
}

bool pin_key(const fs::path& root, const PublicKey& key) {
  const fs::path file = key_folder(root) / (key.id() + ".pub");
  std::error_code error;
  if (fs::exists(file, error)) return false;
  make_folders(file.parent_path());
  replace_file(file, key.line(), 0644);
  return true;
}

bool unpin_key(const fs::path& root, const std::string& id) {
  const fs::path file = key_folder(root) / (id + ".pub");
  std::error_code error;
  if (!fs::exists(file, error)) return false;
  remove_tree(file);
  sync_folder(file.parent_path());
  return true;
}

Rotation follow_rotation(const fs::path& root, const fs::path& statement) {
  const std::string text = read_file(statement, kKeyFileBytes), file = statement.string();
  const std::size_t first = text.find('\n');
  const std::size_t second = first == std::string::npos ? first : text.find('\n', first + 1);
  if (!text.starts_with(std::string(kRotation) + ' ') || second == std::string::npos)
    throw InputError(file + ": no statement of `clamber key rotate`");
  const std::string claim = text.substr(0, second + 1);
  const PublicKey old = check_signature(std::string_view(text).substr(second + 1), claim,
                                        Purpose::kRotation, pinned_keys(root), file);
  if (text.substr(0, first) != std::string(kRotation) + ' ' + old.id())
    throw InputError(file + ": names another old key than the one that signed it");
  Rotation rotation{old, parse_public_key(text.substr(first + 1, second - first), file)};
  pin_key(root, rotation.successor);
  if (rotation.successor.id() != old.id()) unpin_key(root, old.id());
  return rotation;
}

}  // namespace clamber
