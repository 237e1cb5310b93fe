#include "certificate/certificate.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "control/plan_image.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "the samples are written as they lie");

constexpr const char* kFormat = "clamber certificate";
constexpr int kVersion = 1;
constexpr std::size_t kSampleDoubles = 2 + 2 * kQuantityCount;  // the mask takes one's place

Json limits_json(const Acceptance& acceptance) {
  Json json;
  for (std::size_t q = 0; q < kQuantityCount; ++q)
    if (kQuantities[q].sense != Sense::kRecord)
      json[kQuantities[q].name] = acceptance.limit.values[q];
  return json;
}

Json acceptance_json(const Acceptance& acceptance) {
  return {{"uncertainty",
           {{"friction_share", acceptance.uncertainty.friction_share},
            {"mass_share", acceptance.uncertainty.mass_share},
            {"height", acceptance.uncertainty.height},
            {"start_position", acceptance.uncertainty.start_position},
            {"start_yaw", acceptance.uncertainty.start_yaw}}},
          {"limits", limits_json(acceptance)},
          {"residual_moment_at_samples", acceptance.at_samples_moment},
          {"stored_tolerance", acceptance.stored_tolerance}};
}

Acceptance acceptance_of(const Json& json) {
  Acceptance acceptance;
  const Json& uncertainty = json.at("uncertainty");
  acceptance.uncertainty.friction_share = uncertainty.at("friction_share").get<double>();
  acceptance.uncertainty.mass_share = uncertainty.at("mass_share").get<double>();
  acceptance.uncertainty.height = uncertainty.at("height").get<double>();
  acceptance.uncertainty.start_position = uncertainty.at("start_position").get<double>();
  acceptance.uncertainty.start_yaw = uncertainty.at("start_yaw").get<double>();
  for (std::size_t q = 0; q < kQuantityCount; ++q)
    if (kQuantities[q].sense != Sense::kRecord)
      acceptance.limit.values[q] = json.at("limits").at(kQuantities[q].name).get<double>();
  acceptance.at_samples_moment = json.at("residual_moment_at_samples").get<double>();
  acceptance.stored_tolerance = json.at("stored_tolerance").get<double>();
  return acceptance;
}

std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g %%", 100.0 * share);
  return text;
}

Json uncertainty_json(const Certificate& certificate) {
  Json rows = Json::array();
  for (const HeldUncertainty& held : held_uncertainty(certificate))
    rows.push_back({{"what", held.what},
                    {"unit", held.unit},
                    {"stated", held.stated},
                    {"holds", held.holds},
                    {"covered", held.holds >= held.stated}});
  return rows;
}

/// What the margins hold for, and what nobody should read into them.
Json coverage_json(const Certificate& certificate) {
  const CertificateHeader& h = certificate.header;
  const Uncertainty& u = h.acceptance.uncertainty;
  const auto held = [&](Quantity q) { return std::max(0.0, worst_of(certificate, q).proven); };
  char text[400];
  Json covered = Json::array(), open = Json::array();
  const auto note = [&](bool holds) { (holds ? covered : open).push_back(text); };
  const double certified = u.friction_share * h.friction;
  std::snprintf(text, sizeof text,
                "friction %.3g and above on every surface (the scenario's is %.3g): the contact "
                "forces lie in the cones of %.3g",
                certified, h.friction, certified);
  note(true);
  covered.push_back("all masses larger or smaller by up to " + percent(u.mass_share) +
                    " together: forces and torques scale alike, cones do not care, and "
                    "torque_slack_heavy holds");
  const double mass = held(Quantity::kMassHeld);
  std::snprintf(text, sizeof text,
                "every single mass wrong by up to %.3g %%, in any combination, as to torques and "
                "friction cones: mass_held (at the samples; stated: %.3g %%)",
                100.0 * mass, 100.0 * u.mass_share);
  note(mass >= u.mass_share);
  const double height = held(Quantity::kHeightHeld);
  std::snprintf(text, sizeof text,
                "an obstacle higher by up to %.1f mm, as to links that shall not touch it: "
                "height_held (stated: %.1f mm)",
                1e3 * height, 1e3 * u.height);
  note(height >= u.height);
  const double start = held(Quantity::kStartHeld);
  std::snprintf(
      text, sizeof text,
      "a start up to %.1f mm and %.2f degrees elsewhere, the obstacle's height wrong as "
      "well, as to links that shall not touch, legs that swing past its faces, and contacts "
      "that stay on its top: start_held (stated: %.1f mm and %.2f degrees)",
      1e3 * start * u.start_position, start * u.start_yaw * 180.0 / M_PI, 1e3 * u.start_position,
      u.start_yaw * 180.0 / M_PI);
  note(start >= 1.0);
  std::snprintf(text, sizeof text,
                "ground, obstacle and all tilted by up to %.2f degrees, as to the centre of mass "
                "above its support: tilt_held",
                held(Quantity::kTiltHeld) * 180.0 / M_PI);
  note(true);
  std::snprintf(
      text, sizeof text,
      "contact forces and joint torques with the obstacle at another height: they are "
      "checked at %.4g m; contacts then land earlier or later, and the joints' compliance "
      "takes it up",
      h.obstacle_height);
  note(false);
  open.push_back("links beside a contact on the same surface, where the start is elsewhere");
  open.push_back(
      "inertia: the forces balance the robot at rest; support_margin_moving is what its "
      "motion leaves, at the samples");
  return {
      {"uncertainty", uncertainty_json(certificate)}, {"covered", covered}, {"not_covered", open}};
}

Json worst_json(const Certificate& certificate) {
  Json json;
  for (std::size_t q = 0; q < kQuantityCount; ++q) {
    if (kQuantities[q].sense == Sense::kRecord) continue;
    const WorstValue worst = worst_of(certificate, static_cast<Quantity>(q));
    json[kQuantities[q].name] = {{"value", worst.value},
                                 {"with_gap", worst.proven},
                                 {"time", worst.time},
                                 {"unit", kQuantities[q].unit}};
  }
  return json;
}

template <class T>
void put(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

class Bytes {
 public:
  Bytes(std::string_view bytes, const std::string& file) : rest_(bytes), file_(file) {}
  template <class T>
  void take(T& value) {
    if (rest_.size() < sizeof value) throw InputError(file_ + ": the samples are cut short");
    std::memcpy(&value, rest_.data(), sizeof value);
    rest_.remove_prefix(sizeof value);
  }
  [[nodiscard]] bool empty() const { return rest_.empty(); }

 private:
  std::string_view rest_;
  const std::string& file_;
};

}  // namespace

std::string limits_digest(const RobotModel& model) {
  Json json = Json::array();
  for (const Joint& joint : model.joints)
    json.push_back(
        {joint.name, joint.lower, joint.upper, joint.velocity_limit, joint.torque_limit});
  return sha256_hex(json.dump());
}

std::string image_digest(const PlannedMotion& motion, const RobotModel& model) {
  PlanImageHeader header;
  header.joint_count = static_cast<std::uint32_t>(model.joints.size());
  const auto put_text = [](const std::string& text, std::array<char, 64>& field) {
    std::copy_n(text.begin(), std::min(text.size(), field.size()), field.begin());
  };
  put_text(motion.robot_hash, header.robot_hash);
  put_text(motion.scenario_hash, header.scenario_hash);
  header.friction = motion.friction;
  std::vector<ImageKeyframe> keyframes(motion.knots.size());
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    const MotionKnot& knot = motion.knots[k];
    keyframes[k].time = knot.time;
    keyframes[k].phase = static_cast<std::uint32_t>(knot.phase);
    keyframes[k].failure_policy =
        static_cast<std::uint32_t>(motion.failure_policies[static_cast<std::size_t>(knot.phase)]);
    std::copy(knot.q.begin(), knot.q.end(), keyframes[k].q.begin());
    std::copy(knot.tau.begin(), knot.tau.end(), keyframes[k].tau.begin());
  }
  std::vector<std::byte> image(plan_image_size(keyframes.size()));
  if (!write_plan_image(header, keyframes, image)) throw InputError("plan: no keyframes");
  return sha256_hex({reinterpret_cast<const char*>(image.data()), image.size()});
}

WorstValue worst_of(const Certificate& certificate, Quantity quantity) {
  const double sign =
      kQuantities[static_cast<std::size_t>(quantity)].sense == Sense::kError ? -1 : 1;
  WorstValue worst{sign * 1e300, sign * 1e300, 0.0};
  for (const CertificateSample& sample : certificate.samples) {
    const double value = sample.measured.value[quantity];
    const double proven = value - sign * sample.measured.gap[quantity];
    if (sign * value < sign * worst.value) worst.value = value;
    if (sign * proven < sign * worst.proven) {
      worst.proven = proven;
      worst.time = sample.time;
    }
  }
  return worst;
}

std::vector<HeldUncertainty> held_uncertainty(const Certificate& certificate) {
  const Uncertainty& u = certificate.header.acceptance.uncertainty;
  const auto held = [&](Quantity q) { return std::max(0.0, worst_of(certificate, q).proven); };
  const double start = held(Quantity::kStartHeld);
  // Forces outside of these cones, and torques that the heavier robot has not, refuse a
  // certificate.
  const double friction = u.friction_share * certificate.header.friction;
  return {{"friction, at least", "", friction, friction},
          {"obstacle height", "m", u.height, held(Quantity::kHeightHeld)},
          {"start position", "m", u.start_position, start * u.start_position},
          {"start yaw", "rad", u.start_yaw, start * u.start_yaw},
          {"all masses together", "share", u.mass_share, u.mass_share},
          {"every single mass", "share", u.mass_share, held(Quantity::kMassHeld)},
          {"tilt of the ground", "rad", 0.0, held(Quantity::kTiltHeld)}};
}

namespace {

std::string format_samples(const Certificate& certificate) {
  std::string body;
  body.reserve(certificate.samples.size() * (kSampleDoubles + 30) * sizeof(double));
  for (const CertificateSample& sample : certificate.samples) {
    put(body, sample.time);
    put(body, sample.touching);
    put(body, sample.measured.value.values);
    put(body, sample.measured.gap.values);
    for (const Eigen::Vector3d& force : sample.forces)
      for (const double x : {force.x(), force.y(), force.z()}) put(body, x);
  }
  return body;
}

std::string format_header(const Certificate& certificate, std::string_view body) {
  const CertificateHeader& h = certificate.header;
  Json json = {{"format", kFormat},
               {"version", kVersion},
               {"tool_version", h.tool_version},
               {"plan_sha256", h.plan_sha256},
               {"image_sha256", h.image_sha256},
               {"robot", h.robot},
               {"robot_hash", h.robot_hash},
               {"scenario", h.scenario},
               {"scenario_hash", h.scenario_hash},
               {"limits_sha256", h.limits_sha256},
               {"friction", h.friction},
               {"obstacle_height", h.obstacle_height},
               {"ballast_mass", h.ballast_mass},
               {"total_mass", h.total_mass},
               {"spacing", h.spacing},
               {"samples", certificate.samples.size()},
               {"samples_sha256", sha256_hex(body)},
               {"acceptance", acceptance_json(h.acceptance)},
               {"coverage", coverage_json(certificate)},
               {"worst", worst_json(certificate)}};
  return json.dump() + '\n';
}

}  // namespace

std::string format_certificate(const Certificate& certificate) {
  const std::string body = format_samples(certificate);
  return format_header(certificate, body) + body;
}

Certificate parse_certificate(std::string_view bytes, const std::string& file) {
  const std::size_t line = bytes.find('\n');
  if (line == std::string_view::npos) throw InputError(file + ": not a certificate");
  Certificate certificate;
  CertificateHeader& h = certificate.header;
  const std::string_view body = bytes.substr(line + 1);
  std::size_t count = 0;
  std::string samples_sha256;
  try {
    const Json json = Json::parse(bytes.substr(0, line));
    if (json.at("format") != kFormat || json.at("version") != kVersion)
      throw InputError(file + ": expected a \"" + kFormat + "\" of version 1");
    h.tool_version = json.at("tool_version").get<std::string>();
    h.plan_sha256 = json.at("plan_sha256").get<std::string>();
    h.image_sha256 = json.at("image_sha256").get<std::string>();
    h.robot = json.at("robot").get<std::string>();
    h.robot_hash = json.at("robot_hash").get<std::string>();
    h.scenario = json.at("scenario").get<std::string>();
    h.scenario_hash = json.at("scenario_hash").get<std::string>();
    h.limits_sha256 = json.at("limits_sha256").get<std::string>();
    h.friction = json.at("friction").get<double>();
    h.obstacle_height = json.at("obstacle_height").get<double>();
    h.ballast_mass = json.at("ballast_mass").get<double>();
    h.total_mass = json.at("total_mass").get<double>();
    h.spacing = json.at("spacing").get<double>();
    count = json.at("samples").get<std::size_t>();
    samples_sha256 = json.at("samples_sha256").get<std::string>();
    h.acceptance = acceptance_of(json.at("acceptance"));
  } catch (const Json::exception& error) {
    throw InputError(file + ": not a certificate: " + error.what());
  }
  if (sha256_hex(body) != samples_sha256)
    throw InputError(file + ": the samples are not those that the header names");
  if (count > body.size() / (kSampleDoubles * sizeof(double)))
    throw InputError(file + ": the samples are cut short");
  Bytes rest(body, file);
  certificate.samples.resize(count);
  for (CertificateSample& sample : certificate.samples) {
    rest.take(sample.time);
    rest.take(sample.touching);
    rest.take(sample.measured.value.values);
    rest.take(sample.measured.gap.values);
    sample.forces.resize(static_cast<std::size_t>(std::popcount(sample.touching)));
    for (Eigen::Vector3d& force : sample.forces)
      for (Eigen::Index i = 0; i < 3; ++i) rest.take(force[i]);
  }
  if (!rest.empty()) throw InputError(file + ": more bytes than samples");
  // One certificate, one text: what is derived from the samples is theirs, and nothing is added.
  if (format_header(certificate, body) != bytes.substr(0, line + 1))
    throw InputError(file + ": the header is not the one that these samples give");
  return certificate;
}

void save_certificate(const Certificate& certificate, const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::binary);
  out << format_certificate(certificate);
  out.close();
  if (!out) throw InputError(file.string() + ": cannot write the certificate");
}

}  // namespace clamber
