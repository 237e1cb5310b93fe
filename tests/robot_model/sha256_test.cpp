#include "robot_model/sha256.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

// FIPS 180-4 example messages (published by NIST with the standard).
TEST(Sha256, MatchesTheStandardsVectors) {
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_hex(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, HashesEveryByteOfAFile) {
  const auto file = std::filesystem::path(testing::TempDir()) / "clamber_sha256_test.bin";
  const std::string bytes("line\r\n\0\xff end", 12);
  std::ofstream(file, std::ios::binary).write(bytes.data(), 12);
  EXPECT_EQ(sha256_file(file), sha256_hex(bytes));
  std::filesystem::remove(file);
  EXPECT_THROW((void)sha256_file(file), InputError);
}

}  // namespace
}  // namespace clamber
