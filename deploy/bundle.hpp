// A bundle: manifest, its signature and the files, as one archive that any tar can list.
// One thread; allocates, reads and writes files; throws InputError, beginning with the bundle's
// name.
//
// For one manifest there is one archive, to the bit: ustar headers with fixed owner and time, in
// the manifest's order. The reader compares every header and every padding byte with what it would
// have written, and looks at nothing before the signature has been found good. There is no parser
// that a link, a device, a second entry or a path outside could get through.
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "deploy/keys.hpp"
#include "deploy/manifest.hpp"

namespace clamber {

/// A file that shall be in a bundle.
struct BundleSource {
  std::string path;            ///< in the bundle
  std::filesystem::path from;  ///< a regular file; empty: `text` is the content
  std::string text;
  bool executable = false;
};

/// Writes a signed bundle. `manifest.files` is made from `sources`. @return its id
std::string write_bundle(const std::filesystem::path& file, Manifest manifest,
                         std::vector<BundleSource> sources, const SecretKey& key);

class Bundle {
 public:
  /// Takes the pieces of a file in the manifest's order; a new file begins with an empty piece.
  using Visitor = std::function<void(const BundleFile& file, std::string_view bytes)>;

  /// Opens, checks the signature against `trusted`, reads the manifest.
  Bundle(const std::filesystem::path& file, const std::vector<PublicKey>& trusted);

  [[nodiscard]] const Manifest& manifest() const { return manifest_; }
  /// The manifest's text and its signature, which lie in the slot as well.
  [[nodiscard]] const std::string& manifest_text() const { return text_; }
  [[nodiscard]] const std::string& signature() const { return signature_; }
  [[nodiscard]] const PublicKey& signer() const { return signer_; }
  /// SHA-256 of the manifest.
  [[nodiscard]] const std::string& id() const { return id_; }

  /// Reads all the rest and checks every byte of it. May be called again.
  void read_files(const Visitor& visitor = {});

 private:
  [[nodiscard]] std::string take(std::uint64_t size, const std::string& entry);
  void expect_header(const std::string& path, std::uint64_t size, bool executable);
  void expect_padding(std::uint64_t size, const std::string& entry);
  void read_file_of(const BundleFile& entry, const Visitor& visitor);

  std::string name_;
  std::ifstream in_;
  std::uint64_t start_ = 0;  ///< of the first file's header
  std::string text_, signature_, id_;
  Manifest manifest_;
  PublicKey signer_;
};

}  // namespace clamber
