// bench/mutations: changes a certified plan, its certificate and its image in thousands of ways and
// counts what is refused. Two kinds: single bits of the files as they are, which the digests see;
// and changes of posture, contacts, forces and world with every digest made right again, which only
// the recomputed physics can see.
//   mutations PLAN [--count N] [--seed S]      PLAN.cert and PLAN.img lie beside the plan
// Exit code 1 if anything was accepted.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "certificate/verify.hpp"
#include "control/plan_image.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/sha256.hpp"

namespace clamber {
namespace {

using Json = nlohmann::ordered_json;

struct Count {
  std::size_t tried = 0, refused = 0;
  std::size_t unphysical = 0;  ///< refused even if no stored number is looked at
};

class Mutations {
 public:
  Mutations(const std::filesystem::path& plan_file, unsigned seed)
      : model_(load_robot(std::filesystem::path(CLAMBER_SOURCE_DIR) /
                          "configs/robots/coman/robot.yaml")),
        scenario_(load_scenario(std::filesystem::path(CLAMBER_SOURCE_DIR) /
                                "configs/scenarios/box_0.275.yaml")),
        text_(read_file(plan_file)),
        bytes_(read_file(std::filesystem::path(plan_file).replace_extension(".cert"))),
        image_(read_file(std::filesystem::path(plan_file).replace_extension(".img"))),
        certificate_(parse_certificate(bytes_, "certificate")),
        json_(Json::parse(text_)),
        random_(seed) {}

  bool good() {
    const PlannedMotion motion(text_, "plan", model_, scenario_);
    return verify(text_, bytes_, model_, scenario_, acceptance_).valid &&
           check_image(as_bytes(image_), motion, certificate_, sha256_hex(bytes_)).empty();
  }

  void bits(std::size_t count) {
    const PlannedMotion motion(text_, "plan", model_, scenario_);
    const std::string digest = sha256_hex(bytes_);
    const std::size_t header = bytes_.find('\n') + 1;
    for (std::size_t i = 0; i < count; ++i) {
      note("bit of the plan", [&] {
        return verify(flipped(text_, text_.size()), bytes_, model_, scenario_, acceptance_);
      });
      note("bit of the certificate", [&] {
        return verify(text_, flipped(bytes_, i % 2 == 0 ? header : bytes_.size()), model_,
                      scenario_, acceptance_);
      });
      note("bit of the image", [&] {
        VerifyReport report;
        report.reason =
            check_image(as_bytes(flipped(image_, image_.size())), motion, certificate_, digest);
        report.valid = report.reason.empty();
        return report;
      });
    }
  }

  void joints(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      Json plan = json_;
      const double sign = pick(2) == 0 ? 0.01 : -0.01;
      Json& q = some_keyframe(plan).at("q").at(pick(model_.joints.size()));
      q = q.get<double>() + sign;
      note("joint moved by 0.01 rad", [&] { return judge(plan); });
    }
  }

  void contacts(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      Json plan = json_;
      auto& contacts =
          plan.at("keyframes").at(1 + pick(json_.at("keyframes").size() - 1)).at("contacts");
      contacts.erase(pick(contacts.size()));
      note("contact dropped", [&] { return judge(plan); });
    }
  }

  void base(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      Json plan = json_;
      Json& x = some_keyframe(plan).at("base_position").at(pick(3));
      x = x.get<double>() + (pick(2) == 0 ? 0.001 : -0.001);
      note("base moved by 1 mm", [&] { return judge(plan); });
    }
  }

  void torques(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      Json plan = json_;
      Json& tau = some_keyframe(plan).at("tau").at(pick(model_.joints.size()));
      tau = tau.get<double>() + (pick(2) == 0 ? 1.5 : -1.5);
      note("torque changed by 1.5 N m", [&] { return judge(plan); });
    }
  }

  void forces(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      Certificate changed = certificate_;
      auto& forces = changed.samples[pick(changed.samples.size())].forces;
      forces[pick(forces.size())][static_cast<Eigen::Index>(pick(3))] +=
          pick(2) == 0 ? 0.01 : -0.01;
      note("witness force changed by 0.01 N",
           [&] { return judge(json_, changed, model_, scenario_); });
    }
  }

  void world(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      note("friction below the certified one", [&] {
        Scenario scenario = scenario_;
        // At what share of the friction the certificate's forces slide is the plan's reserve.
        scenario.friction = uniform(0.0, 0.5) * scenario_.friction;
        Json plan = json_;
        plan["friction"] = scenario.friction;
        return judge(plan, certificate_, model_, scenario);
      });
      note("mass of one link, 1 % and more", [&] {
        RobotModel model = model_;
        model.bodies[pick(model.bodies.size())].mass *=
            pick(2) == 0 ? uniform(1.01, 1.2) : uniform(0.8, 0.99);
        return judge(json_, certificate_, model, scenario_);
      });
      note("obstacle higher or lower by 2 mm and more", [&] {
        Scenario scenario = scenario_;
        const double by = (pick(2) == 0 ? 1.0 : -1.0) * uniform(0.002, 0.05);
        scenario.obstacles[0].half_extents.z() += 0.5 * by;
        scenario.obstacles[0].center.z() += 0.5 * by;
        return judge(json_, certificate_, model_, scenario);
      });
    }
  }

  /// Prints the table; true if everything was refused.
  bool report() const {
    Count all;
    std::printf("%-44s %8s %8s %10s\n", "mutation", "tried", "refused", "by physics");
    for (const auto& [name, count] : counts_) {
      std::printf("%-44s %8zu %8zu %10zu\n", name.c_str(), count.tried, count.refused,
                  count.unphysical);
      all.tried += count.tried;
      all.refused += count.refused;
    }
    std::printf("%-44s %8zu %8zu\n", "all", all.tried, all.refused);
    return all.tried == all.refused;
  }

 private:
  std::size_t pick(std::size_t n) { return random_() % n; }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  Json& some_keyframe(Json& plan) {
    return plan.at("keyframes").at(pick(json_.at("keyframes").size()));
  }
  static std::span<const std::byte> as_bytes(const std::string& bytes) {
    return std::as_bytes(std::span(bytes.data(), bytes.size()));
  }
  std::string flipped(std::string bytes, std::size_t among) {
    const std::size_t bit = pick(8 * among);
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << bit % 8));
    return bytes;
  }

  VerifyReport judge(const Json& plan) { return judge(plan, certificate_, model_, scenario_); }

  /// With every digest and figure of the header made to fit.
  VerifyReport judge(const Json& plan, const Certificate& certificate, const RobotModel& model,
                     const Scenario& scenario) {
    const PlannedMotion motion(plan.dump(), "plan", model, scenario);
    Certificate bound = certificate;
    CertificateHeader& h = bound.header;
    h.plan_sha256 = motion.sha256;
    h.image_sha256 = image_digest(motion, model);
    h.limits_sha256 = limits_digest(model);
    h.friction = scenario.friction;
    h.obstacle_height = scenario.obstacles.front().top();
    h.total_mass = 0.0;
    for (const Body& body : model.bodies) h.total_mass += body.mass;
    VerifyReport report = verify(motion, bound, model, scenario, acceptance_);
    report.unphysical =
        verify(motion, bound, model, scenario, acceptance_, {.stored = false}).valid ? 0 : 1;
    return report;
  }

  void note(const char* name, const std::function<VerifyReport()>& work) {
    Count& count = counts_[name];
    ++count.tried;
    try {
      const VerifyReport report = work();
      if (report.valid) std::printf("ACCEPTED: %s, number %zu\n", name, count.tried);
      count.refused += report.valid ? 0 : 1;
      count.unphysical += report.unphysical > 0 ? 1 : 0;
    } catch (const InputError&) {
      ++count.refused;
    }
  }

  RobotModel model_;
  Scenario scenario_;
  std::string text_, bytes_, image_;
  Certificate certificate_;
  Json json_;
  Acceptance acceptance_;
  std::mt19937_64 random_;
  std::map<std::string, Count> counts_;
};

int run(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: mutations PLAN [--count N] [--seed S]\n");
    return 2;
  }
  std::size_t count = 10000;
  unsigned seed = 1;
  for (int i = 2; i + 1 < argc; i += 2) {
    if (std::string(argv[i]) == "--count") count = std::strtoul(argv[i + 1], nullptr, 10);
    if (std::string(argv[i]) == "--seed")
      seed = static_cast<unsigned>(std::strtoul(argv[i + 1], nullptr, 10));
  }
  Mutations mutations(argv[1], seed);
  if (!mutations.good()) {
    std::fprintf(stderr, "mutations: the plan's own certificate is not valid\n");
    return 2;
  }
  mutations.bits(count * 21 / 100);  // three files each: 63 %
  mutations.joints(count / 5);
  mutations.contacts(count / 20);
  mutations.base(count / 50);
  mutations.torques(count / 50);
  mutations.forces(count / 50);
  mutations.world(count / 50);
  return mutations.report() ? 0 : 1;
}

}  // namespace
}  // namespace clamber

int main(int argc, char** argv) {
  try {
    return clamber::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "mutations: %s\n", error.what());
    return 2;
  }
}
