#include "tests/deploy/crash_lab.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdarg>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <random>
#include <sstream>
#include <string>

namespace clamber {
namespace {

namespace fs = std::filesystem;

std::string read_bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

/// What a disk has of a tree: names of folders and bytes of files as they were last synced.
class Disk {
 public:
  explicit Disk(fs::path root) : root_(std::move(root)) { know(root_); }

  /// What is at the path was made just now: nothing of it is on the disk. Inode numbers come back,
  /// serial numbers do not.
  void made(const struct stat& found) {
    const int serial = serials_[found.st_ino] = ++last_;
    if (S_ISDIR(found.st_mode)) folders_[serial] = {};
  }

  void synced(int fd) {
    struct stat found {};
    if (fstat(fd, &found) != 0) return;
    const fs::path path = fs::read_symlink("/proc/self/fd/" + std::to_string(fd));
    const int serial = serial_of(found);
    if (S_ISDIR(found.st_mode))
      folders_[serial] = list(path);
    else
      files_[serial] = {read_bytes(path), found.st_mode & 07777U};
  }

  void leave(const fs::path& at, std::uint64_t seed) {
    random_.seed(seed);
    mix_ = seed != 0;
    live_.clear();
    find_live(root_);
    struct stat found {};
    stat(root_.c_str(), &found);
    write_folder(serial_of(found), at);
  }

 private:
  struct Entry {
    int serial = 0;
    mode_t kind = 0;
    std::string target;  ///< of a link
  };
  struct File {
    std::string bytes;
    mode_t mode = 0;
  };
  using Names = std::map<std::string, Entry>;

  int serial_of(const struct stat& found) {
    const auto [at, fresh] = serials_.try_emplace(found.st_ino, last_ + 1);
    if (fresh) ++last_;
    return at->second;
  }

  Names list(const fs::path& folder) {
    Names names;
    for (const fs::directory_entry& item : fs::directory_iterator(folder)) {
      struct stat found {};
      if (lstat(item.path().c_str(), &found) != 0) continue;
      Entry entry{serial_of(found), found.st_mode & S_IFMT, {}};
      if (S_ISLNK(found.st_mode)) entry.target = fs::read_symlink(item.path());
      names[item.path().filename()] = entry;
    }
    return names;
  }

  /// Before the work begins all is on the disk.
  void know(const fs::path& folder) {
    struct stat found {};
    lstat(folder.c_str(), &found);
    folders_[serial_of(found)] = list(folder);
    for (const fs::directory_entry& item : fs::directory_iterator(folder)) {
      lstat(item.path().c_str(), &found);
      if (S_ISDIR(found.st_mode)) know(item.path());
      if (S_ISREG(found.st_mode))
        files_[serial_of(found)] = {read_bytes(item.path()), found.st_mode & 07777U};
    }
  }

  void find_live(const fs::path& folder) {
    struct stat found {};
    lstat(folder.c_str(), &found);
    live_[serial_of(found)] = folder;
    for (const fs::directory_entry& item : fs::directory_iterator(folder)) {
      lstat(item.path().c_str(), &found);
      if (S_ISDIR(found.st_mode)) find_live(item.path());
      if (S_ISREG(found.st_mode)) live_[serial_of(found)] = item.path();
    }
  }

  bool luck() { return mix_ && random_() % 2 == 0; }

  void write_folder(int serial, const fs::path& at) {
    fs::create_directories(at);
    const bool alive = live_.contains(serial);
    const Names names = alive && luck() ? list(live_[serial]) : folders_[serial];
    for (const auto& [name, entry] : names) {
      if (entry.kind == S_IFDIR) write_folder(entry.serial, at / name);
      if (entry.kind == S_IFLNK) fs::create_symlink(entry.target, at / name);
      if (entry.kind == S_IFREG) write_file(entry.serial, at / name);
    }
  }

  void write_file(int serial, const fs::path& at) {
    File file = files_[serial];  // never synced: empty
    struct stat found {};
    if (live_.contains(serial) && lstat(live_[serial].c_str(), &found) == 0 && luck()) {
      const std::string bytes = read_bytes(live_[serial]);
      const bool torn = bytes != file.bytes && random_() % 2 == 0;
      file = {torn ? bytes.substr(0, random_() % (bytes.size() + 1)) : bytes,
              found.st_mode & 07777U};
    }
    std::ofstream(at, std::ios::binary) << file.bytes;
    fs::permissions(at, static_cast<fs::perms>(file.mode));
  }

  fs::path root_;
  std::map<ino_t, int> serials_;
  int last_ = 0;
  std::map<int, Names> folders_;
  std::map<int, File> files_;
  std::map<int, fs::path> live_;
  std::mt19937_64 random_;
  bool mix_ = false;
};

struct Lab {
  Crash crash;
  fs::path root;
  std::uint64_t changes = 0;
  std::unique_ptr<Disk> disk;
  bool busy = false;  ///< its own calls do not count
};
Lab* lab = nullptr;

[[noreturn]] void die() {
  kill(getpid(), SIGKILL);
  abort();
}

/// A change is about to happen.
void change() {
  if (lab == nullptr || lab->busy || ++lab->changes != lab->crash.at) return;
  lab->busy = true;
  if (lab->disk) lab->disk->leave(lab->root.string() + ".disk", lab->crash.seed);
  die();
}

bool watching() { return lab != nullptr && !lab->busy && lab->disk; }

/// Asks the disk model something without its own calls being taken for the work's.
template <typename Ask>
void tell_disk(Ask&& ask) {
  lab->busy = true;
  ask(*lab->disk);
  lab->busy = false;
}

template <typename Function>
Function next(Function, const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

Outcome run_with(const Crash& crash, const fs::path& root, const std::function<void()>& work) {
  const pid_t child = fork();
  if (child == 0) {
    static Lab mine;
    mine.crash = crash;
    mine.root = root;
    if (crash.kind == Crash::Kind::kPowerCut) mine.disk = std::make_unique<Disk>(root);
    if (crash.kind != Crash::Kind::kNone) lab = &mine;
    try {
      work();
    } catch (const std::exception&) {
      _exit(1);
    }
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status)) return WEXITSTATUS(status) == 0 ? Outcome::kFinished : Outcome::kFailed;
  if (crash.kind == Crash::Kind::kPowerCut) {
    fs::remove_all(root);
    fs::rename(root.string() + ".disk", root);
  }
  return Outcome::kCrashed;
}

}  // namespace clamber

// The calls that change a file system, in front of the C library's.
extern "C" {

int fsync(int fd) {
  clamber::change();
  if (clamber::watching()) clamber::tell_disk([&](clamber::Disk& disk) { disk.synced(fd); });
  return 0;  // the model is the disk
}

int rename(const char* from, const char* to) noexcept {
  clamber::change();
  static const auto call = clamber::next(&rename, "rename");
  return call(from, to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to,
              unsigned flags) noexcept {
  clamber::change();
  static const auto call = clamber::next(&renameat2, "renameat2");
  return call(from_folder, from, to_folder, to, flags);
}

int symlink(const char* target, const char* link) noexcept {
  clamber::change();
  static const auto call = clamber::next(&symlink, "symlink");
  return call(target, link);
}

int mkdir(const char* folder, mode_t mode) noexcept {
  clamber::change();
  static const auto call = clamber::next(&mkdir, "mkdir");
  const int result = call(folder, mode);
  struct stat found {};
  if (result == 0 && clamber::watching() && stat(folder, &found) == 0)
    clamber::tell_disk([&](clamber::Disk& disk) { disk.made(found); });
  return result;
}

int unlinkat(int folder, const char* name, int flags) noexcept {
  clamber::change();
  static const auto call = clamber::next(&unlinkat, "unlinkat");
  return call(folder, name, flags);
}

int unlink(const char* path) noexcept {
  clamber::change();
  static const auto call = clamber::next(&unlink, "unlink");
  return call(path);
}

int rmdir(const char* path) noexcept {
  clamber::change();
  static const auto call = clamber::next(&rmdir, "rmdir");
  return call(path);
}

int fchmod(int fd, mode_t mode) noexcept {
  clamber::change();
  static const auto call = clamber::next(&fchmod, "fchmod");
  return call(fd, mode);
}

ssize_t write(int fd, const void* bytes, size_t size) {
  clamber::change();
  static const auto call = clamber::next(&write, "write");
  return call(fd, bytes, size);
}

int open(const char* path, int flags, ...) {
  mode_t mode = 0;
  if ((flags & O_CREAT) != 0) {
    va_list more;
    va_start(more, flags);
    mode = va_arg(more, mode_t);
    va_end(more);
    clamber::change();
  }
  using Open = int (*)(const char*, int, ...);
  static const auto call = reinterpret_cast<Open>(dlsym(RTLD_NEXT, "open"));
  const int fd = call(path, flags, mode);
  struct stat found {};
  if (fd >= 0 && (flags & O_EXCL) != 0 && clamber::watching() && fstat(fd, &found) == 0)
    clamber::tell_disk([&](clamber::Disk& disk) { disk.made(found); });
  return fd;
}

}  // extern "C"
