// SHA-256 of bytes that come in pieces.
// One thread; allocates: never; blocks: never.
#pragma once

#include <sodium.h>

#include <array>
#include <string>
#include <string_view>

namespace clamber {

class Digest {
 public:
  Digest() { crypto_hash_sha256_init(&state_); }
  void add(std::string_view bytes) {
    crypto_hash_sha256_update(&state_, reinterpret_cast<const unsigned char*>(bytes.data()),
                              bytes.size());
  }
  /// 64 lower-case hexadecimal digits; once.
  [[nodiscard]] std::string hex() {
    std::array<unsigned char, crypto_hash_sha256_BYTES> raw{};
    crypto_hash_sha256_final(&state_, raw.data());
    std::array<char, 2 * crypto_hash_sha256_BYTES + 1> text{};
    sodium_bin2hex(text.data(), text.size(), raw.data(), raw.size());
    return text.data();
  }

 private:
  crypto_hash_sha256_state state_{};
};

}  // namespace clamber
