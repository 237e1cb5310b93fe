// Runs the built `clamber` in a process of its own and keeps what it said.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace clamber::test {

namespace fs = std::filesystem;

inline std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

struct CommandResult {
  int exit_code = -1;
  std::string out;
  std::string error;
};

/// @param arguments as typed after `clamber`
/// @param folder working directory; gets files with the output
inline CommandResult clamber(const std::string& arguments, const fs::path& folder,
                             const std::string& environment = "") {
  const fs::path out = folder / "stdout.txt";
  const fs::path error = folder / "stderr.txt";
  const std::string line = "cd '" + folder.string() + "' && " + environment + " '" +
                           CLAMBER_PROGRAM + "' " + arguments + " >'" + out.string() + "' 2>'" +
                           error.string() + "' </dev/null";
  const int status = std::system(line.c_str());
  return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
          .out = text_of(out),
          .error = text_of(error)};
}

/// An empty folder that is gone at the end of the scope.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::string& name)
      : path_(fs::path(testing::TempDir()) / ("clamber_" + name)) {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~TemporaryFolder() {
    std::error_code error;
    fs::remove_all(path_, error);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

}  // namespace clamber::test
