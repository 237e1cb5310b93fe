// What a bundle says of itself: for which robot, hardware and machine, and every file in it.
// Any thread; allocates: yes; blocks: never; throws InputError.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace clamber {

/// What the flasher and what is flashed must agree on: bundle layout, service.yaml, health file.
inline constexpr int kBundleAbi = 1;

// The most that a bundle may hold: well above real ones, well below a robot's disk.
inline constexpr std::uint64_t kManifestBytes = std::uint64_t{1} << 20;
inline constexpr std::uint64_t kBundleFileBytes = std::uint64_t{256} << 20;
inline constexpr std::uint64_t kBundleBytes = std::uint64_t{512} << 20;
inline constexpr std::size_t kBundleFiles = 4096;

struct BundleFile {
  std::string path;  ///< relative, of plain characters, at most 99
  std::uint64_t size = 0;
  bool executable = false;
  std::string sha256;
};

/// CAN interface: node ids of the drives on it, ascending.
using Hardware = std::map<std::string, std::vector<int>>;
/// "can0: 41 42, can1: 51": for messages.
[[nodiscard]] std::string describe(const Hardware& hardware);

struct Manifest {
  std::string version;  ///< the release's, of plain characters
  std::string robot;
  std::string model;  ///< hash of the robot model
  Hardware hardware;
  int abi = kBundleAbi;
  std::string machine;            ///< as uname -m
  std::string minimum_kernel;     ///< "5.10"
  std::uint64_t time = 0;         ///< s, of all files in the archive
  std::vector<BundleFile> files;  ///< by path, ascending

  /// "coman 1.2.0"
  [[nodiscard]] std::string name() const { return robot + ' ' + version; }
};

/// The one text that says this manifest; its SHA-256 names the bundle.
[[nodiscard]] std::string format_manifest(const Manifest& manifest);

/// Accepts nothing but what format_manifest() writes, and no file that could end up outside of a
/// slot. @throws InputError beginning with `what`
[[nodiscard]] Manifest parse_manifest(const std::string& text, const std::string& what);

}  // namespace clamber
