// The certificate of a made plan holds; whatever is changed in plan, world or certificate is
// refused, with all digests made right again so that only the physics can tell.
#include "certificate/verify.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "certificate/writer.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/sha256.hpp"
#include "tests/certificate/made_plan.hpp"

namespace clamber {
namespace {

struct Files {
  std::string plan;
  Certificate certificate;
};

const Files& good() {
  static const Files files = [] {
    const auto& made = test::made_plan();
    Files out{test::text_of(made.plan), {}};
    const PlannedMotion motion(out.plan, "plan", made.model, made.scenario);
    out.certificate = certify(motion, made.model, made.scenario, {});
    return out;
  }();
  return files;
}

VerifyReport judge(const Plan& plan, const Certificate& certificate, const RobotModel& model,
                   const Scenario& scenario, const VerifyOptions& options = {}) {
  const std::string text = test::text_of(plan);
  const PlannedMotion motion(text, "plan", model, scenario);
  Certificate bound = certificate;
  // Everything that binds is made to fit: only what the samples say is left to refuse.
  CertificateHeader& h = bound.header;
  h.plan_sha256 = motion.sha256;
  h.image_sha256 = image_digest(motion, model);
  h.robot_hash = model.hash;
  h.limits_sha256 = limits_digest(model);
  h.scenario_hash = scenario.hash;
  h.friction = scenario.friction;
  h.obstacle_height = scenario.obstacles.front().top();
  h.total_mass = 0.0;
  for (const Body& body : model.bodies) h.total_mass += body.mass;
  return verify(motion, bound, model, scenario, {}, options);
}

VerifyReport judge(const Plan& plan) {
  const auto& made = test::made_plan();
  return judge(plan, good().certificate, made.model, made.scenario);
}

TEST(Verify, TheMadePlanHolds) {
  const auto& made = test::made_plan();
  const VerifyReport report =
      verify(good().plan, format_certificate(good().certificate), made.model, made.scenario, {});
  EXPECT_TRUE(report.valid) << report.reason;
  EXPECT_EQ(report.samples, good().certificate.samples.size());
  EXPECT_GT(report.samples, 390u);
  EXPECT_LT(report.gravity_error, 1e-6);
  EXPECT_EQ(report.quantities.size(), kQuantityCount);
}

TEST(Verify, CertifyingTwiceGivesTheSameBytes) {
  const auto& made = test::made_plan();
  const PlannedMotion motion(good().plan, "plan", made.model, made.scenario);
  EXPECT_EQ(format_certificate(certify(motion, made.model, made.scenario, {})),
            format_certificate(good().certificate));
}

/// The made plan's certificate when its right sole is tilted by `angle` (rad) about the ankle.
Certificate certify_tilted(double angle) {
  const auto& made = test::made_plan();
  Plan plan = made.plan;
  for (Keyframe& k : plan.keyframes) k.x.q[*made.model.find_joint("RAnkLat")] += angle;
  const PlannedMotion motion(test::text_of(plan), "plan", made.model, made.scenario);
  return certify(motion, made.model, made.scenario, {});
}

std::size_t touching_right_corners(TouchMask mask) {
  const auto& model = test::made_plan().model;
  const std::vector<TouchCandidate> candidates = touch_candidates(model);
  std::size_t count = 0;
  for (std::size_t i = 0; i < candidates.size(); ++i)
    if (candidates[i].link == *model.find_contact("Rfoot")) count += mask >> i & 1;
  return count;
}

// A plan's keyframe leaves its contacts by some tenths of a millimetre. All corners must still be
// there to carry, or the witness has other torques than the plan.
TEST(Certify, ASlightlyTiltedSoleStandsOnAllItsCorners) {
  for (const double angle : {-0.015, -0.012, 0.012, 0.015}) {  // 0.6 and 0.75 mm at one edge
    const Certificate certificate = certify_tilted(angle);
    for (const CertificateSample& sample : certificate.samples)
      ASSERT_EQ(touching_right_corners(sample.touching), 4u) << angle << " at " << sample.time;
    EXPECT_LT(worst_of(certificate, Quantity::kFeedForwardError).value, 0.1 / 30.0) << angle;
    const double gap = worst_of(certificate, Quantity::kContactGap).value;
    EXPECT_GT(gap, 5.5e-4) << angle;
    EXPECT_LT(gap, 8e-4) << angle;
  }
}

TEST(Certify, AnEdgeThatHasRisenCarriesNothing) {
  for (const double angle : {-0.04, 0.04}) {  // 2 mm
    const Certificate certificate = certify_tilted(angle);
    for (const CertificateSample& sample : certificate.samples)
      ASSERT_EQ(touching_right_corners(sample.touching), 2u) << angle << " at " << sample.time;
  }
}

TEST(Verify, AJointMovedByAHundredthIsRefusedAtEveryKeyframe) {
  const auto& made = test::made_plan();
  int physics = 0, all = 0;
  for (std::size_t k = 0; k < made.plan.keyframes.size(); k += 3)
    for (Eigen::Index j = static_cast<Eigen::Index>(k % 4); j < made.model.joint_count(); j += 4) {
      Plan plan = made.plan;
      plan.keyframes[k].x.q[j] += (k + static_cast<std::size_t>(j)) % 2 == 0 ? 0.01 : -0.01;
      const VerifyReport report = judge(plan, good().certificate, made.model, made.scenario, {});
      ++all;
      EXPECT_FALSE(report.valid) << "keyframe " << k << " joint " << j;
      const VerifyReport carried =
          judge(plan, good().certificate, made.model, made.scenario, {.stored = false});
      physics += carried.valid ? 0 : 1;
    }
  EXPECT_GT(all, 60);
  // Not the stored numbers alone tell: nearly every one unbalances the witness.
  EXPECT_GE(physics, all * 9 / 10) << all;
}

TEST(Verify, ADroppedContactIsRefused) {
  const auto& made = test::made_plan();
  for (std::size_t k = 1; k < made.plan.keyframes.size(); ++k)
    for (std::size_t c = 0; c < made.plan.keyframes[k].contacts.size(); ++c) {
      Plan plan = made.plan;
      auto& contacts = plan.keyframes[k].contacts;
      contacts.erase(contacts.begin() + static_cast<std::ptrdiff_t>(c));
      EXPECT_FALSE(judge(plan).valid) << "keyframe " << k << " contact " << c;
    }
}

TEST(Verify, AnAddedContactIsRefused) {
  const auto& made = test::made_plan();
  Plan plan = made.plan;
  PlannedContact wrist = made.plan.keyframes[20].contacts[2];
  plan.keyframes[8].contacts.push_back(wrist);
  EXPECT_FALSE(judge(plan).valid);
}

TEST(Verify, AnotherWorldIsRefused) {
  const auto& made = test::made_plan();
  const auto in_world = [&](const std::function<void(Scenario&)>& change) {
    Scenario scenario = made.scenario;
    Plan plan = made.plan;
    change(scenario);
    plan.friction = scenario.friction;
    return judge(plan, good().certificate, made.model, scenario);
  };
  EXPECT_TRUE(in_world([](Scenario&) {}).valid);
  for (const double higher : {0.002, -0.002, 0.01, -0.01})
    EXPECT_FALSE(in_world([&](Scenario& s) {
                   s.obstacles[0].center.z() += 0.5 * higher;
                   s.obstacles[0].half_extents.z() += 0.5 * higher;
                 }).valid)
        << higher;
  for (const double friction : {0.0, 0.01})
    EXPECT_FALSE(in_world([&](Scenario& s) { s.friction = friction; }).valid) << friction;
  EXPECT_FALSE(in_world([](Scenario& s) { s.obstacles[0].center.x() += 0.06; }).valid);
}

TEST(Verify, AnotherRobotIsRefused) {
  const auto& made = test::made_plan();
  const auto with = [&](const std::function<void(RobotModel&)>& change) {
    RobotModel model = made.model;
    change(model);
    return judge(made.plan, good().certificate, model, made.scenario);
  };
  EXPECT_TRUE(with([](RobotModel&) {}).valid);
  for (std::size_t b = 0; b < made.model.bodies.size(); ++b)
    EXPECT_FALSE(with([b](RobotModel& m) { m.bodies[b].mass *= 1.01; }).valid) << b;
  EXPECT_FALSE(with([](RobotModel& m) {
                 for (Joint& joint : m.joints) joint.torque_limit = 5.0;
               }).valid);
  EXPECT_FALSE(with([](RobotModel& m) { m.joints[6].upper = 0.3; }).valid);
}

TEST(Verify, ForcesAndStoredNumbersCannotBeChanged) {
  std::mt19937 random(7);
  const auto pick = [&](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
  };
  const auto& made = test::made_plan();
  for (int i = 0; i < 60; ++i) {
    Certificate changed = good().certificate;
    CertificateSample& sample = changed.samples[pick(changed.samples.size())];
    switch (i % 4) {
      case 0:
        sample.forces[pick(sample.forces.size())][static_cast<Eigen::Index>(pick(3))] += 0.001;
        break;
      case 1:
        sample.measured.value.values[pick(kQuantityCount)] += 1e-6;
        break;
      case 2:
        sample.measured.gap.values[pick(kQuantityCount)] += 1e-6;
        break;
      default:
        sample.time += 1e-9;
    }
    EXPECT_FALSE(judge(made.plan, changed, made.model, made.scenario).valid) << i;
  }
}

TEST(Verify, HeaderBindsEverything) {
  const auto& made = test::made_plan();
  const PlannedMotion motion(good().plan, "plan", made.model, made.scenario);
  const auto with = [&](const std::function<void(CertificateHeader&)>& change) {
    Certificate certificate = good().certificate;
    change(certificate.header);
    return verify(motion, certificate, made.model, made.scenario, {}).valid;
  };
  EXPECT_TRUE(with([](auto&) {}));
  EXPECT_FALSE(with([](auto& h) { h.plan_sha256[3] ^= 1; }));
  EXPECT_FALSE(with([](auto& h) { h.image_sha256[3] ^= 1; }));
  EXPECT_FALSE(with([](auto& h) { h.robot_hash[0] ^= 1; }));
  EXPECT_FALSE(with([](auto& h) { h.robot += "x"; }));
  EXPECT_FALSE(with([](auto& h) { h.scenario_hash[0] ^= 1; }));
  EXPECT_FALSE(with([](auto& h) { h.limits_sha256[0] ^= 1; }));
  EXPECT_FALSE(with([](auto& h) { h.tool_version += "+"; }));
  EXPECT_FALSE(with([](auto& h) { h.friction = 0.81; }));
  EXPECT_FALSE(with([](auto& h) { h.obstacle_height += 1e-6; }));
  EXPECT_FALSE(with([](auto& h) { h.ballast_mass = 1.0; }));
  EXPECT_FALSE(with([](auto& h) { h.total_mass += 0.01; }));
  EXPECT_FALSE(with([](auto& h) { h.spacing = 0.02; }));
  EXPECT_FALSE(with([](auto& h) { h.acceptance.limit[Quantity::kSlip] = 1.0; }));
  EXPECT_FALSE(with([](auto& h) { h.acceptance.uncertainty.friction_share = 1.0; }));
}

TEST(Verify, SaysWhenWhatAndByHowMuch) {
  const auto& made = test::made_plan();
  Acceptance strict;
  strict.limit[Quantity::kSupportMargin] = 0.2;
  Certificate certificate = good().certificate;
  certificate.header.acceptance = strict;
  const PlannedMotion motion(good().plan, "plan", made.model, made.scenario);
  const VerifyReport report =
      verify(motion, certificate, made.model, made.scenario, strict, {.all = true});
  EXPECT_FALSE(report.valid);
  EXPECT_EQ(report.reason.rfind("at 0.000 s, ", 0), 0u) << report.reason;
  EXPECT_NE(report.reason.find("beyond it by"), std::string::npos);
  EXPECT_EQ(report.samples, certificate.samples.size());
}

TEST(CertificateFile, RoundTripAndEveryFlippedBitRefused) {
  const auto& made = test::made_plan();
  const std::string bytes = format_certificate(good().certificate);
  EXPECT_EQ(format_certificate(parse_certificate(bytes, "file")), bytes);
  std::mt19937_64 random(11);
  const std::size_t header = bytes.find('\n') + 1;
  for (int i = 0; i < 300; ++i) {
    // Half of the flips in the header, which is small against the samples.
    const std::size_t at = random() % (i % 2 == 0 ? header : bytes.size());
    std::string broken = bytes;
    broken[at] = static_cast<char>(broken[at] ^ (1 << random() % 8));
    bool refused = false;
    try {
      refused = !verify(good().plan, broken, made.model, made.scenario, {}).valid;
    } catch (const InputError&) {
      refused = true;
    }
    EXPECT_TRUE(refused) << "byte " << at;
  }
  for (const std::size_t size : {std::size_t{0}, header / 2, header, bytes.size() - 8})
    EXPECT_THROW((void)parse_certificate(std::string_view(bytes).substr(0, size), "file"),
                 InputError);
}

}  // namespace
}  // namespace clamber
