// The verifier must not lean on the planner: none of its sources, nor what they include, is the
// planner's.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>

namespace {

namespace fs = std::filesystem;

void follow(const fs::path& root, const std::string& file, std::set<std::string>& seen) {
  if (!fs::exists(root / file) || !seen.insert(file).second) return;
  std::ifstream in(root / file);
  for (std::string line; std::getline(in, line);) {
    if (line.rfind("#include \"", 0) != 0) continue;
    follow(root, line.substr(10, line.find('"', 10) - 10), seen);
  }
}

TEST(Verifier, IncludesNothingOfThePlanner) {
  const fs::path root = CLAMBER_SOURCE_DIR;
  std::set<std::string> seen;
  for (const char* file :
       {"acceptance", "body_motion", "certificate", "convex_distance", "measure", "measure_masses",
        "measure_uncertainty", "planned_motion", "support_polygon", "verify"})
    follow(root, std::string("certificate/") + file + ".cpp", seen);
  EXPECT_GT(seen.size(), 20u);
  for (const std::string& file : seen)
    EXPECT_EQ(file.find("planner_offline"), std::string::npos) << file;
}

}  // namespace
