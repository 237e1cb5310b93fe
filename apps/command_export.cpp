// clamber export: a finished run as MCAP, CSV or HDF5.
#include <iostream>
#include <map>
#include <memory>

#include "apps/commands.hpp"
#include "apps/run_source.hpp"
#include "recording/run_file.hpp"
#include "robot_model/loader.hpp"

namespace clamber {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string file;
  std::string to;
  RunSourceOptions source;
};

enum class Format { kMcap, kCsv, kHdf5 };

std::optional<Format> format_of(const std::string& name) {
  static const std::map<std::string, Format> formats = {
      {"mcap", Format::kMcap}, {"csv", Format::kCsv}, {"h5", Format::kHdf5}};
  const auto found = formats.find(name);
  return found == formats.end() ? std::nullopt : std::optional(found->second);
}

/// `to` is a file or, alone, a format: the file then stands beside the source.
fs::path target(const Options& options) {
  if (!format_of(options.to)) return options.to;
  return fs::path(options.file).replace_extension(options.to);
}

std::unique_ptr<RunFile> open_target(const fs::path& file, const RunSource& source) {
  const std::string extension = file.extension().string();
  const auto format = format_of(extension.empty() ? "" : extension.substr(1));
  if (!format) throw InputError("--to " + file.string() + ": expected .mcap, .csv or .h5");
  switch (*format) {
    case Format::kMcap:
      return open_mcap(file, source.run, source.model ? &*source.model : nullptr);
    case Format::kCsv:
      return open_csv(file, source.run);
    case Format::kHdf5:
      return open_hdf5(file, source.run);
  }
  return nullptr;
}

void run(const Options& options) {
  const fs::path to = target(options);
  std::error_code error;
  if (fs::equivalent(options.file, to, error))
    throw InputError("--to " + to.string() + ": is the file to export");
  const RunSource source = open_run(options.file, options.source);
  make_folder_of(to.string());
  const std::unique_ptr<RunFile> out = open_target(to, source);
  const CopiedRun copied = copy_run(source, *out);
  if (source.cut())
    std::cout << options.file << ": its end is missing; read up to the last complete second\n";
  std::cout << "written: " << to.string() << ", " << copied.frames << " frames, " << copied.end
            << " s\n";
}

}  // namespace

void add_export_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("export", "Writes a finished run as MCAP, CSV or HDF5");
  command->add_option("file", options->file, "run log (climb.log) or recording (.mcap)")
      ->required();
  command
      ->add_option("--to", options->to,
                   "file ending in .mcap, .csv or .h5; or mcap, csv, h5: beside the run")
      ->required();
  add_run_source_options(*command, options->source);
  command->footer(
      "MCAP opens in Foxglove, PlotJuggler and `clamber web`. A recording whose recorder was\n"
      "killed is read up to its last complete second.\n\n"
      "Examples:\n"
      "  clamber export out/climb/climb.log --to run.mcap\n"
      "  clamber export run.mcap --to csv");
  command->callback([options] { run(*options); });
}

}  // namespace clamber
