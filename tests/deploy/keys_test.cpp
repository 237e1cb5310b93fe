// Keys: made, read, pinned, followed when they are replaced.
#include <gmock/gmock.h>

#include "apps/job_failed.hpp"
#include "robot_model/loader.hpp"
#include "tests/deploy/flash_world.hpp"

namespace clamber {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(Keys, ANewKeyIsReadableByItsOwnerOnlyAndNeverOverwritten) {
  const FlashWorld world;
  const fs::path file = world.folder() / "deep/er/mine";
  const PublicKey key = new_key(file, "me@desk");
  struct stat found {};
  ASSERT_EQ(stat(file.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 07777U, 0600U);
  EXPECT_EQ(load_secret_key(file).public_key().bytes, key.bytes);
  EXPECT_EQ(load_public_key(file.string() + ".pub").line(), key.line());
  EXPECT_THAT([&] { new_key(file, "me"); },
              ThrowsMessage<InputError>(HasSubstr("never overwritten")));
  EXPECT_THAT([&] { new_key(world.folder() / "x", "a b"); },
              ThrowsMessage<InputError>(HasSubstr("key name")));
  fs::permissions(file, fs::perms::group_read, fs::perm_options::add);
  EXPECT_THAT([&] { (void)load_secret_key(file); },
              ThrowsMessage<InputError>(HasSubstr("chmod 600")));
}

TEST(Keys, ASignatureIsOfOneTextOnePurposeAndOneKey) {
  const FlashWorld world;
  const PublicKey stranger = new_key(world.folder() / "stranger", "stranger");
  const std::vector<PublicKey> trusted{world.key().public_key()};
  const std::string signature = sign("text", Purpose::kManifest, world.key());
  EXPECT_EQ(signature.size(), kSignatureBytes);
  EXPECT_EQ(check_signature(signature, "text", Purpose::kManifest, trusted, "it").name, "test");
  const auto refused = [&](const std::string& text, Purpose purpose,
                           const std::vector<PublicKey>& keys, const char* why) {
    EXPECT_THAT([&] { (void)check_signature(signature, text, purpose, keys, "it"); },
                ThrowsMessage<InputError>(HasSubstr(why)));
  };
  refused("texu", Purpose::kManifest, trusted, "is not valid");
  refused("text", Purpose::kRotation, trusted, "is not valid");
  refused("text", Purpose::kManifest, {stranger}, "not pinned here");
  refused("text", Purpose::kManifest, {}, "no key is pinned");
  for (std::size_t i = 0; i < signature.size(); ++i) {
    std::string bent = signature;
    bent[i] = static_cast<char>(bent[i] ^ 1);
    EXPECT_THROW(check_signature(bent, "text", Purpose::kManifest, trusted, "it"), InputError) << i;
  }
}

TEST(Keys, ARotationIsFollowedWhenAPinnedKeySignedIt) {
  const FlashWorld world;
  const PublicKey fresh = new_key(world.folder() / "fresh", "fresh");
  const SecretKey stranger = [&] {
    new_key(world.folder() / "stranger", "stranger");
    return load_secret_key(world.folder() / "stranger");
  }();
  const fs::path statement = world.folder() / "rotation";

  put(statement, rotation_statement(stranger, fresh));
  EXPECT_THROW(follow_rotation(world.root(), statement), InputError);
  const std::string good = rotation_statement(world.key(), fresh);
  for (std::size_t i = 0; i < good.size(); i += 7) {
    std::string bent = good;
    bent[i] = static_cast<char>(bent[i] ^ 2);
    put(statement, bent);
    EXPECT_THROW(follow_rotation(world.root(), statement), InputError) << i;
  }
  ASSERT_EQ(pinned_keys(world.root()).size(), 1U);

  put(statement, good);
  const Rotation rotation = follow_rotation(world.root(), statement);
  EXPECT_EQ(rotation.successor.bytes, fresh.bytes);
  ASSERT_EQ(pinned_keys(world.root()).size(), 1U);
  EXPECT_EQ(pinned_keys(world.root())[0].bytes, fresh.bytes);
  EXPECT_THROW(Flasher(world.root(), {}).flash(world.bundle("v1"), {}), InputError)
      << "the old key's";
  // Once followed it leads nowhere any more.
  EXPECT_THROW(follow_rotation(world.root(), statement), InputError);
  EXPECT_TRUE(unpin_key(world.root(), fresh.id()));
  EXPECT_FALSE(unpin_key(world.root(), fresh.id()));
}

}  // namespace
}  // namespace clamber
