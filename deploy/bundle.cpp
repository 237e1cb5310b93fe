#include "deploy/bundle.hpp"

#include <algorithm>
#include <cstring>

#include "deploy/digest.hpp"
#include "deploy/durable.hpp"
#include "deploy/ustar.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPiece = 64 * 1024;
constexpr std::size_t kEnd = 2 * kUstarBlock;  // zeros that end an archive

std::string sha256_of(std::string_view text) {
  Digest digest;
  digest.add(text);
  return digest.hex();
}

/// Size and hash of a source as it is now.
BundleFile describe_source(const BundleSource& source) {
  BundleFile file{.path = source.path, .executable = source.executable, .sha256 = {}};
  const std::string bytes =
      source.from.empty() ? source.text : read_file(source.from, kBundleFileBytes);
  file.size = bytes.size();
  file.sha256 = sha256_of(bytes);
  return file;
}

class Archive {
 public:
  Archive(const fs::path& file, std::uint64_t time) : out_(file, 0644), time_(time) {}

  void add(const std::string& path, std::string_view bytes, bool executable = false) {
    const UstarHeader header = ustar_header(path, bytes.size(), executable, time_);
    out_.write({header.data(), header.size()});
    out_.write(bytes);
    out_.write(std::string(ustar_padding(bytes.size()), '\0'));
  }
  void close() {
    out_.write(std::string(kEnd, '\0'));
    out_.close();
  }

 private:
  DurableFile out_;
  std::uint64_t time_;
};

}  // namespace

std::string write_bundle(const fs::path& file, Manifest manifest, std::vector<BundleSource> sources,
                         const SecretKey& key) {
  std::sort(sources.begin(), sources.end(),
            [](const BundleSource& a, const BundleSource& b) { return a.path < b.path; });
  manifest.files.clear();
  for (const BundleSource& source : sources) manifest.files.push_back(describe_source(source));
  const std::string text = format_manifest(manifest);
  (void)parse_manifest(text, file.string());  // what no target would take is not written

  if (file.has_parent_path()) make_folders(file.parent_path());
  const fs::path draft = file.string() + ".new";
  remove_tree(draft);
  Archive archive(draft, manifest.time);
  archive.add("manifest.json", text);
  archive.add("manifest.sig", sign(text, Purpose::kManifest, key));
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const BundleSource& source = sources[i];
    const std::string bytes =
        source.from.empty() ? source.text : read_file(source.from, kBundleFileBytes);
    if (sha256_of(bytes) != manifest.files[i].sha256)
      throw InputError(source.from.string() + ": changed while it was bundled");
    archive.add(source.path, bytes, source.executable);
  }
  archive.close();
  std::error_code error;
  fs::rename(draft, file, error);
  if (error) throw InputError(file.string() + ": cannot be made: " + error.message());
  return sha256_of(text);
}

Bundle::Bundle(const fs::path& file, const std::vector<PublicKey>& trusted)
    : name_(file.string()), in_(open_file(file, 2 * kBundleBytes)) {
  UstarHeader first{};
  in_.read(first.data(), first.size());
  const std::uint64_t size = ustar_size(first);
  if (!in_ || std::strncmp(first.data(), "manifest.json", 100) != 0 || size > kManifestBytes)
    throw InputError(name_ + ": is no bundle: does not begin with a manifest");
  text_ = take(size, "manifest.json");
  expect_padding(size, "manifest.json");
  UstarHeader second{};
  in_.read(second.data(), second.size());
  if (!in_ || std::strncmp(second.data(), "manifest.sig", 100) != 0)
    throw InputError(
        name_ + ": is not signed: " + (in_ ? describe_foreign(second) : std::string("its end")) +
        " stands where the signature belongs");
  signature_ = take(kSignatureBytes, "manifest.sig");
  expect_padding(kSignatureBytes, "manifest.sig");
  signer_ = check_signature(signature_, text_, Purpose::kManifest, trusted, name_);
  manifest_ = parse_manifest(text_, name_);
  id_ = sha256_of(text_);
  start_ = static_cast<std::uint64_t>(in_.tellg());
  // Their headers could not be known before the manifest was.
  if (first != ustar_header("manifest.json", size, false, manifest_.time) ||
      second != ustar_header("manifest.sig", kSignatureBytes, false, manifest_.time))
    throw InputError(name_ + ": is damaged: the headers of manifest and signature");
}

void Bundle::read_files(const Visitor& visitor) {
  in_.clear();
  in_.seekg(static_cast<std::streamoff>(start_));
  for (const BundleFile& entry : manifest_.files) read_file_of(entry, visitor);
  const std::string end = take(kEnd, "the archive's end");
  if (end.find_first_not_of('\0') != std::string::npos) {
    UstarHeader header{};
    std::memcpy(header.data(), end.data(), header.size());
    throw InputError(name_ + ": holds " + describe_foreign(header) +
                     ", which its manifest does not name");
  }
  if (in_.peek() != std::ifstream::traits_type::eof())
    throw InputError(name_ + ": goes on after its end");
}

void Bundle::read_file_of(const BundleFile& entry, const Visitor& visitor) {
  expect_header(entry.path, entry.size, entry.executable);
  if (visitor) visitor(entry, {});
  Digest digest;
  for (std::uint64_t left = entry.size; left > 0;) {
    const std::string piece = take(std::min<std::uint64_t>(left, kPiece), entry.path);
    digest.add(piece);
    if (visitor) visitor(entry, piece);
    left -= piece.size();
  }
  if (digest.hex() != entry.sha256)
    throw InputError(name_ + ": '" + entry.path +
                     "' is damaged: its SHA-256 is not the manifest's");
  expect_padding(entry.size, entry.path);
}

std::string Bundle::take(std::uint64_t size, const std::string& entry) {
  std::string bytes(static_cast<std::size_t>(size), '\0');
  in_.read(bytes.data(), static_cast<std::streamsize>(size));
  if (!in_) throw InputError(name_ + ": is cut off in '" + entry + "'");
  return bytes;
}

void Bundle::expect_header(const std::string& path, std::uint64_t size, bool executable) {
  const std::string bytes = take(kUstarBlock, path);
  UstarHeader found{};
  std::memcpy(found.data(), bytes.data(), found.size());
  if (found == ustar_header(path, size, executable, manifest_.time)) return;
  throw InputError(name_ + ": " + describe_foreign(found) +
                   " stands where the manifest says file '" + path + "', or its header is damaged");
}

void Bundle::expect_padding(std::uint64_t size, const std::string& entry) {
  if (take(ustar_padding(size), entry).find_first_not_of('\0') != std::string::npos)
    throw InputError(name_ + ": is damaged after '" + entry + "'");
}

}  // namespace clamber
