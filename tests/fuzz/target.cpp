#include "tests/fuzz/target.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <stdexcept>

#include "apps/run_log.hpp"
#include "control/crc32c.hpp"
#include "firmware_hal/bus_model/bus_budget.hpp"
#include "firmware_hal/candump.hpp"
#include "firmware_hal/frame_text.hpp"
#include "firmware_hal/motor_types.hpp"
#include "planner_offline/contacts/contact_sequence.hpp"
#include "planner_offline/plan.hpp"
#include "planner_offline/plan_image.hpp"
#include "planner_offline/recording/acclaim.hpp"
#include "planner_offline/recording/limb_frames.hpp"
#include "planner_offline/recording/mvnx.hpp"
#include "planner_offline/recording/npy.hpp"
#include "planner_offline/recording/position_csv.hpp"
#include "planner_offline/settings_file.hpp"
#include "robot_model/loader.hpp"
#include "robot_model/read_file.hpp"
#include "robot_model/tree_builder.hpp"
#include "robot_model/urdf_document.hpp"
#include "sim_backend/scenario.hpp"
#include "tests/firmware_hal/frame_storm.hpp"
#include "tests/planner_offline/recording/made_positions.hpp"
#include "tools/mvnx_writer.hpp"

namespace clamber::fuzz {
namespace {

namespace fs = std::filesystem;

const fs::path kConfigs = fs::path(CLAMBER_SOURCE_DIR) / "configs";

/// A folder of this process's own, gone when it ends well.
class Scratch {
 public:
  Scratch()
      : folder_(fs::temp_directory_path() /
                ("clamber_fuzz_" + std::to_string(std::random_device{}()))) {
    fs::create_directories(folder_);
    fs::copy(kConfigs / "robots/testbot/testbot.urdf", folder_ / "testbot.urdf");
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  [[nodiscard]] fs::path file(const char* name) const { return folder_ / name; }
  [[nodiscard]] fs::path with(const char* name, const std::string& bytes) const {
    std::ofstream(file(name), std::ios::binary) << bytes;
    return file(name);
  }

 private:
  fs::path folder_;
};

const Scratch& scratch() {
  static const Scratch folder;
  return folder;
}

/// A parser's claim about what it accepted does not hold.
void demand(bool holds, const char* claim) {
  if (!holds) {
    throw std::logic_error(claim);
  }
}

template <typename Parser>
bool run_or_refuse(Parser&& parser) {
  try {
    parser();
    return true;
  } catch (const InputError& error) {
    demand(*error.what() != '\0', "a refusal says why");
    return false;
  }
}

/// A recording that has points only goes on to get its segments, as import does.
void use_points(HumanMotion motion) { add_segments(motion); }

// ---- recordings

bool run_mvnx(const std::string& bytes) {
  return run_or_refuse([&] { (void)parse_mvnx(bytes, "fuzz.mvnx"); });
}

std::vector<std::string> mvnx_seeds() {
  const tools::ClimbChoreography climb({});
  const std::vector<tools::Figure> figures{climb.at(0.0), climb.at(6.0)};
  return {tools::write_mvnx(climb.skeleton(), figures, 60, "two frames"),
          tools::write_mvnx(climb.skeleton(), {figures.front()}, 120, "one frame")};
}

bool run_npy(const std::string& bytes) {
  return run_or_refuse([&] { use_points(parse_npy(bytes, "fuzz.npy")); });
}

std::vector<std::string> npy_seeds() { return {make_npy(1, "<f4"), make_npy(2, "<f8")}; }

bool run_csv(const std::string& bytes) {
  return run_or_refuse([&] { use_points(parse_csv(bytes, "fuzz.csv")); });
}

std::vector<std::string> csv_seeds() {
  const tools::ClimbChoreography climb({});
  std::string text = "# SYNTHETIC\nt";
  for (const auto& [label, joint] : point_sources()) {
    text += "," + label + "_x," + label + "_y," + label + "_z";
  }
  for (int frame = 0; frame < 3; ++frame) {
    text += "\n" + std::to_string(0.5 * frame);
    const tools::Figure figure = climb.at(2.0 * frame);
    for (const auto& [label, joint] : point_sources()) {
      for (int k = 0; k < 3; ++k) {
        text += "," + std::to_string(figure.p[static_cast<std::size_t>(joint)][k]);
      }
    }
  }
  return {text + "\n"};
}

/// The bones whose ends make a recording's points, in chains off the root.
const std::vector<std::vector<std::string>>& bone_chains() {
  static const std::vector<std::vector<std::string>> chains{
      {"upperback", "thorax", "lclavicle", "lhumerus", "lradius"},
      {"rclavicle", "rhumerus", "rradius"},
      {"lhipjoint", "lfemur", "ltibia", "lfoot"},
      {"rhipjoint", "rfemur", "rtibia", "rfoot"}};
  return chains;
}

std::string made_skeleton() {
  std::string bones = ":bonedata\n";
  std::string hierarchy = ":hierarchy\nbegin\n";
  for (const auto& chain : bone_chains()) {
    std::string parent = "root";
    for (const std::string& bone : chain) {
      const std::string side = bone.front() == 'l'   ? "1 1 0"
                               : bone.front() == 'r' ? "-1 1 0"
                                                     : "0 1 0";
      bones += "begin\nname " + bone + "\ndirection " + side +
               "\nlength 5\naxis 0 0 10 XYZ\ndof rx ry rz\nend\n";
      hierarchy += parent + " " + bone + "\n";
      parent = bone;
    }
  }
  return ":units\nlength 0.45\nangle deg\n:root\norder TX TY TZ RX RY RZ\naxis XYZ\n"
         "position 0 0 0\norientation 0 0 0\n" +
         bones + hierarchy + "end\n";
}

bool run_asf(const std::string& bytes) {
  return run_or_refuse([&] { (void)parse_asf(bytes, "fuzz.asf"); });
}

std::vector<std::string> asf_seeds() { return {small_asf(), made_skeleton()}; }

bool run_amc(const std::string& bytes) {
  static const AcclaimSkeleton skeleton = parse_asf(made_skeleton(), "seed.asf");
  return run_or_refuse([&] { use_points(parse_amc(bytes, "fuzz.amc", skeleton)); });
}

std::vector<std::string> amc_seeds() {
  std::string text = ":FULLY-SPECIFIED\n:DEGREES\n";
  for (int frame = 1; frame <= 3; ++frame) {
    text += std::to_string(frame) + "\nroot 0 20 0 0 90 0\n";
    for (const auto& chain : bone_chains()) {
      for (const std::string& bone : chain) {
        text += bone + " " + std::to_string(3 * frame) + " 2.5 -1e1\n";
      }
    }
  }
  return {text};
}

// ---- robot and scenario

bool run_robot_yaml(const std::string& bytes) {
  return run_or_refuse([&] { (void)load_robot(scratch().with("robot.yaml", bytes)); });
}

std::vector<std::string> robot_yaml_seeds() {
  return {read_file(kConfigs / "robots/testbot/robot.yaml")};
}

bool run_urdf(const std::string& bytes) {
  return run_or_refuse([&] {
    RobotModel model;
    build_tree(*parse_urdf_document(bytes, "fuzz.urdf"), {"fuzz.urdf", {}, "", {}}, model);
    demand(std::isfinite(model.total_mass), "the mass is finite");
  });
}

std::vector<std::string> urdf_seeds() {
  return {read_file(kConfigs / "robots/testbot/testbot.urdf"),
          "<robot name='r'><link name='a'><inertial><mass value='1'/><inertia ixx='1' ixy='0' "
          "ixz='0' iyy='1' iyz='0' izz='1'/></inertial><collision name='c'><geometry><sphere "
          "radius='0.1'/></geometry></collision></link><joint name='j' type='revolute'><parent "
          "link='a'/><child link='b'/><axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='5' "
          "velocity='4'/></joint><link name='b'><inertial><mass value='1'/><inertia ixx='1' "
          "ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link></robot>"};
}

bool run_scenario(const std::string& bytes) {
  return run_or_refuse([&] {
    const Scenario scenario = parse_scenario(bytes, "fuzz.yaml");
    demand(!scenario.obstacles.empty(), "a scenario has an obstacle");
  });
}

std::vector<std::string> scenario_seeds() {
  return {read_file(kConfigs / "scenarios/box_0.20.yaml"),
          read_file(kConfigs / "scenarios/box_0.35.yaml")};
}

// ---- contact sequence, settings, plan, run log

bool run_contacts(const std::string& bytes) {
  return run_or_refuse([&] { (void)load_contacts(scratch().with("contacts.yaml", bytes)); });
}

std::vector<std::string> contacts_seeds() {
  ContactState state;
  state.end = 1.0;
  state.obstacle = {{"Lwrist", "box", {0.1, 0.3, 0.0}, 0.01}};
  state.floor = {{"Lfoot", "floor", {-0.1, 0.08, -0.275}, 0.0}};
  state.posture.q = Eigen::Vector2d(-1.4, 0.3);
  ContactSequence sequence;
  sequence.recording = "climb.mvnx";
  sequence.robot = "testbot";
  sequence.playback_obstacle_height = 0.2;
  sequence.joint_names = {"j0", "j1"};
  sequence.states = {state, state};
  sequence.reduced = {state};
  sequence.notes = {"one"};
  save_contacts(sequence, scratch().file("seed.yaml"));
  return {read_file(scratch().file("seed.yaml"))};
}

bool run_settings(const std::string& bytes) {
  return run_or_refuse(
      [&] { (void)load_planner_settings(scratch().with("settings.yaml", bytes)); });
}

std::vector<std::string> settings_seeds() { return {read_file(kConfigs / "planner/default.yaml")}; }

constexpr const char* kHash = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";

Plan made_plan() {
  Plan plan;
  plan.robot = "testbot";
  plan.robot_hash = kHash;
  plan.scenario = "box";
  plan.scenario_hash = kHash;
  plan.recording = "climb.mvnx";
  plan.tool_version = "0";
  plan.friction = 0.8;
  plan.obstacle_height = 0.2;
  plan.joint_names = {"j0", "j1"};
  plan.phases = {{"State1", 0.0}, {"swing", 0.2}};
  for (int i = 0; i < 3; ++i) {
    Keyframe k;
    k.time = 0.2 * i;
    k.phase = i == 0 ? 0 : 1;
    k.x.q = Eigen::Vector2d(0.1 * i, -0.2);
    k.tau = Eigen::Vector2d(3.0, -1.0 * i);
    k.contacts = {{"Lfoot", "floor", {0.1, 0.2, 0.0}, {1.0, 2.0, 100.0}}};
    k.obstacle_clearance = std::numeric_limits<double>::infinity();
    plan.keyframes.push_back(k);
  }
  return plan;
}

bool run_plan(const std::string& bytes) {
  return run_or_refuse([&] { (void)plan_to_image(load_plan(scratch().with("plan.json", bytes))); });
}

std::vector<std::string> plan_seeds() {
  save_plan(made_plan(), scratch().file("seed.json"));
  return {read_file(scratch().file("seed.json"))};
}

bool open_image(std::span<const std::byte> bytes) {
  constexpr std::array<double, 2> kLower{-1.0, -1.0};
  constexpr std::array<double, 2> kUpper{1.0, 1.0};
  constexpr std::array<double, 2> kTorque{10.0, 10.0};
  PlanImageView view;
  PlanImageFault fault;
  if (open_plan_image(bytes, {kHash, kLower, kUpper, kTorque}, view, &fault) !=
      PlanImageStatus::kOk) {
    return false;
  }
  demand(view.size() >= 2 && view.time(0) == 0.0, "two keyframes, from 0 s");
  for (std::size_t i = 0; i < view.size(); ++i) {
    demand(i == 0 || view.time(i) > view.time(i - 1), "times increase");
    demand(view.keyframes()[i].failure_policy < kFailurePolicies, "failure policies are known");
    for (std::size_t j = 0; j < view.dimensions(); ++j) {
      demand(std::abs(view.value(i, j)) <= 1.0, "positions are within the limits");
      demand(std::abs(view.keyframes()[i].tau[j]) <= 10.0, "torques are within the limits");
    }
  }
  return true;
}

/// As it is, and once more with the checksum put right, so that the checks behind it are reached.
bool run_plan_image(const std::string& bytes) {
  std::vector<std::uint64_t> words(bytes.size() / sizeof(std::uint64_t) + 1);  // aligned
  std::memcpy(words.data(), bytes.data(), bytes.size());
  const std::span<std::byte> image = std::as_writable_bytes(std::span(words)).first(bytes.size());
  const bool accepted = open_image(image);
  if (image.size() >= sizeof(std::uint32_t)) {
    const std::span<std::byte> body = image.first(image.size() - sizeof(std::uint32_t));
    const std::uint32_t crc = crc32c(body);
    std::memcpy(body.data() + body.size(), &crc, sizeof crc);
    (void)open_image(image);
  }
  return accepted;
}

std::vector<std::string> plan_image_seeds() {
  const std::vector<std::byte> image = plan_to_image(made_plan(), std::string(64, '0'));
  return {std::string(reinterpret_cast<const char*>(image.data()), image.size())};
}

bool run_run_log(const std::string& bytes) {
  return run_or_refuse([&] {
    const RunLog log = load_run_log(scratch().with("run.log", bytes));
    for (const TelemetryFrame& frame : log.frames) {
      demand(frame.joint_count == log.header.joint_names.size(), "frames fit the header");
    }
  });
}

std::vector<std::string> run_log_seeds() {
  RunLogHeader header;
  header.robot = "testbot";
  header.robot_hash = kHash;
  header.joint_names = {"j0", "j1"};
  header.contact_names = {"Lfoot"};
  header.plan_sha256 = kHash;
  header.dt = 0.001;
  RunLogWriter writer(scratch().file("seed.log"), header, 2);
  TelemetryFrame frame{};
  frame.joint_count = 2;
  frame.contact_count = 1;
  (void)writer.push(frame);
  writer.close();
  return {read_file(scratch().file("seed.log"))};
}

// ---- the motor bus

/// Records of 72 bytes: flags, length, id, two unused, data.
constexpr std::size_t kFrameRecord = 72;

CanFrame frame_from(const char* record) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(record[i]); };
  CanFrame frame;
  frame.extended = (byte(0) & 1) != 0;
  frame.remote = (byte(0) & 2) != 0;
  frame.error = (byte(0) & 4) != 0;
  frame.fd = (byte(0) & 8) != 0;
  frame.brs = (byte(0) & 16) != 0;
  frame.esi = (byte(0) & 32) != 0;
  frame.length = std::min<std::uint8_t>(byte(1), 64);
  std::memcpy(&frame.id, record + 2, sizeof frame.id);
  std::memcpy(frame.data.data(), record + 8, frame.data.size());
  return frame;
}

bool run_frames(const std::string& bytes) {
  test::FrameStorm storm;
  for (std::size_t at = 0; at + kFrameRecord <= bytes.size(); at += kFrameRecord) {
    const char* broken = storm.take(frame_from(bytes.data() + at));
    demand(broken == nullptr, broken);
  }
  return !bytes.empty() && bytes.size() % kFrameRecord == 0;
}

std::vector<std::string> frames_seeds() {
  std::mt19937_64 random(1);
  std::string bytes;
  for (int i = 0; i < 64; ++i) {
    const CanFrame frame = test::stormy_frame(random);
    std::string record(kFrameRecord, '\0');
    record[0] = static_cast<char>(frame.extended | frame.remote << 1 | frame.error << 2 |
                                  frame.fd << 3 | frame.brs << 4 | frame.esi << 5);
    record[1] = static_cast<char>(frame.length);
    std::memcpy(record.data() + 2, &frame.id, sizeof frame.id);
    std::memcpy(record.data() + 8, frame.data.data(), frame.data.size());
    bytes += record;
  }
  return {bytes};
}

const RobotModel& coman() {
  static const RobotModel robot = load_robot(kConfigs / "robots/coman/robot.yaml");
  return robot;
}

bool run_candump(const std::string& bytes) {
  static const BusMap mit = load_bus_map(kConfigs / "hal/coman_mit.yaml", coman());
  static const BusMap cia402 = load_bus_map(kConfigs / "hal/coman_cia402.yaml", coman());
  std::size_t good = 0;
  std::size_t bad = 0;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
    CandumpLine line;
    if (parse_candump(std::string_view(bytes).substr(at, end - at), line) == nullptr) {
      ++good;
      const std::string text =
          format_candump(line.time_us, std::string(line.interface), line.frame);
      CandumpLine again;
      demand(parse_candump(text, again) == nullptr && again.frame == line.frame,
             "a line that was read can be written and read again");
      for (const FrameText& said :
           {describe_frame(mit.buses[0], line.frame), describe_frame(cia402.buses[0], line.frame)})
        demand(!said.text.empty() && said.text.find('\n') == std::string::npos,
               "a frame is one line");
    } else {
      ++bad;
    }
    at = end + 1;
  }
  return good > 0 && bad == 0;
}

std::vector<std::string> candump_seeds() {
  return {
      "(1436509052.249713) can0 029##1FFFFFFFFFFFFFFFC\n"
      "(1436509052.249800) can0 429##119BFFFFFF000282D\n"
      "(1436509052.249900) can0 000#0129\n(1436509052.250000) can0 123#R5\n"
      "(1436509052.250100) can0 20000040#0000000000000000\n"
      "(1436509052.250200) can0 1A9#370200000000F401 R\n"
      "(1436509052.250300) can0 5A9#8017100000000206"};
}

bool run_bus_map(const std::string& bytes) {
  return run_or_refuse([&] {
    const BusMap map = parse_bus_map(bytes, kConfigs / "hal/fuzz.yaml", coman());
    std::size_t drives = 0;
    for (const Bus& bus : map.buses) drives += bus.drives.size();
    demand(drives == coman().joints.size(), "every joint is on one bus");
    for (const BusBudget& budget : bus_budgets(map))
      demand(
          budget.load > 0.0 && std::isfinite(budget.load) && !explain_refusal(map, budget).empty(),
          "a map has a load");
  });
}

std::vector<std::string> bus_map_seeds() {
  return {read_file(kConfigs / "hal/coman_mit.yaml"),
          read_file(kConfigs / "hal/coman_cia402.yaml")};
}

bool run_motors(const std::string& bytes) {
  return run_or_refuse([&] { (void)load_motor_types(scratch().with("motors.yaml", bytes)); });
}

std::vector<std::string> motors_seeds() { return {read_file(kConfigs / "hal/motors.yaml")}; }

}  // namespace

const std::vector<Target>& targets() {
  static const std::vector<Target> all{{"mvnx", run_mvnx, mvnx_seeds},
                                       {"npy", run_npy, npy_seeds},
                                       {"csv", run_csv, csv_seeds},
                                       {"asf", run_asf, asf_seeds},
                                       {"amc", run_amc, amc_seeds},
                                       {"robot_yaml", run_robot_yaml, robot_yaml_seeds},
                                       {"urdf", run_urdf, urdf_seeds},
                                       {"scenario", run_scenario, scenario_seeds},
                                       {"contacts", run_contacts, contacts_seeds},
                                       {"settings", run_settings, settings_seeds},
                                       {"plan", run_plan, plan_seeds},
                                       {"plan_image", run_plan_image, plan_image_seeds},
                                       {"run_log", run_run_log, run_log_seeds},
                                       {"frames", run_frames, frames_seeds},
                                       {"candump", run_candump, candump_seeds},
                                       {"bus_map", run_bus_map, bus_map_seeds},
                                       {"motors", run_motors, motors_seeds}};
  return all;
}

const Target* find_target(const std::string& name) {
  const auto found = std::find_if(targets().begin(), targets().end(),
                                  [&](const Target& target) { return target.name == name; });
  return found == targets().end() ? nullptr : &*found;
}

}  // namespace clamber::fuzz
