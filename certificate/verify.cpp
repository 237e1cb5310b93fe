#include "certificate/verify.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "control/crc32c.hpp"
#include "control/plan_image.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

constexpr double kCoarsestSpacing = 0.01;   // s
constexpr double kStep = 1e-6;              // m or rad, of the differences of potential energy
constexpr double kGravityTolerance = 1e-5;  // N m: 300 J, differenced at 1e-6, in double
constexpr std::size_t kGravityEvery = 97;   // samples; prime, so that it meets all phases

std::string numbers(const char* format, double a, double b = 0.0, double c = 0.0) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b, c);
  return text;
}

double potential_energy(const RobotModel& model, const Configuration& x) {
  RobotData data;
  forward_kinematics(model, x, data);
  double energy = 0.0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b)
    energy += model.bodies[b].mass * kGravity * data.com_W[b].z();
  return energy;
}

class Verifier {
 public:
  Verifier(const PlannedMotion& motion, const Certificate& certificate, const RobotModel& model,
           const Scenario& scenario, const Acceptance& acceptance, const VerifyOptions& options)
      : motion_(motion),
        certificate_(certificate),
        model_(model),
        scenario_(scenario),
        acceptance_(acceptance),
        options_(options),
        measure_(model, scenario, motion, acceptance.uncertainty) {}

  VerifyReport run() {
    if (const std::string wrong = header_mismatch(); !wrong.empty()) {
      refuse(wrong);
      return report_;
    }
    times_ = sample_times(motion_, certificate_.header.spacing);
    if (times_.size() != certificate_.samples.size()) {
      refuse(numbers("%.0f samples where the plan needs %.0f",
                     static_cast<double>(certificate_.samples.size()),
                     static_cast<double>(times_.size())));
      return report_;
    }
    start_worst();
    for (std::size_t i = 0; i < times_.size() && (report_.violations == 0 || options_.all); ++i) {
      const std::string wrong = check_sample(i);
      ++report_.samples;
      const auto phase = static_cast<std::size_t>(motion_.segments[times_[i].segment].phase);
      if (!wrong.empty())
        refuse(numbers("at %.3f s, ", times_[i].time) + motion_.phases[phase] + ": " + wrong);
    }
    report_.valid = report_.violations == 0;
    return report_;
  }

 private:
  void refuse(const std::string& reason) {
    if (report_.violations++ == 0) report_.reason = reason;
  }

  /// What the header binds, compared with what is there.
  [[nodiscard]] std::string header_mismatch() const {
    const CertificateHeader& h = certificate_.header;
    const auto differs = [](const char* what, const std::string& is, const std::string& wanted) {
      return std::string(what) + ": certified for '" + is + "', not '" + wanted + "'";
    };
    if (h.plan_sha256 != motion_.sha256) return differs("plan", h.plan_sha256, motion_.sha256);
    if (const std::string image = image_digest(motion_, model_); h.image_sha256 != image)
      return differs("plan image", h.image_sha256, image);
    if (h.robot_hash != model_.hash) return differs("robot model", h.robot_hash, model_.hash);
    if (h.robot != model_.name) return differs("robot", h.robot, model_.name);
    if (motion_.robot_hash != model_.hash)
      return "the plan was made for another robot model: " + motion_.robot_hash;
    if (h.scenario_hash != scenario_.hash)
      return differs("scenario", h.scenario_hash, scenario_.hash);
    if (h.scenario != scenario_.name) return differs("scenario", h.scenario, scenario_.name);
    if (motion_.scenario_hash != scenario_.hash)
      return "the plan was made for another scenario: " + motion_.scenario_hash;
    if (h.limits_sha256 != limits_digest(model_))
      return differs("joint limits", h.limits_sha256, limits_digest(model_));
    if (h.tool_version != motion_.tool_version)
      return differs("tool version", h.tool_version, motion_.tool_version);
    double mass = 0.0;
    for (const Body& body : model_.bodies) mass += body.mass;
    const double height = scenario_.obstacles.empty() ? 0.0 : scenario_.obstacles.front().top();
    const struct {
      const char* what;
      double is, wanted;
    } figures[] = {{"friction", h.friction, scenario_.friction},
                   {"friction of the plan", motion_.friction, scenario_.friction},
                   {"obstacle height", h.obstacle_height, height},
                   {"ballast", h.ballast_mass, model_.ballast_mass},
                   {"ballast of the plan", motion_.ballast_mass, model_.ballast_mass},
                   {"mass", h.total_mass, mass}};
    for (const auto& figure : figures)
      if (!(std::abs(figure.is - figure.wanted) <= 1e-9))
        return std::string(figure.what) +
               numbers(": certified for %.9g, not %.9g", figure.is, figure.wanted);
    if (!(h.spacing > 0.0 && h.spacing <= kCoarsestSpacing))
      return numbers("samples %.4g s apart, at most %.4g allowed", h.spacing, kCoarsestSpacing);
    if (!(h.acceptance == acceptance_))
      return "certified for other margins or another uncertainty than are asked for here";
    return {};
  }

  void start_worst() {
    report_.quantities.resize(kQuantityCount);
    for (std::size_t q = 0; q < kQuantityCount; ++q) {
      const double best = kQuantities[q].sense == Sense::kError ? -1e300 : 1e300;
      report_.quantities[q] = {{best, best, 0.0}, acceptance_.limit.values[q], {}};
    }
  }

  std::string check_sample(std::size_t i) {
    const CertificateSample& stored = certificate_.samples[i];
    const SampleTime& at = times_[i];
    if (stored.time != at.time) return numbers("the sample says %.6f s", stored.time);
    measure_.place(at);
    if (const std::string wrong = check_touching(i); !wrong.empty()) return wrong;
    for (const Eigen::Vector3d& force : stored.forces)
      if (!force.allFinite()) return "a contact force is not finite";
    const auto& samples = certificate_.samples;
    const double rate = force_rate(at, samples[i > 0 ? i - 1 : i].forces, stored.forces,
                                   samples[i + 1 < samples.size() ? i + 1 : i].forces);
    const Measured here = measure_.measure(stored.touching, stored.forces, rate);
    note_worst(here, at);
    if (const std::string wrong = check_margins(here); !wrong.empty()) {
      ++report_.unphysical;
      return wrong;
    }
    if (options_.stored)
      if (const std::string wrong = check_stored(stored.measured, here); !wrong.empty())
        return wrong;
    return i % kGravityEvery == 0 ? check_gravity() : std::string();
  }

  /// Which points touch is constant in a segment, and they are of links that the plan puts down,
  /// each of which touches somewhere.
  std::string check_touching(std::size_t i) {
    const TouchMask mask = certificate_.samples[i].touching, resting = measure_.resting();
    if (times_[i].before > 0.0 && mask != certificate_.samples[i - 1].touching)
      return "the touching points change between two keyframes";
    if ((mask & ~resting) != 0) return "a point touches that the plan has not in contact";
    for (std::size_t p = 0; p < measure_.candidates().size(); ++p) {
      if ((resting >> p & 1) == 0) continue;
      bool touches = false;
      for (std::size_t o = 0; o < measure_.candidates().size(); ++o)
        touches |=
            measure_.candidates()[o].link == measure_.candidates()[p].link && (mask >> o & 1);
      if (!touches)
        return "contact " +
               model_.contacts[static_cast<std::size_t>(measure_.candidates()[p].link)].name +
               " of the plan touches nowhere";
    }
    return {};
  }

  void note_worst(const Measured& here, const SampleTime& at) {
    for (std::size_t q = 0; q < kQuantityCount; ++q) {
      const double sign = kQuantities[q].sense == Sense::kError ? -1.0 : 1.0;
      WorstValue& worst = report_.quantities[q].worst;
      const double value = here.value.values[q], proven = value - sign * here.gap.values[q];
      if (sign * value < sign * worst.value) worst.value = value;
      if (!(sign * proven >= sign * worst.proven)) {
        worst.proven = proven;
        worst.time = at.time;
        report_.quantities[q].phase =
            motion_.phases[static_cast<std::size_t>(motion_.segments[at.segment].phase)];
      }
    }
  }

  [[nodiscard]] std::string check_margins(const Measured& here) const {
    const double moment = here.value[Quantity::kResidualMoment];
    if (!(moment <= acceptance_.at_samples_moment))
      return numbers("residual_moment %.6g N m, at most %.6g at a sample", moment,
                     acceptance_.at_samples_moment);
    for (std::size_t q = 0; q < kQuantityCount; ++q) {
      const QuantityInfo& info = kQuantities[q];
      if (info.sense == Sense::kRecord) continue;
      const double sign = info.sense == Sense::kError ? -1.0 : 1.0;
      const double proven = here.value.values[q] - sign * here.gap.values[q];
      const double beyond = sign * (acceptance_.limit.values[q] - proven);
      // A limit may be met exactly, as by toes 10 mm before the obstacle: what rounding makes of it
      // is no violation.
      constexpr double kRounding = 1e-9;  // of the quantity's unit
      if (!(beyond <= kRounding))
        return std::string(info.name) +
               numbers(" %.6g, limit %.6g, beyond it by %.3g ", proven, acceptance_.limit.values[q],
                       beyond) +
               info.unit;
    }
    return {};
  }

  std::string check_stored(const Measured& stored, const Measured& here) {
    for (std::size_t q = 0; q < kQuantityCount; ++q)
      for (const auto& [is, should] : {std::pair{stored.value.values[q], here.value.values[q]},
                                       std::pair{stored.gap.values[q], here.gap.values[q]}}) {
        const double error = std::abs(is - should);
        if (!(error <= acceptance_.stored_tolerance))
          return std::string(kQuantities[q].name) +
                 numbers(": the certificate says %.9g, it is %.9g", is, should);
        report_.stored_error = std::max(report_.stored_error, error);
      }
    return {};
  }

  /// Gravity is a potential: whoever turns a joint lifts the masses behind it.
  std::string check_gravity() {
    VelocityVector g, step = VelocityVector::Zero(model_.velocity_count());
    gravity_torque(model_, measure_.data(), g);
    JointVector own;
    Eigen::Vector3d force, moment;
    measure_.statics(0, {}, own, force, moment);
    for (Eigen::Index i = 0; i < g.size(); ++i) {
      Configuration forwards, backwards;
      step[i] = kStep;
      integrate(model_, measure_.state().x, step, forwards);
      integrate(model_, measure_.state().x, -step, backwards);
      step[i] = 0.0;
      const double difference =
          (potential_energy(model_, forwards) - potential_energy(model_, backwards)) /
          (2.0 * kStep);
      const double summed = i >= 6 ? own[i - 6] : difference;
      const double error = std::max(std::abs(difference - g[i]), std::abs(difference - summed));
      report_.gravity_error = std::max(report_.gravity_error, error);
      if (!(error <= kGravityTolerance))
        return numbers(
            "gravity torque of coordinate %.0f: potential energy says %.9g, the model "
            "%.9g",
            static_cast<double>(i), difference, g[i]);
    }
    return {};
  }

  const PlannedMotion& motion_;
  const Certificate& certificate_;
  const RobotModel& model_;
  const Scenario& scenario_;
  const Acceptance& acceptance_;
  const VerifyOptions& options_;
  Measure measure_;
  std::vector<SampleTime> times_;
  VerifyReport report_;
};

std::string_view text(const std::array<char, 64>& field) {
  return {field.data(),
          static_cast<std::size_t>(std::find(field.begin(), field.end(), '\0') - field.begin())};
}

/// SHA-256 of the image as it was before it got its certificate.
std::string digest_without_certificate(std::span<const std::byte> image, PlanImageHeader header) {
  header.certificate.fill('\0');
  std::vector<std::byte> bytes(image.begin(), image.end());
  std::memcpy(bytes.data(), &header, sizeof header);
  const std::size_t body = bytes.size() - sizeof(std::uint32_t);
  const std::uint32_t crc = crc32c(std::span(bytes).first(body));
  std::memcpy(bytes.data() + body, &crc, sizeof crc);
  return sha256_hex({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace

std::string check_image(std::span<const std::byte> image, const PlannedMotion& motion,
                        const Certificate& certificate, const std::string& certificate_sha256) {
  const std::size_t count = motion.knots.size();
  PlanImageHeader header;
  if (image.size() != plan_image_size(count)) return "the image has another length than the plan";
  std::memcpy(&header, image.data(), sizeof header);
  std::uint32_t crc = 0;
  std::memcpy(&crc, image.data() + image.size() - sizeof crc, sizeof crc);
  if (crc != crc32c(image.first(image.size() - sizeof crc))) return "the image's checksum is wrong";
  if (text(header.certificate) != certificate_sha256)
    return "the image names another certificate: " + std::string(text(header.certificate));
  if (digest_without_certificate(image, header) != certificate.header.image_sha256)
    return "the certificate names another image";
  if (header.version != kPlanImageVersion || header.keyframe_count != count ||
      text(header.robot_hash) != motion.robot_hash ||
      text(header.scenario_hash) != motion.scenario_hash || header.friction != motion.friction)
    return "the image's header is not the plan's";
  const auto joints = static_cast<std::size_t>(motion.knots.front().q.size());
  for (std::size_t k = 0; k < count; ++k) {
    ImageKeyframe keyframe;
    std::memcpy(&keyframe, image.data() + sizeof header + k * sizeof keyframe, sizeof keyframe);
    const MotionKnot& knot = motion.knots[k];
    if (keyframe.time != knot.time || static_cast<int>(keyframe.phase) != knot.phase ||
        keyframe.failure_policy !=
            static_cast<std::uint32_t>(
                motion.failure_policies[static_cast<std::size_t>(knot.phase)]) ||
        !std::equal(knot.q.begin(), knot.q.end(), keyframe.q.begin()) ||
        !std::equal(knot.tau.begin(), knot.tau.end(), keyframe.tau.begin()) ||
        header.joint_count != joints)
      return numbers("keyframe %.0f of the image is not the plan's", static_cast<double>(k));
  }
  return {};
}

VerifyReport verify(const PlannedMotion& motion, const Certificate& certificate,
                    const RobotModel& model, const Scenario& scenario, const Acceptance& acceptance,
                    const VerifyOptions& options) {
  return Verifier(motion, certificate, model, scenario, acceptance, options).run();
}

VerifyReport verify(std::string_view plan, std::string_view certificate, const RobotModel& model,
                    const Scenario& scenario, const Acceptance& acceptance,
                    const VerifyOptions& options) {
  const Certificate read = parse_certificate(certificate, "certificate");
  if (const std::string sha256 = sha256_hex(plan); sha256 != read.header.plan_sha256) {
    VerifyReport report;
    report.violations = 1;
    report.reason = "plan: certified is the one with SHA-256 " + read.header.plan_sha256 +
                    ", this one has " + sha256;
    return report;
  }
  const PlannedMotion motion(plan, "plan", model, scenario);
  return verify(motion, read, model, scenario, acceptance, options);
}

}  // namespace clamber
