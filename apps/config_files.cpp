#include "apps/config_files.hpp"

#include <cstdlib>
#include <fstream>
#include <string>
#include <system_error>

namespace clamber {
namespace {

namespace fs = std::filesystem;

/// The source tree of the build folder that the program lies in; empty: it lies in none.
fs::path source_tree(const fs::path& program) {
  for (fs::path folder = program.parent_path(); folder.has_relative_path();
       folder = folder.parent_path()) {
    std::ifstream in(folder / "clamber_sources");
    if (std::string relative; std::getline(in, relative))
      return (folder / relative).lexically_normal();
  }
  return {};
}

}  // namespace

fs::path configs_folder() {
  if (const char* folder = std::getenv("CLAMBER_CONFIGS"); folder != nullptr && *folder != '\0')
    return folder;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  // A bundle's slot and an installed package: bin/clamber.
  const fs::path installed = program.parent_path().parent_path();
  for (const fs::path& root : {installed, installed / "share/clamber", source_tree(program)})
    if (!root.empty() && fs::is_directory(root / "configs" / "robots", error))
      return root / "configs";
  return "configs";
}

fs::path find_file(const std::string& name) {
  const std::string prefix = "configs/";
  std::error_code error;
  if (fs::exists(name, error) || !name.starts_with(prefix)) return name;
  const fs::path shipped = configs_folder() / name.substr(prefix.size());
  return fs::exists(shipped, error) ? shipped : fs::path(name);
}

fs::path find_robot(const std::string& name) {
  const fs::path file = find_file(name);
  std::error_code error;
  return fs::is_directory(file, error) ? file / "robot.yaml" : file;
}

}  // namespace clamber
