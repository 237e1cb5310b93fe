#include "certificate/planned_motion.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "robot_model/loader.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

using Json = nlohmann::json;

/// Reading with complaints that name file and key.
class PlanText {
 public:
  PlanText(std::string_view text, std::string file) : file_(std::move(file)) {
    try {
      root_ = Json::parse(text);
    } catch (const Json::exception& error) {
      fail(std::string("not a JSON file: ") + error.what());
    }
    if (!root_.is_object()) fail("expected a plan");
  }

  [[noreturn]] void fail(const std::string& what) const { throw InputError(file_ + ": " + what); }
  [[nodiscard]] const Json& root() const { return root_; }

  [[nodiscard]] const Json& at(const Json& node, const char* key, const std::string& where) const {
    const auto found = node.is_object() ? node.find(key) : node.end();
    if (!node.is_object() || found == node.end()) fail(where + key + " is missing");
    return *found;
  }
  [[nodiscard]] double number(const Json& node, const std::string& where) const {
    if (!node.is_number() || !std::isfinite(node.get<double>()))
      fail(where + ": expected a number");
    return node.get<double>();
  }
  [[nodiscard]] std::string text(const char* key) const {
    const Json& node = at(root_, key, "");
    if (!node.is_string()) fail(std::string(key) + ": expected a text");
    return node.get<std::string>();
  }
  template <class Vector>
  void vector(const Json& node, const std::string& where, Eigen::Index size, Vector& out) const {
    if (!node.is_array() || static_cast<Eigen::Index>(node.size()) != size)
      fail(where + ": expected " + std::to_string(size) + " numbers");
    out.resize(size);
    for (Eigen::Index i = 0; i < size; ++i)
      out[i] = number(node[static_cast<std::size_t>(i)], where);
  }
  [[nodiscard]] const Json& list(const Json& node, const std::string& where) const {
    if (!node.is_array()) fail(where + ": expected a list");
    return node;
  }

 private:
  Json root_;
  std::string file_;
};

int surface_index(const Json& name, const Scenario& scenario) {
  if (name == "floor") return kFloorSurface;
  for (std::size_t i = 0; i < scenario.obstacles.size(); ++i)
    if (name == scenario.obstacles[i].name) return static_cast<int>(i);
  return kNoSurface;
}

MotionKnot read_knot(const PlanText& plan, const Json& node, const std::string& where,
                     const RobotModel& model, const Scenario& scenario, std::size_t phases) {
  MotionKnot knot;
  const auto in = [&where](const char* key) { return where + key; };
  knot.time = plan.number(plan.at(node, "time", where), in("time"));
  const Json& phase = plan.at(node, "phase", where);
  if (!phase.is_number_unsigned() || phase.get<std::uint64_t>() >= phases)
    plan.fail(in("phase: expected the index of a phase"));
  knot.phase = phase.get<int>();
  plan.vector(plan.at(node, "base_position", where), in("base_position"), 3, knot.position);
  plan.vector(plan.at(node, "base_orientation", where), in("base_orientation"), 4,
              knot.orientation);
  if (std::abs(knot.orientation.norm() - 1.0) > 1e-6)
    plan.fail(in("base_orientation: expected a unit quaternion"));
  knot.orientation.normalize();
  plan.vector(plan.at(node, "q", where), in("q"), model.joint_count(), knot.q);
  plan.vector(plan.at(node, "tau", where), in("tau"), model.joint_count(), knot.tau);
  knot.surface.fill(kNoSurface);
  knot.force.fill(Eigen::Vector3d::Zero());
  for (const Json& contact : plan.list(plan.at(node, "contacts", where), in("contacts"))) {
    const Json& name = plan.at(contact, "link", where);
    const auto link = name.is_string() ? model.find_contact(name.get<std::string>()) : std::nullopt;
    const int surface = surface_index(plan.at(contact, "surface", where), scenario);
    if (!link || surface == kNoSurface)
      plan.fail(in("contacts: expected a contact link of the robot and a surface of the scenario"));
    const auto at = static_cast<std::size_t>(*link);
    if (knot.surface[at] != kNoSurface) plan.fail(in("contacts: a link is listed twice"));
    knot.surface[at] = surface;
    plan.vector(plan.at(contact, "force", where), in("contacts"), 3, knot.force[at]);
  }
  return knot;
}

/// Chord's deviation of a function whose second derivative is at most `second`.
double bow(double second, double h) { return second * h * h / 8.0; }

}  // namespace

std::vector<TouchCandidate> touch_candidates(const RobotModel& model) {
  std::vector<TouchCandidate> points;
  for (std::size_t c = 0; c < model.contacts.size(); ++c) {
    const ContactLink& link = model.contacts[c];
    for (const Eigen::Vector3d& p : link.points)
      points.push_back({static_cast<int>(c), link.body, p, link.radius, link.is_patch});
  }
  if (points.size() > 64 || model.contacts.size() > kMaxContactLinks)
    throw InputError("robot " + model.name + ": a certificate holds at most 16 contact links and " +
                     "64 contact points, found " + std::to_string(model.contacts.size()) + " and " +
                     std::to_string(points.size()));
  return points;
}

PlannedMotion::PlannedMotion(std::string_view text, const std::string& file,
                             const RobotModel& model, const Scenario& scenario) {
  const PlanText plan(text, file);
  (void)touch_candidates(model);  // sizes
  sha256 = sha256_hex(text);
  if (plan.text("format") != "clamber plan") plan.fail("format: expected \"clamber plan\"");
  if (plan.at(plan.root(), "version", "") != 3) plan.fail("version: expected 3");
  robot_hash = plan.text("robot_hash");
  scenario_hash = plan.text("scenario_hash");
  tool_version = plan.text("tool_version");
  friction = plan.number(plan.at(plan.root(), "friction", ""), "friction");
  ballast_mass = plan.number(plan.at(plan.root(), "ballast_mass", ""), "ballast_mass");
  const Json& names = plan.list(plan.at(plan.root(), "joint_names", ""), "joint_names");
  bool same = names.size() == model.joints.size();
  for (std::size_t j = 0; same && j < names.size(); ++j) same = names[j] == model.joints[j].name;
  if (!same) plan.fail("joint_names: expected those of robot " + model.name + ", in its order");
  for (const Json& phase : plan.list(plan.at(plan.root(), "phases", ""), "phases")) {
    const Json& name = plan.at(phase, "name", "phases: ");
    if (!name.is_string()) plan.fail("phases: name: expected a text");
    phases.push_back(name.get<std::string>());
    const Json& policy = plan.at(phase, "failure_policy", "phases: ");
    const auto known = policy.is_string() ? failure_policy_named(policy.get<std::string>())
                                          : std::optional<FailurePolicy>();
    if (!known) plan.fail("phases: failure_policy: expected hold, lower or limp");
    failure_policies.push_back(*known);
  }
  for (const Json& node : plan.list(plan.at(plan.root(), "keyframes", ""), "keyframes")) {
    const std::string where = "keyframes[" + std::to_string(knots.size()) + "].";
    knots.push_back(read_knot(plan, node, where, model, scenario, phases.size()));
    const std::size_t n = knots.size();
    if (n > 1 && !(knots[n - 1].time > knots[n - 2].time))
      plan.fail(where + "time: expected a later one than the keyframe's before");
    // q and -q are one orientation; the spline needs them on one side.
    if (n > 1 && knots[n - 1].orientation.dot(knots[n - 2].orientation) < 0.0)
      knots[n - 1].orientation = -knots[n - 1].orientation;
  }
  if (knots.size() < 2 || knots.front().time != 0.0)
    plan.fail("keyframes: expected at least 2, the first at time 0");
  const Knots view{&knots};
  workspace_.resize(spline_.workspace_size(view.size(), view.dimensions()));
  if (spline_.build(view, workspace_) != SplineStatus::kOk) plan.fail("keyframes: not a spline");
  find_segments(model.contacts.size());
}

void PlannedMotion::find_segments(std::size_t links) {
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    MotionSegment segment{
        knots[k].time, knots[k + 1].time, knots[k + 1].phase, knots[k + 1].surface, {}};
    segment.approach.fill(kNoSurface);
    segments.push_back(segment);
  }
  // A link is on its way through the whole phase before it touches and after it came off.
  for (std::size_t first = 0; first < segments.size();) {
    std::size_t end = first;
    while (end < segments.size() && segments[end].phase == segments[first].phase) ++end;
    for (std::size_t link = 0; link < links; ++link) {
      const int before = first > 0 ? segments[first - 1].surface[link] : kNoSurface;
      const int after = end < segments.size() ? segments[end].surface[link] : kNoSurface;
      for (std::size_t s = first; s < end; ++s)
        if (segments[s].surface[link] == kNoSurface)
          segments[s].approach[link] = after != kNoSurface ? after : before;
    }
    first = end;
  }
}

void PlannedMotion::evaluate(double t, std::size_t segment, MotionState& state) const noexcept {
  const auto n = static_cast<Eigen::Index>(knots.front().q.size());
  state.x.q.resize(n);
  state.v.resize(6 + n);
  state.a.resize(6 + n);
  Eigen::Vector4d quat, rate, second;
  for (Eigen::Index d = 0; d < 7 + n; ++d) {
    const auto s = spline_.evaluate(t, segment, static_cast<std::size_t>(d));
    if (d < 3) {
      state.x.X_WB.p[d] = s.value;
      state.v[d] = s.rate;
      state.a[d] = s.acceleration;
    } else if (d < 7) {
      quat[d - 3] = s.value;
      rate[d - 3] = s.rate;
      second[d - 3] = s.acceleration;
    } else {
      state.x.q[d - 7] = s.value;
      state.v[d - 1] = s.rate;
      state.a[d - 1] = s.acceleration;
    }
  }
  const double squared = quat.squaredNorm();
  const Eigen::Quaterniond p(quat[0], quat[1], quat[2], quat[3]);
  const Eigen::Quaterniond dp(rate[0], rate[1], rate[2], rate[3]);
  const Eigen::Quaterniond ddp(second[0], second[1], second[2], second[3]);
  state.x.X_WB.R = p.normalized().toRotationMatrix();
  // omega = 2 vec(p' p*) / |p|^2 holds for quaternions of any length.
  const Eigen::Vector3d omega = 2.0 * (dp * p.conjugate()).vec() / squared;
  state.v.segment<3>(3) = omega;
  state.a.segment<3>(3) =
      2.0 * (ddp * p.conjugate()).vec() / squared - 2.0 * quat.dot(rate) / squared * omega;
}

void PlannedMotion::feed_forward(double t, std::size_t segment, JointVector& tau) const noexcept {
  const MotionKnot& a = knots[segment];
  const MotionKnot& b = knots[segment + 1];
  tau.resize(a.tau.size());
  for (Eigen::Index j = 0; j < tau.size(); ++j)
    tau[j] = interpolate_linear(t, a.time, a.tau[j], b.time, b.tau[j]);
}

MotionBounds PlannedMotion::bounds(double t0, double t1, std::size_t segment) const noexcept {
  // In a segment every dimension is a cubic: its second derivative is linear, so largest at an
  // end; its rate is a parabola, which leaves its chord by at most |third derivative| h^2 / 8.
  // Norms of vectors are convex, so the same holds for a vector's chord.
  const double h = t1 - t0;
  const auto n = static_cast<std::size_t>(knots.front().q.size());
  MotionBounds b;
  double rate0 = 0, rate1 = 0, rate_third = 0, second0 = 0, second1 = 0, value0 = 0, value1 = 0;
  const auto close_vector = [&](double& rate, double& second) {
    rate = std::sqrt(std::max(rate0, rate1)) + bow(std::sqrt(rate_third), h);
    second = std::sqrt(std::max(second0, second1));
    rate0 = rate1 = rate_third = second0 = second1 = value0 = value1 = 0.0;
  };
  double quat_rate = 0.0, quat_second = 0.0, quat_norm = 1.0;
  for (std::size_t d = 0; d < 7 + n; ++d) {
    auto s0 = spline_.evaluate(t0, segment, d);
    auto s1 = spline_.evaluate(t1, segment, d);
    // From inside, where the second derivative is the segment's own: at the motion's first and last
    // moment the spline reports the rest that follows.
    const double early = spline_.evaluate(t0 + 0.25 * h, segment, d).acceleration;
    const double late = spline_.evaluate(t0 + 0.75 * h, segment, d).acceleration;
    const double third = h > 0.0 ? (late - early) / (0.5 * h) : 0.0;
    s0.acceleration = 1.5 * early - 0.5 * late;
    s1.acceleration = 1.5 * late - 0.5 * early;
    if (d >= 7) {
      b.rate[d - 7] = std::max(std::abs(s0.rate), std::abs(s1.rate)) + bow(std::abs(third), h);
      b.acceleration_q[d - 7] = std::max(std::abs(s0.acceleration), std::abs(s1.acceleration));
      continue;
    }
    value0 += s0.value * s0.value;
    value1 += s1.value * s1.value;
    rate0 += s0.rate * s0.rate;
    rate1 += s1.rate * s1.rate;
    rate_third += third * third;
    second0 += s0.acceleration * s0.acceleration;
    second1 += s1.acceleration * s1.acceleration;
    if (d == 2) close_vector(b.speed, b.acceleration);
    if (d == 6) {
      quat_norm = std::sqrt(std::min(value0, value1));
      close_vector(quat_rate, quat_second);
      quat_norm -= quat_rate * h / 2.0;  // a Lipschitz bound of the norm itself
    }
  }
  quat_norm = std::max(quat_norm, 1e-3);
  b.turn_rate = 2.0 * quat_rate / quat_norm;
  b.turn_acceleration = 2.0 * quat_second / quat_norm + 2.0 * quat_rate / quat_norm * b.turn_rate;
  return b;
}

std::vector<SampleTime> sample_times(const PlannedMotion& motion, double spacing) {
  std::vector<SampleTime> samples;
  for (std::size_t s = 0; s < motion.segments.size(); ++s) {
    const double start = motion.segments[s].start, length = motion.segments[s].end - start;
    const int parts = std::max(1, static_cast<int>(std::ceil(length / spacing - 1e-9)));
    const double h = length / parts;
    for (int i = 0; i <= parts; ++i)
      samples.push_back({i == parts ? motion.segments[s].end : start + i * h, s, i == 0 ? 0.0 : h,
                         i == parts ? 0.0 : h});
  }
  return samples;
}

}  // namespace clamber
