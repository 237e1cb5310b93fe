#include "apps/config_files.hpp"

#include <cstdlib>
#include <system_error>

namespace clamber {
namespace {

namespace fs = std::filesystem;

}  // namespace

fs::path configs_folder() {
  if (const char* folder = std::getenv("CLAMBER_CONFIGS"); folder != nullptr && *folder != '\0')
    return folder;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  // build/<preset>/apps/clamber
  const fs::path built_in = program.parent_path().parent_path().parent_path().parent_path();
  // A bundle's slot and an installed package: bin/clamber.
  const fs::path installed = program.parent_path().parent_path();
  for (const fs::path& root :
       {installed, installed / "share/clamber", built_in, fs::path(CLAMBER_SOURCE_DIR)})
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
