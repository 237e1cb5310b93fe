// Only regular files of a sane size are read; whatever else a path leads to is refused at once.
#include "robot_model/read_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;
using testing::EndsWith;

class ReadFile : public testing::Test {
 protected:
  ReadFile() { fs::create_directories(folder_); }
  ~ReadFile() override { fs::remove_all(folder_); }

  [[nodiscard]] fs::path made(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  static std::string error_of(const fs::path& file, std::uintmax_t most_bytes = kSettingsBytes) {
    try {
      return "read " + std::to_string(read_file(file, most_bytes).size()) + " bytes";
    } catch (const InputError& error) {
      return error.what();
    }
  }

  const fs::path folder_ =
      fs::path(testing::TempDir()) / ("clamber_read_file_" + std::to_string(getpid()));
};

TEST_F(ReadFile, GivesEveryByteAlsoThroughALink) {
  const std::string bytes("line\r\n\0\xff end", 12);
  const fs::path file = made("file", bytes);
  fs::create_symlink(file, folder_ / "link");
  EXPECT_EQ(read_file(file), bytes);
  EXPECT_EQ(read_file(folder_ / "link"), bytes);
  EXPECT_EQ(read_file(made("empty", "")), "");
}

TEST_F(ReadFile, RefusesWhatIsNoRegularFile) {
  EXPECT_THAT(error_of(folder_ / "nothing"), EndsWith("nothing: no such file"));
  EXPECT_THAT(error_of(folder_), EndsWith(": is a directory, expected a file"));
  ASSERT_EQ(mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  EXPECT_THAT(error_of(folder_ / "fifo"), EndsWith("fifo: is a FIFO, expected a file"));
  EXPECT_EQ(error_of("/dev/zero"), "/dev/zero: is a device, expected a file");
  fs::create_symlink("/dev/zero", folder_ / "link");
  EXPECT_THAT(error_of(folder_ / "link"), EndsWith("link: is a device, expected a file"));
}

TEST_F(ReadFile, SaysWhyAPathLeadsNowhere) {
  fs::create_symlink("loop", folder_ / "loop");
  EXPECT_THAT(error_of(folder_ / "loop"), testing::HasSubstr("loop: "));
  EXPECT_THAT(error_of(made("file", "") / "below"), EndsWith("below: no such file"));
}

TEST_F(ReadFile, RefusesMoreThanTheKindOfFileMayHave) {
  constexpr std::uintmax_t kMiB = 1U << 20U;
  const fs::path file = made("file", std::string(kMiB, 'x'));
  EXPECT_EQ(read_file(file, kMiB).size(), kMiB);
  std::ofstream(file, std::ios::app) << 'x';
  EXPECT_THAT(error_of(file, kMiB), EndsWith("file: too large, expected at most 1 MiB"));
  // A hole costs no disk, and would cost memory.
  fs::resize_file(file, kRecordingBytes + 1);
  EXPECT_THAT(error_of(file, kRecordingBytes), EndsWith("too large, expected at most 512 MiB"));
}

// Such a file says 0 bytes and delivers what it likes.
TEST_F(ReadFile, CountsWhatAFileWithoutASizeDelivers) {
  const fs::path file = "/proc/self/maps";
  if (!fs::exists(file)) GTEST_SKIP() << "skipped: no /proc";
  EXPECT_GT(read_file(file).size(), 100U);
  EXPECT_THAT(error_of(file, 100), testing::HasSubstr("maps: too large"));
}

}  // namespace
}  // namespace clamber
