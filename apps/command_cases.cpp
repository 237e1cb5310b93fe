// clamber cases: climbs of several robots and recordings, as a table.
#include <cstdlib>
#include <iostream>
#include <memory>

#include "apps/case_list.hpp"
#include "apps/commands.hpp"
#include "apps/config_files.hpp"

namespace clamber {
namespace {

struct Options {
  std::string list;
  std::string out = "out/cases";
  std::string table;
  std::string recordings;
};

std::string recordings_folder(const Options& options) {
  if (!options.recordings.empty()) return options.recordings;
  const char* folder = std::getenv("CLAMBER_RECORDINGS");
  return folder != nullptr ? folder : "recordings";
}

void run(const Options& options) {
  const CaseList list = load_case_list(find_file(options.list));
  const std::string table = options.table.empty() ? options.out + "/table.md" : options.table;
  std::vector<CaseRow> rows;
  for (const ClimbCase& climb : list.cases) {
    rows.push_back(run_case(climb, options.out, recordings_folder(options)));
    const CaseRow& row = rows.back();
    std::cout << row.name << ": "
              << (row.climbs    ? "climbs"
                  : row.skipped ? "skipped: no recordings"
                                : "no, " + row.why)
              << std::endl;
  }
  write_text(table, case_table(list, rows));
  std::cout << "written: " << table << '\n';
}

}  // namespace

void add_cases_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("cases", "Climbs of several robots and recordings, as a table");
  command->add_option("list", options->list, "the cases, e.g. configs/cases/robots.yaml")
      ->required();
  command->add_option("--out", options->out, "folder for everything")->capture_default_str();
  command->add_option("--table", options->table, "the table (OUT/table.md)");
  command->add_option("--recordings", options->recordings,
                      "folder of recordings that are not found as named ($CLAMBER_RECORDINGS)");
  command->footer(
      "Every case is planned, certified, run with feed-forward and judged. A row whose recording\n"
      "is not there says so. Exit code 0: every case ran, whether the robot climbed or not.\n\n"
      "Example:\n"
      "  clamber cases configs/cases/robots.yaml --table docs/results/robots.md");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
