// A target in a temporary folder, a key that it trusts, and small bundles for it.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "deploy/bundle.hpp"
#include "deploy/durable.hpp"
#include "deploy/flash.hpp"
#include "deploy/keys.hpp"
#include "deploy/slots.hpp"
#include "deploy/target.hpp"

namespace clamber {

namespace fs = std::filesystem;

inline std::string bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

inline void put(const fs::path& file, const std::string& bytes) {
  fs::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << bytes;
}

/// Every name, kind, mode and byte below a folder as one text.
inline std::string tree_of(const fs::path& root) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::recursive_directory_iterator(root)) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::ostringstream out;
  for (const fs::path& path : paths) {
    struct stat found {};
    lstat(path.c_str(), &found);
    out << fs::relative(path, root) << ' ' << std::oct << found.st_mode << ' ';
    if (S_ISLNK(found.st_mode)) out << fs::read_symlink(path);
    if (S_ISREG(found.st_mode)) out << bytes_of(path);
    out << '\n';
  }
  return out.str();
}

class FlashWorld {
 public:
  FlashWorld() {
    // In memory where there is such a folder: thousands of flashes are made.
    const std::string pattern =
        (fs::is_directory("/dev/shm") ? "/dev/shm" : fs::temp_directory_path().string()) +
        std::string("/clamber-flash-XXXXXX");
    std::vector<char> name(pattern.begin(), pattern.end());
    name.push_back('\0');
    folder_ = mkdtemp(name.data());
    new_key(folder_ / "key", "test");
    key_ = load_secret_key(folder_ / "key");
    reset();
  }
  ~FlashWorld() { fs::remove_all(folder_); }
  FlashWorld(const FlashWorld&) = delete;
  FlashWorld& operator=(const FlashWorld&) = delete;

  /// A target that nothing has been flashed to.
  void reset() const {
    fs::remove_all(root());
    Target target;
    target.robot = "testbot";
    target.hardware = hardware();
    put(target_file(root()), format_target(target));
    pin_key(root(), key_.public_key());
  }

  [[nodiscard]] fs::path folder() const { return folder_; }
  [[nodiscard]] fs::path root() const { return folder_ / "root"; }
  [[nodiscard]] const SecretKey& key() const { return key_; }
  [[nodiscard]] static Hardware hardware() { return {{"can0", {11, 12}}, {"can1", {21}}}; }

  [[nodiscard]] static Manifest manifest(const std::string& version) {
    Manifest manifest;
    manifest.version = version;
    manifest.robot = "testbot";
    manifest.model = std::string(64, 'a');
    manifest.hardware = hardware();
    manifest.machine = this_machine().name;
    manifest.minimum_kernel = "3.0";
    return manifest;
  }
  [[nodiscard]] static std::vector<BundleSource> sources(const std::string& version) {
    return {{"bin/clamber", {}, "program " + version + std::string(600, 'x'), true},
            {"configs/hal/map.yaml", {}, "map of " + version, false},
            {"plans/climb/plan.json", {}, "plan " + version, false},
            {"empty", {}, "", false}};
  }
  [[nodiscard]] fs::path bundle(const std::string& version) const {
    fs::path file = folder_ / (version + ".cfw");
    if (!fs::exists(file)) write_bundle(file, manifest(version), sources(version), key_);
    return file;
  }

  /// The version in use, having looked at every byte of it; empty: none. Nothing of the product's
  /// own verification is used.
  [[nodiscard]] std::string in_use() const {
    const fs::path link = root() / "opt/clamber/current";
    if (!fs::is_symlink(fs::symlink_status(link))) {
      EXPECT_FALSE(fs::exists(fs::symlink_status(link))) << link;
      return {};
    }
    EXPECT_TRUE(fs::is_directory(link)) << "current leads nowhere";
    return complete_version(fs::canonical(link));
  }

  /// The version that a slot holds completely; empty with a failure: it does not.
  [[nodiscard]] static std::string complete_version(const fs::path& slot) {
    const std::string program = bytes_of(slot / "bin/clamber");
    const std::string version = program.substr(0, program.find('x')).substr(8);
    std::size_t files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(slot))
      files += entry.is_regular_file();
    EXPECT_EQ(files, sources(version).size() + 2) << slot;
    for (const BundleSource& source : sources(version)) {
      EXPECT_EQ(bytes_of(slot / source.path), source.text) << slot / source.path;
      struct stat found {};
      EXPECT_EQ(lstat((slot / source.path).c_str(), &found), 0);
      EXPECT_EQ(found.st_mode, S_IFREG | (source.executable ? 0755U : 0644U)) << source.path;
    }
    return version;
  }

  void expect_no_half_slot() const {
    for (const char* name : {"a", "b"}) {
      const fs::path slot = root() / "opt/clamber/slots" / name;
      if (fs::exists(slot)) (void)complete_version(slot);
    }
  }

 private:
  fs::path folder_;
  SecretKey key_;
};

}  // namespace clamber
