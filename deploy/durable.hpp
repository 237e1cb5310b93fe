// Changes to the file system that a crash or a power cut finds done or not begun, never half.
// Start-up and tools; allocates, blocks on the disk; every failure is a JobFailed naming the path.
//
// What is durable when: a file's bytes after write_durably(), a name in a folder after
// sync_folder() of that folder. Nothing here relies on the order in which a file system writes
// what nobody asked it to write.
#pragma once

#include <filesystem>
#include <string_view>

namespace clamber {

/// Writes a new file and its bytes to the disk; its name is durable once the folder is synced.
void write_new_file(const std::filesystem::path& file, std::string_view bytes, unsigned mode);

/// Replaces `file` at once: readers see the old bytes or the new ones. Durable on return.
void replace_file(const std::filesystem::path& file, std::string_view bytes, unsigned mode);

/// Points the symbolic link at `target` at once, made if missing. Durable on return.
void point_link(const std::filesystem::path& link, const std::filesystem::path& target);

/// The new folder takes the old one's name at once, and the other way round; where there is no old
/// one, the new one is renamed. Both in the same folder. Durable on return.
void exchange_folders(const std::filesystem::path& fresh, const std::filesystem::path& old);

/// Writes a folder's names to the disk.
void sync_folder(const std::filesystem::path& folder);

/// Makes the folder and its missing parents; durable on return.
void make_folders(const std::filesystem::path& folder);

/// Removes a file or a folder with all that is in it; symbolic links are not followed.
void remove_tree(const std::filesystem::path& path);

/// A whole file's bytes go to the disk as they come; close() makes them durable.
class DurableFile {
 public:
  DurableFile(const std::filesystem::path& file, unsigned mode);  ///< must not exist
  ~DurableFile();
  DurableFile(const DurableFile&) = delete;
  DurableFile& operator=(const DurableFile&) = delete;

  void write(std::string_view bytes);
  void close();

 private:
  std::filesystem::path file_;
  int fd_;
};

/// Held by one process at a time, until it ends, however it ends.
class FolderLock {
 public:
  /// @throws JobFailed with `busy` when another process holds it
  FolderLock(const std::filesystem::path& file, const char* busy);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_;
};

}  // namespace clamber
