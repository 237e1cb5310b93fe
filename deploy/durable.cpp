#include "deploy/durable.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>

#include "apps/job_failed.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, const char* what, int error) {
  throw JobFailed(path.string() + ": cannot be " + what + ": " + std::strerror(error));
}

/// Beside the file, where a rename is one step; a crash may leave it, the next attempt replaces it.
fs::path draft_of(const fs::path& file) {
  return file.parent_path() / (std::string(".") + file.filename().string() + ".new");
}

void rename_durably(const fs::path& from, const fs::path& to) {
  if (rename(from.c_str(), to.c_str()) != 0) fail(to, "replaced", errno);
  sync_folder(to.parent_path());
}

}  // namespace

DurableFile::DurableFile(const fs::path& file, unsigned mode)
    : file_(file),
      fd_(open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600)) {
  if (fd_ < 0) fail(file_, "made", errno);
  // Not left to open(): the user's mask does not decide what a slot looks like.
  if (fchmod(fd_, mode) != 0) fail(file_, "given its mode", errno);
}

DurableFile::~DurableFile() {
  if (fd_ >= 0) ::close(fd_);
}

void DurableFile::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(file_, "written", errno);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void DurableFile::close() {
  if (fsync(fd_) != 0) fail(file_, "written to the disk", errno);
  const int fd = fd_;
  fd_ = -1;
  if (::close(fd) != 0) fail(file_, "closed", errno);
}

void write_new_file(const fs::path& file, std::string_view bytes, unsigned mode) {
  DurableFile out(file, mode);
  out.write(bytes);
  out.close();
}

void replace_file(const fs::path& file, std::string_view bytes, unsigned mode) {
  const fs::path draft = draft_of(file);
  remove_tree(draft);
  write_new_file(draft, bytes, mode);
  rename_durably(draft, file);
}

void point_link(const fs::path& link, const fs::path& target) {
  const fs::path draft = draft_of(link);
  remove_tree(draft);
  if (symlink(target.c_str(), draft.c_str()) != 0) fail(draft, "made", errno);
  // The draft's name first: without it a power cut could leave a renamed link that was never made.
  sync_folder(link.parent_path());
  rename_durably(draft, link);
}

void exchange_folders(const fs::path& fresh, const fs::path& old) {
  if (renameat2(AT_FDCWD, fresh.c_str(), AT_FDCWD, old.c_str(), RENAME_EXCHANGE) != 0) {
    if (errno != ENOENT) fail(old, "exchanged", errno);
    if (rename(fresh.c_str(), old.c_str()) != 0) fail(old, "made", errno);
  }
  sync_folder(old.parent_path());
}

void sync_folder(const fs::path& folder) {
  const fs::path path = folder.empty() ? fs::path(".") : folder;
  const int fd = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) fail(path, "opened", errno);
  const int result = fsync(fd);
  const int error = errno;
  close(fd);
  if (result != 0) fail(path, "written to the disk", error);
}

void make_folders(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return;
  if (const fs::path parent = folder.parent_path(); !parent.empty() && parent != folder)
    make_folders(parent);
  if (mkdir(folder.c_str(), 0755) != 0 && errno != EEXIST) fail(folder, "made", errno);
  sync_folder(folder.parent_path());
}

void remove_tree(const fs::path& path) {
  std::error_code error;
  fs::remove_all(path, error);
  if (error) throw JobFailed(path.string() + ": cannot be removed: " + error.message());
}

FolderLock::FolderLock(const fs::path& file, const char* busy)
    : fd_(open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644)) {
  if (fd_ < 0) fail(file, "opened", errno);
  if (flock(fd_, LOCK_EX | LOCK_NB) == 0) return;
  const int error = errno;
  close(fd_);
  if (error == EWOULDBLOCK) throw JobFailed(busy);
  fail(file, "locked", error);
}

FolderLock::~FolderLock() { close(fd_); }

}  // namespace clamber
