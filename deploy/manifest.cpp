#include "deploy/manifest.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "clamber-bundle-1";
constexpr std::size_t kPathBytes = 99;  // what a ustar header holds, with its zero

bool plain(std::string_view text, std::string_view more) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [&](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           more.find(c) != std::string_view::npos;
  });
}

bool is_hash(std::string_view text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

/// Why a path could lead out of its slot or hide something in it; nullptr: it could not.
const char* objection_to(const std::string& path) {
  if (path.empty() || path.size() > kPathBytes) return "has a path that is empty or too long";
  if (path[0] == '/') return "has an absolute path";
  if (!plain(path, "._+-/")) return "has a path of other than plain characters";
  for (std::size_t at = 0; at <= path.size();) {
    const std::size_t end = std::min(path.find('/', at), path.size());
    const std::string part = path.substr(at, end - at);
    if (part == ".." || part == ".") return "has a path that leads elsewhere";
    if (part.empty()) return "has a path with an empty part";
    if (part[0] == '.') return "is hidden";
    at = end + 1;
  }
  return nullptr;
}

/// For a message: whatever the bundle's maker wrote, on one line of plain characters.
std::string printable(std::string text) {
  text.resize(std::min(text.size(), kPathBytes));
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return text;
}

void check_files(const std::vector<BundleFile>& files, const std::string& what) {
  if (files.size() > kBundleFiles) throw InputError(what + ": manifest: too many files");
  std::uint64_t total = 0;
  const BundleFile* before = nullptr;
  for (const BundleFile& file : files) {
    const auto refuse = [&](const std::string& why) {
      throw InputError(what + ": manifest: file '" + printable(file.path) + "' " + why);
    };
    if (const char* why = objection_to(file.path)) refuse(why);
    if (file.path == "manifest.json" || file.path == "manifest.sig")
      refuse("has the manifest's own name");
    if (!is_hash(file.sha256)) refuse("has no SHA-256");
    if (file.size > kBundleFileBytes)
      refuse("is too large: " + std::to_string(file.size) + " bytes");
    if ((total += file.size) > kBundleBytes) refuse("makes the bundle too large");
    if (before != nullptr && before->path == file.path) refuse("is listed twice");
    if (before != nullptr && before->path > file.path) refuse("is not in order");
    if (before != nullptr && file.path.starts_with(before->path + '/'))
      refuse("lies in another file");
    before = &file;
  }
}

void check_texts(const Manifest& manifest, const std::string& what) {
  const auto require = [&](bool good, const char* key) {
    if (!good) throw InputError(what + ": manifest: " + key + ": not usable");
  };
  require(plain(manifest.version, "._+-~") && manifest.version.size() <= 64, "version");
  require(plain(manifest.robot, "._-") && manifest.robot.size() <= 64, "robot");
  require(is_hash(manifest.model), "model");
  require(plain(manifest.machine, "_-") && manifest.machine.size() <= 32, "machine");
  require(plain(manifest.minimum_kernel, ".") && manifest.minimum_kernel.size() <= 32,
          "minimum_kernel");
}

Manifest read(const Json& json) {
  Manifest manifest;
  manifest.version = json.at("version");
  manifest.robot = json.at("robot");
  manifest.model = json.at("model");
  manifest.hardware = json.at("hardware").get<Hardware>();
  manifest.abi = json.at("abi");
  manifest.machine = json.at("machine");
  manifest.minimum_kernel = json.at("minimum_kernel");
  manifest.time = json.at("time");
  for (const Json& file : json.at("files"))
    manifest.files.push_back(
        {file.at("path"), file.at("size"), file.at("mode") == "0755", file.at("sha256")});
  return manifest;
}

}  // namespace

std::string describe(const Hardware& hardware) {
  std::string text;
  for (const auto& [interface, nodes] : hardware) {
    text += (text.empty() ? "" : ", ") + interface + ':';
    for (const int node : nodes) text += ' ' + std::to_string(node);
  }
  return text.empty() ? "none" : text;
}

std::string format_manifest(const Manifest& manifest) {
  Json files = Json::array();
  for (const BundleFile& file : manifest.files)
    files.push_back({{"path", file.path},
                     {"size", file.size},
                     {"mode", file.executable ? "0755" : "0644"},
                     {"sha256", file.sha256}});
  const Json json{{"format", kFormat},
                  {"version", manifest.version},
                  {"robot", manifest.robot},
                  {"model", manifest.model},
                  {"hardware", manifest.hardware},
                  {"abi", manifest.abi},
                  {"machine", manifest.machine},
                  {"minimum_kernel", manifest.minimum_kernel},
                  {"time", manifest.time},
                  {"files", files}};
  return json.dump(1) + '\n';
}

Manifest parse_manifest(const std::string& text, const std::string& what) {
  Manifest manifest;
  try {
    const Json json = Json::parse(text);
    if (json.at("format") != kFormat)
      throw InputError(what + ": manifest: format: expected " + kFormat);
    manifest = read(json);
  } catch (const nlohmann::json::exception& error) {
    throw InputError(what + ": manifest: " + error.what());
  }
  check_texts(manifest, what);
  check_files(manifest.files, what);
  if (format_manifest(manifest) != text)
    throw InputError(what + ": manifest: has something that this version does not know");
  return manifest;
}

}  // namespace clamber
