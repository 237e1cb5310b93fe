// Bundles: the same bytes every time, readable by any tar, and refused when anything is wrong.
#include <gmock/gmock.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <random>

#include "deploy/ustar.hpp"
#include "robot_model/loader.hpp"
#include "tests/deploy/flash_world.hpp"

namespace clamber {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

class BundleTest : public testing::Test {
 protected:
  /// Flashing the file is refused with the text, in one line, and nothing changes.
  void expect_refused(const fs::path& file, const std::string& why) {
    const std::string before = tree_of(world.root());
    EXPECT_THAT([&] { Flasher(world.root(), {}).flash(file, {}); },
                ThrowsMessage<InputError>(AllOf(HasSubstr(why), Not(HasSubstr("\n")))));
    EXPECT_EQ(tree_of(world.root()), before);
  }

  fs::path changed(const std::string& bytes) {
    put(world.folder() / "changed.cfw", bytes);
    return world.folder() / "changed.cfw";
  }

  /// A bundle of any manifest text and any archive behind it, signed by a key that is trusted.
  fs::path forged(const std::string& manifest, const std::string& rest) {
    std::string bytes;
    append(bytes, "manifest.json", manifest);
    append(bytes, "manifest.sig", sign(manifest, Purpose::kManifest, world.key()));
    return changed(bytes + rest + std::string(2 * kUstarBlock, '\0'));
  }

  static void append(std::string& bytes, const std::string& path, const std::string& content) {
    const UstarHeader header = ustar_header(path, content.size(), false, 0);
    bytes.append(header.data(), header.size());
    bytes += content + std::string(ustar_padding(content.size()), '\0');
  }

  /// A bundle that is all right but for what `change` does to its manifest.
  fs::path with_manifest(const std::function<void(nlohmann::ordered_json&)>& change) {
    Manifest manifest = FlashWorld::manifest("v1");
    manifest.files = {{"readme", 2, false, kHash}};
    auto json = nlohmann::ordered_json::parse(format_manifest(manifest));
    change(json);
    std::string rest;
    append(rest, json["files"][0].value("path", "readme"), "hi");
    return forged(json.dump(1) + '\n', rest);
  }

  // Of "hi".
  static constexpr const char* kHash =
      "8f434346648f6b96df89dda901c5176b10a6d83961dd3c1ac88b59b2dc327aa4";
  FlashWorld world;
};

TEST_F(BundleTest, TheSameInputsGiveTheSameBytes) {
  std::vector<BundleSource> sources = FlashWorld::sources("v1");
  const std::string first = bytes_of(world.bundle("v1"));
  std::reverse(sources.begin(), sources.end());
  write_bundle(world.folder() / "again.cfw", FlashWorld::manifest("v1"), sources, world.key());
  EXPECT_EQ(bytes_of(world.folder() / "again.cfw"), first);
  sources[0].text += '!';
  write_bundle(world.folder() / "other.cfw", FlashWorld::manifest("v1"), sources, world.key());
  EXPECT_NE(bytes_of(world.folder() / "other.cfw"), first);
}

// An independent writer of the same format.
TEST_F(BundleTest, GnuTarWouldWriteTheSameBytes) {
  if (std::system("tar --version 2>/dev/null | grep -q GNU") != 0) GTEST_SKIP() << "no GNU tar";
  const fs::path folder = world.folder() / "listed";
  fs::create_directories(folder);
  const std::string in = "cd " + folder.string() + " && ";
  const std::string bundle = world.bundle("v1").string();
  ASSERT_EQ(std::system((in + "tar xf " + bundle).c_str()), 0);
  ASSERT_EQ(std::system((in +
                         "tar c --format=ustar -b1 --owner=0 --group=0 --numeric-owner --mtime=@0 "
                         "--mode=u=rwX,go=rX -f ../made.tar $(tar tf " +
                         bundle + ")")
                            .c_str()),
            0);
  EXPECT_EQ(bytes_of(world.folder() / "made.tar"), bytes_of(bundle));
}

TEST_F(BundleTest, CutOffAnywhereItIsRefused) {
  const std::string bytes = bytes_of(world.bundle("v1"));
  for (std::size_t length = 0; length < bytes.size(); length += length < 2048 ? 64 : 97)
    expect_refused(changed(bytes.substr(0, length)), "changed.cfw");
  expect_refused(changed(bytes.substr(0, bytes.size() - 1)), "is cut off");
  expect_refused(changed(bytes + '\0'), "goes on after its end");
  expect_refused(world.folder() / "absent.cfw", "no such file");
}

TEST_F(BundleTest, EveryFlippedBitIsRefused) {
  const std::string bytes = bytes_of(world.bundle("v1"));
  std::mt19937_64 random(7);
  const std::string before = tree_of(world.root());
  for (std::size_t i = 0; i < 2000; ++i) {
    std::string flipped = bytes;
    const std::size_t at = random() % bytes.size();
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << (random() % 8)));
    EXPECT_THROW(Flasher(world.root(), {}).flash(changed(flipped), {.dry_run = true}), InputError)
        << "byte " << at;
  }
  EXPECT_EQ(tree_of(world.root()), before);
}

TEST_F(BundleTest, SignatureIsDemanded) {
  const std::string bytes = bytes_of(world.bundle("v1"));
  const std::size_t size = ustar_size([&] {
    UstarHeader header{};
    std::copy_n(bytes.begin(), header.size(), header.begin());
    return header;
  }());
  const std::size_t signature = kUstarBlock + size + ustar_padding(size);
  expect_refused(changed(bytes.substr(0, signature) + bytes.substr(signature + 2 * kUstarBlock)),
                 "is not signed");
  std::string blank = bytes;
  blank.replace(signature + kUstarBlock, kSignatureBytes, kSignatureBytes, ' ');
  expect_refused(changed(blank), "is not signed");
  new_key(world.folder() / "foreign", "foreign");
  write_bundle(world.folder() / "foreign.cfw", FlashWorld::manifest("v1"),
               FlashWorld::sources("v1"), load_secret_key(world.folder() / "foreign"));
  expect_refused(world.folder() / "foreign.cfw", "which is not pinned here");
}

TEST_F(BundleTest, ABundleForSomethingElseIsRefused) {
  const auto refused = [&](const std::function<void(nlohmann::ordered_json&)>& change,
                           const char* why) { expect_refused(with_manifest(change), why); };
  refused([](auto& m) { m["robot"] = "other"; }, "is for robot 'other', this is 'testbot'");
  refused([](auto& m) { m["abi"] = 0; }, "is of bundle ABI 0");
  refused([](auto& m) { m["abi"] = 2; }, "update the clamber package here first");
  refused([](auto& m) { m["minimum_kernel"] = "99.1"; }, "needs Linux 99.1 or later");
  refused([](auto& m) { m["machine"] = "sparc"; }, "is for sparc");
  refused([](auto& m) { m["hardware"]["can1"] = {22}; },
          "is for other hardware: can0: 11 12, can1: 22; here:");
  refused([](auto& m) { m["format"] = "clamber-bundle-2"; }, "format");
  refused([](auto& m) { m["more"] = 1; }, "does not know");
  refused([](auto& m) { m.erase("version"); }, "version");
  Target target = load_target(world.root());
  target.model = std::string(64, 'b');
  put(target_file(world.root()), format_target(target));
  expect_refused(world.bundle("v1"), "is for another model of the robot");
}

// Signed, by a key that is trusted: the maker of the bundle is not a reason to write anywhere.
TEST_F(BundleTest, NoFileLeavesItsSlot) {
  const auto path = [&](const std::string& name, const char* why) {
    expect_refused(with_manifest([&](auto& m) { m["files"][0]["path"] = name; }), why);
  };
  path("../outside", "leads elsewhere");
  path("bin/../../outside", "leads elsewhere");
  path("a/./b", "leads elsewhere");
  path("/etc/passwd", "absolute path");
  path("a//b", "empty part");
  path("a/", "empty part");
  path(".hidden", "is hidden");
  path("", "empty or too long");
  path(std::string(100, 'a'), "empty or too long");
  path("a b", "plain characters");
  path("a\nb", "plain characters");
  path("manifest.sig", "own name");
  const auto entry = [](const std::string& name) {
    return nlohmann::ordered_json{{"path", name}, {"size", 2}, {"mode", "0644"}, {"sha256", kHash}};
  };
  expect_refused(with_manifest([&](auto& m) { m["files"].push_back(entry("readme")); }),
                 "listed twice");
  expect_refused(with_manifest([&](auto& m) { m["files"].push_back(entry("a")); }), "not in order");
  expect_refused(with_manifest([&](auto& m) { m["files"].push_back(entry("readme/x")); }),
                 "in another file");
}

TEST_F(BundleTest, OversizedIsRefused) {
  const auto entry = [&](std::uint64_t size) {
    return with_manifest([&](auto& m) { m["files"][0]["size"] = size; });
  };
  expect_refused(entry(kBundleFileBytes + 1), "is too large");
  expect_refused(entry(~std::uint64_t{0}), "is too large");
  expect_refused(entry(3), "stands where the manifest says");
  expect_refused(with_manifest([](auto& m) {
                   for (int i = 0; i < 3; ++i)
                     m["files"].push_back({{"path", "x" + std::to_string(i)},
                                           {"size", kBundleFileBytes},
                                           {"mode", "0644"},
                                           {"sha256", kHash}});
                 }),
                 "makes the bundle too large");
  expect_refused(with_manifest([](auto& m) { m["version"] = std::string(2 << 20, 'v'); }),
                 "no bundle");
  const fs::path huge = world.folder() / "huge.cfw";
  put(huge, "");
  fs::resize_file(huge, 3 * kBundleBytes);
  expect_refused(huge, "too large");
}

TEST_F(BundleTest, OnlyTheManifestsFilesAreInTheArchive) {
  Manifest manifest = FlashWorld::manifest("v1");
  manifest.files = {{"readme", 2, false, kHash}};
  const std::string text = format_manifest(manifest);
  const auto with_type = [](char type, const std::string& path) {
    UstarHeader header = ustar_header(path, 2, false, 0);
    header[156] = type;
    return std::string(header.data(), header.size()) + "hi" + std::string(510, '\0');
  };
  std::string good;
  append(good, "readme", "hi");
  EXPECT_NO_THROW(Flasher(world.root(), {}).flash(forged(text, good), {.dry_run = true}));
  expect_refused(forged(text, with_type('2', "readme")), "a symbolic link 'readme' stands where");
  expect_refused(forged(text, with_type('1', "readme")), "a hard link");
  expect_refused(forged(text, with_type('3', "readme")), "a device");
  expect_refused(forged(text, with_type('6', "readme")), "a FIFO");
  expect_refused(forged(text, with_type('5', "readme")), "a folder");
  expect_refused(forged(text, with_type('0', "../readme")), "a file '../readme' stands where");
  expect_refused(forged(text, good + good),
                 "holds a file 'readme', which its manifest does not name");
  expect_refused(forged(text, ""), "the archive's end stands where");
}

}  // namespace
}  // namespace clamber
