// Writes the report of one climb: report.html with everything in it, and the pictures beside it.
// Off-line only: allocates, renders, writes files.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "planner_offline/plan.hpp"
#include "report/run_data.hpp"
#include "report/summary.hpp"

namespace clamber {

/// One state of a contact sequence as the paper prints it: its links and its stability measure.
struct ContactTableState {
  std::string name;                ///< "State1"
  std::vector<std::string> links;  ///< contact link names
  double s = 0.0;                  ///< 0: absolute stability (paper III-C)
};
using ContactTable = std::vector<ContactTableState>;

/// Rows of a two-column table.
using NamedValues = std::vector<std::pair<std::string, std::string>>;

/// One margin of the plan's certificate, as the verifier found it.
struct CertifiedMargin {
  std::string name;
  std::string unit;
  double worst = 0.0;     ///< at a sample
  double with_gap = 0.0;  ///< the worst that may be between samples
  double limit = 0.0;
  double time = 0.0;  ///< s
  std::string phase;
};

/// The plan's certificate; `samples` 0: there is none.
struct CertificateTable {
  bool valid = false;
  std::size_t samples = 0;
  std::vector<CertifiedMargin> margins;
  std::vector<std::string> covered;
  std::vector<std::string> not_covered;
};

struct ReportInput {
  Plan plan;
  RunData climb;
  std::optional<RunData> playback;
  ContactTable contacts;          ///< every state of the playback analysis
  ContactTable reduced_contacts;  ///< only those with absolute stability
  Summary summary;
  CertificateTable certificate;
  NamedValues counters;     ///< telemetry and DDS: frames published, dropped ...
  std::string viewer;       ///< file beside the report that shows the climb in 3D, or ""
  NamedValues environment;  ///< versions of tool, libraries, compiler, system
};

/// Writes into `out_dir` (made if missing): report.html, torque.svg and, where the machine can
/// draw, climb.png (eight moments of the climb) and playback.png. Without EGL the report says so
/// and has no pictures. @throws InputError when a file cannot be written.
void write_report(const ReportInput& input, const std::filesystem::path& out_dir);

}  // namespace clamber
