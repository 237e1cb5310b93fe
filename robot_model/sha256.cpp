#include "robot_model/sha256.hpp"

#include <openssl/evp.h>

#include <array>
#include <stdexcept>

#include "robot_model/read_file.hpp"

namespace clamber {

std::string sha256_hex(std::string_view text) {
  std::array<unsigned char, 32> digest{};
  unsigned int size = 0;
  if (EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1 ||
      size != digest.size()) {
    throw std::runtime_error("SHA-256 is not available in this build of libcrypto");
  }
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string hex;
  hex.reserve(2 * digest.size());
  for (const unsigned char byte : digest) {
    hex += kDigits[byte >> 4U];
    hex += kDigits[byte & 0xFU];
  }
  return hex;
}

std::string sha256_file(const std::filesystem::path& file) {
  return sha256_hex(read_file(file, kRunLogBytes));
}

}  // namespace clamber
