#include "deploy/slots.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/job_failed.hpp"
#include "deploy/digest.hpp"
#include "deploy/durable.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kHistory = 50;
constexpr const char* kUnpacked = ".unpacked";

std::optional<Slot> slot_named(const std::string& name) {
  if (name == "a") return Slot::kA;
  if (name == "b") return Slot::kB;
  return std::nullopt;
}

Json to_json(const std::vector<FlashEvent>& events) {
  Json list = Json::array();
  for (const FlashEvent& e : events)
    list.push_back(
        {{"time", e.time}, {"what", e.what}, {"name", e.name}, {"id", e.id}, {"detail", e.detail}});
  return list;
}

std::vector<FlashEvent> read_events(const Json& list) {
  std::vector<FlashEvent> events;
  for (const Json& e : list)
    events.push_back({e.at("time"), e.at("what"), e.at("name"), e.at("id"), e.at("detail")});
  return events;
}

Json name_or_null(const std::optional<Slot>& slot) {
  return slot ? Json(to_string(*slot)) : Json(nullptr);
}

std::optional<Slot> read_name(const Json& json) {
  return json.is_null() ? std::nullopt : slot_named(json.get<std::string>());
}

/// Writes the pieces of a bundle's files below a folder.
class Unpacker {
 public:
  explicit Unpacker(fs::path folder) : folder_(std::move(folder)) {}

  void take(const BundleFile& file, std::string_view bytes) {
    if (bytes.empty()) {
      finish_file();
      const fs::path path = folder_ / file.path;
      make_folders(path.parent_path());
      for (fs::path at = path.parent_path(); at != folder_; at = at.parent_path())
        folders_.insert(at);
      out_ = std::make_unique<DurableFile>(path, file.executable ? 0755 : 0644);
    } else {
      out_->write(bytes);
    }
  }
  void finish() {
    finish_file();
    for (const fs::path& folder : folders_) sync_folder(folder);
    sync_folder(folder_);
  }

 private:
  void finish_file() {
    if (out_) out_->close();
    out_.reset();
  }

  fs::path folder_;
  std::set<fs::path> folders_;
  std::unique_ptr<DurableFile> out_;
};

[[noreturn]] void damaged(const fs::path& file, const std::string& why) {
  throw JobFailed(file.string() + ": " + why);
}

/// Size and SHA-256 of what the disk has, not of what memory still holds.
void read_back(const fs::path& path, const BundleFile& file) {
  struct stat found {};
  if (lstat(path.c_str(), &found) != 0) damaged(path, "is missing");
  if (!S_ISREG(found.st_mode)) damaged(path, "is no file");
  if ((found.st_mode & 07777U) != (file.executable ? 0755U : 0644U))
    damaged(path, "has another mode");
  if (static_cast<std::uint64_t>(found.st_size) != file.size) damaged(path, "has another size");
  const int fd = open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) damaged(path, "cannot be read");
  (void)posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED);
  Digest digest;
  std::array<char, 65536> block{};
  ssize_t got = 0;
  while ((got = read(fd, block.data(), block.size())) > 0)
    digest.add({block.data(), static_cast<std::size_t>(got)});
  close(fd);
  if (got < 0 || digest.hex() != file.sha256) damaged(path, "reads back with another SHA-256");
}

void refuse_strangers(const fs::path& folder, const Manifest& manifest) {
  std::set<fs::path> known{folder / "manifest.json", folder / "manifest.sig"};
  for (const BundleFile& file : manifest.files)
    for (fs::path at = folder / file.path; at != folder; at = at.parent_path()) known.insert(at);
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (!known.contains(entry.path())) damaged(entry.path(), "is not in the manifest");
}

}  // namespace

const char* to_string(Slot slot) noexcept { return slot == Slot::kA ? "a" : "b"; }

SlotStore::SlotStore(const fs::path& root) : folder_(root / "opt/clamber") {}

fs::path SlotStore::slot(Slot slot) const { return folder_ / "slots" / to_string(slot); }

fs::path SlotStore::unpacked() const { return folder_ / "slots" / kUnpacked; }

void SlotStore::make() const { make_folders(folder_ / "slots"); }

std::optional<Slot> SlotStore::current() const {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(current_link(), error))) return std::nullopt;
  const fs::path target = fs::read_symlink(current_link(), error);
  for (const Slot slot : {Slot::kA, Slot::kB})
    if (target == fs::path("slots") / to_string(slot)) return slot;
  throw JobFailed(current_link().string() +
                  ": points to no slot; `clamber flash` made it otherwise");
}

void SlotStore::switch_to(std::optional<Slot> slot) const {
  if (slot) return point_link(current_link(), fs::path("slots") / to_string(*slot));
  remove_tree(current_link());
  sync_folder(folder_);
}

FlashState SlotStore::load_state() const {
  const fs::path file = folder_ / "state.json";
  std::error_code error;
  if (!fs::exists(file, error)) return {};
  try {
    const Json json = Json::parse(read_file(file));
    return {read_name(json.at("committed")), read_name(json.at("trial")),
            read_events(json.at("bad")), read_events(json.at("history"))};
  } catch (const nlohmann::json::exception& problem) {
    throw InputError(file.string() + ": " + problem.what());
  }
}

void SlotStore::save_state(const FlashState& state) const {
  const std::size_t kept = std::min(state.history.size(), kHistory);
  const Json json{{"committed", name_or_null(state.committed)},
                  {"trial", name_or_null(state.trial)},
                  {"bad", to_json(state.bad)},
                  {"history", to_json({state.history.end() - static_cast<std::ptrdiff_t>(kept),
                                       state.history.end()})}};
  replace_file(folder_ / "state.json", json.dump(1) + '\n', 0644);
}

fs::path SlotStore::unpack(Bundle& bundle) const {
  remove_leavings();
  const fs::path folder = unpacked();
  make_folders(folder);
  write_new_file(folder / "manifest.json", bundle.manifest_text(), 0644);
  write_new_file(folder / "manifest.sig", bundle.signature(), 0644);
  Unpacker unpacker(folder);
  bundle.read_files(
      [&](const BundleFile& file, std::string_view bytes) { unpacker.take(file, bytes); });
  unpacker.finish();
  return folder;
}

void SlotStore::take_over(const fs::path& unpacked, Slot slot) const {
  exchange_folders(unpacked, this->slot(slot));
  remove_leavings();  // what was in the slot now has the other's name
}

void SlotStore::remove_leavings() const { remove_tree(unpacked()); }

std::optional<SlotContent> read_slot(const fs::path& folder) {
  const fs::path file = folder / "manifest.json";
  std::error_code error;
  if (!fs::exists(file, error)) return std::nullopt;
  const std::string text = read_file(file, kManifestBytes);
  Digest digest;
  digest.add(text);
  return SlotContent{parse_manifest(text, file.string()), digest.hex()};
}

SlotContent verify_slot(const fs::path& folder) {
  const std::optional<SlotContent> content = read_slot(folder);
  if (!content) damaged(folder, "holds no bundle");
  for (const BundleFile& file : content->manifest.files) read_back(folder / file.path, file);
  refuse_strangers(folder, content->manifest);
  return *content;
}

}  // namespace clamber
