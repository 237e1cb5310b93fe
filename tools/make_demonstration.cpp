// Makes the default demonstration: a synthetic MVNX recording of a person climbing onto a table in
// the paper's order of contacts (III-A, III-C).
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "tools/climb_choreography.hpp"
#include "tools/mvnx_writer.hpp"

namespace {

std::string metres_text(double metres) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3f m", metres);
  return text;
}

/// Nothing for the shipped demonstration.
std::string way_text(const clamber::tools::ClimbParameters& parameters) {
  using clamber::tools::ClimbStyle;
  std::string text;
  if (parameters.style == ClimbStyle::kHandsOnly) text = ", without elbows";
  if (parameters.style == ClimbStyle::kBearCrawl) text = ", on hands and feet";
  if (parameters.style == ClimbStyle::kFeetFirst) text = ", one foot first";
  return text + (parameters.right_first ? ", right leg first" : "");
}

int run(const std::string& file, const clamber::tools::ClimbParameters& parameters, int rate) {
  using clamber::tools::ClimbChoreography;
  const ClimbChoreography climb(parameters);
  std::vector<clamber::tools::Figure> figures;
  const int last = static_cast<int>(ClimbChoreography::kDuration * rate);
  for (int i = 0; i <= last; ++i) figures.push_back(climb.at(static_cast<double>(i) / rate));
  const std::string text = clamber::tools::write_mvnx(
      climb.skeleton(), figures, rate,
      "a " + metres_text(parameters.body_height) + " person climbs a " +
          metres_text(parameters.table_height) + " table" + way_text(parameters));
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) {
    std::fprintf(stderr, "make_demonstration: error: cannot write %s\n", file.c_str());
    return 2;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  clamber::tools::ClimbParameters parameters;
  int rate = 60;
  std::string file;
  CLI::App app{"Makes a synthetic recording (MVNX 4) of a person climbing onto a table"};
  app.add_option("output", file, "file to write, e.g. climb_table_synthetic.mvnx")->required();
  app.add_option("--height", parameters.body_height, "body height, m")
      ->check(CLI::Range(1.2, 2.2))
      ->capture_default_str();
  app.add_option("--table-height", parameters.table_height,
                 "table height, m (0.12 to 0.25 of the body height)")
      ->check(CLI::Range(0.05, 1.0))
      ->capture_default_str();
  app.add_option("--rate", rate, "frames per second, Hz")
      ->check(CLI::Range(10, 240))
      ->capture_default_str();
  using clamber::tools::ClimbStyle;
  app.add_option(
         "--style", parameters.style,
         "all-fours: wrists, elbows, knees; hands-only: no elbows; bear-crawl: wrists, feet; "
         "feet-first: foot, wrists, foot")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, ClimbStyle>{{"all-fours", ClimbStyle::kAllFours},
                                            {"hands-only", ClimbStyle::kHandsOnly},
                                            {"bear-crawl", ClimbStyle::kBearCrawl},
                                            {"feet-first", ClimbStyle::kFeetFirst}}));
  app.add_flag("--right-first", parameters.right_first, "the right leg goes up before the left");
  CLI11_PARSE(app, argc, argv);
  try {
    return run(file, parameters, rate);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_demonstration: error: no such climb: %s\n", error.what());
    return 2;
  }
}
