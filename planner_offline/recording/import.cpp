#include "planner_offline/recording/import.hpp"

#include <cmath>
#include <string_view>
#include <system_error>

#include "planner_offline/recording/acclaim.hpp"
#include "planner_offline/recording/limb_frames.hpp"
#include "planner_offline/recording/mvnx.hpp"
#include "planner_offline/recording/npy.hpp"
#include "planner_offline/recording/parse_number.hpp"
#include "planner_offline/recording/position_csv.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"

namespace clamber {
namespace {

enum class Format { kMvnx, kNpy, kCsv, kAmc, kAsf, kUnknown };

/// First line that is neither blank nor a comment.
std::string_view first_line(std::string_view text) {
  while (!text.empty()) {
    const auto line = trimmed(next_line(text));
    if (!line.empty() && !line.starts_with('#')) return line;
  }
  return {};
}

Format recognise(std::string_view bytes) {
  if (bytes.starts_with("\x93NUMPY")) return Format::kNpy;
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  const auto line = first_line(bytes);
  if (line.starts_with('<')) return Format::kMvnx;
  if (line.starts_with(":version") || line.starts_with(":name")) return Format::kAsf;
  if (line.starts_with(':') || line == "1") return Format::kAmc;
  if (line.find(',') != std::string_view::npos) return Format::kCsv;
  return Format::kUnknown;
}

std::filesystem::path find_skeleton(const std::filesystem::path& amc,
                                    const ImportOptions& options) {
  if (options.skeleton) return *options.skeleton;
  std::error_code ignored;
  auto beside = amc;
  beside.replace_extension(".asf");
  if (std::filesystem::exists(beside, ignored)) return beside;
  // CMU names: 01_02.amc is trial 2 of subject 01.
  const std::string stem = amc.stem().string();
  const auto subject = amc.parent_path() / (stem.substr(0, stem.rfind('_')) + ".asf");
  if (std::filesystem::exists(subject, ignored)) return subject;
  throw InputError(amc.string() + ": no skeleton beside it: expected " +
                   beside.filename().string() + " or " + subject.filename().string() +
                   ", or name one");
}

double checked_rate(const std::filesystem::path& file, const ImportOptions& options,
                    double fallback) {
  const double rate = options.rate.value_or(fallback);
  if (!(rate >= 1.0 && rate <= 10000.0)) {
    throw InputError(file.string() + ": rate " + std::to_string(rate) + ": expected 1 to 10000 Hz");
  }
  return rate;
}

HumanMotion read(const std::filesystem::path& file, const ImportOptions& options) {
  const std::string bytes = read_file(file, kRecordingBytes);
  const std::string name = file.string();
  switch (recognise(bytes)) {
    case Format::kMvnx:
      return parse_mvnx(bytes, name);
    case Format::kNpy:
      return parse_npy(bytes, name, checked_rate(file, options, kDefaultNpyRate));
    case Format::kCsv:
      return parse_csv(bytes, name);
    case Format::kAmc: {
      const auto skeleton = find_skeleton(file, options);
      return parse_amc(bytes, name,
                       parse_asf(read_file(skeleton, kRecordingBytes), skeleton.string()),
                       checked_rate(file, options, kDefaultAmcRate));
    }
    case Format::kAsf:
      throw InputError(name + ": this is a skeleton (ASF): expected its motion, an .amc file");
    case Format::kUnknown:
      break;
  }
  throw InputError(name + ": expected MVNX, NumPy positions, labelled CSV or Acclaim AMC");
}

HumanMotion import_with_window(const std::filesystem::path& file, const ImportOptions& options,
                               bool cut) {
  HumanMotion motion = read(file, options);
  if (motion.segments.empty()) add_segments(motion);
  auto window = find_climb(motion, options.window);
  motion.floor = window.floor;
  motion.hip_height = window.hip_height;
  motion.heading = window.heading;
  for (auto& warning : window.warnings) motion.warnings.push_back(std::move(warning));
  motion.source = file.filename().string();
  return cut ? slice(motion, window.first, window.last) : motion;
}

}  // namespace

HumanMotion import_recording(const std::filesystem::path& file, const ImportOptions& options) {
  return import_with_window(file, options, true);
}

HumanMotion import_whole_recording(const std::filesystem::path& file,
                                   const ImportOptions& options) {
  return import_with_window(file, options, false);
}

}  // namespace clamber
