// The records of a sweep as tables and a picture.
// One thread; allocates; reads and writes files; throws InputError.
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/sweep_grid.hpp"

namespace clamber {

/// One record (sweep_case.hpp) and the times of its stages, null where they are not there.
struct SweepCase {
  nlohmann::ordered_json record;
  nlohmann::ordered_json times;
};

/// Every record in the folders, sorted by parameters. A case that several folders hold must be the
/// same in all.
/// @throws InputError when there is none, one is damaged, or they were made from other inputs or by
///         another version
[[nodiscard]] std::vector<SweepCase> load_cases(const std::vector<std::filesystem::path>& folders);
/// Those of these points only. @throws InputError also when one is missing
[[nodiscard]] std::vector<SweepCase> load_cases(const std::filesystem::path& folder,
                                                const std::vector<SweepPoint>& points);

/// table.csv: everything but times, so that the same cases give the same bytes.
[[nodiscard]] std::string sweep_csv(const std::vector<SweepCase>& cases);
/// table.md: what to read, with the planning times.
[[nodiscard]] std::string sweep_markdown(const std::vector<SweepCase>& cases);
/// sweep.svg: success, peak torque, worst support margin and planning time over height and
/// friction, a row of panels for every depth, distance and ballast.
[[nodiscard]] std::string sweep_picture(const std::vector<SweepCase>& cases);

/// How many cases, how many succeeded, how many of the full grid of their parameters are missing.
[[nodiscard]] std::string sweep_summary(const std::vector<SweepCase>& cases);

/// Writes table.csv, table.md and sweep.svg.
void write_sweep_tables(const std::vector<SweepCase>& cases, const std::filesystem::path& folder);

}  // namespace clamber
