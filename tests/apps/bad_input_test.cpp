// What `clamber` says to input that it cannot use: exit code and one line, case by case.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <ostream>

#include "tests/apps/command_line.hpp"

namespace clamber {
namespace {

using test::fs::path;
using testing::HasSubstr;

constexpr const char* kRecording = "configs/recordings/climb_table_synthetic.mvnx";
constexpr const char* kUrdf = "configs/robots/coman/coman.urdf";
constexpr const char* kRobot = "configs/robots/coman/robot.yaml";
constexpr const char* kScenario = "configs/scenarios/box_0.275.yaml";

/// The shipped file `file` with the first `from` behind `after` replaced by `to`; an empty `from`
/// inserts. Where nothing is replaced the file is only copied.
struct Edit {
  const char* file = nullptr;
  std::string after;
  std::string from;
  std::string to;
};

struct Case {
  std::string name;
  std::vector<Edit> edits;
  std::string arguments;  ///< {dir}: the folder with the edited files
  int exit_code = 2;
  std::string message;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class BadInput : public testing::TestWithParam<Case> {
 protected:
  /// A contact sequence and a plan that are all right, for what comes after them.
  static void SetUpTestSuite() {
    made_ = new test::TemporaryFolder("bad_input_made");
    const std::string recording = std::string("'") + CLAMBER_SOURCE_DIR + "/" + kRecording + "'";
    ASSERT_EQ(test::clamber("contacts " + recording + " -o contacts.yaml", made_->path()).exit_code,
              0);
    ASSERT_EQ(test::clamber("plan contacts.yaml -o plan.json", made_->path()).exit_code, 0);
    ASSERT_EQ(test::clamber("import " + recording + " -o motion.csv", made_->path()).exit_code, 0);
  }
  static void TearDownTestSuite() {
    delete made_;
    made_ = nullptr;
  }

  static test::TemporaryFolder* made_;
};
test::TemporaryFolder* BadInput::made_ = nullptr;

void apply(const Edit& edit, const path& folder) {
  const path target = folder / edit.file;
  std::string text = test::text_of(target);
  if (edit.from == "<end>") {  // cuts the file off after `after`
    text.resize(text.find(edit.after) + edit.after.size());
  } else {
    const std::size_t from = text.find(edit.after);
    ASSERT_NE(from, std::string::npos) << edit.after;
    const std::size_t at = text.find(edit.from, from + edit.after.size());
    ASSERT_NE(at, std::string::npos) << edit.from;
    text.replace(at, edit.from.size(), edit.to);
  }
  std::ofstream(target, std::ios::binary) << text;
}

TEST_P(BadInput, GivesItsLine) {
  const Case& c = GetParam();
  const test::TemporaryFolder folder("bad_input_" + c.name);
  std::filesystem::create_directories(folder.path() / "configs");
  for (const char* part : {"robots", "scenarios", "recordings", "control", "planner", "hal"})
    std::filesystem::copy(path(CLAMBER_SOURCE_DIR) / "configs" / part,
                          folder.path() / "configs" / part,
                          std::filesystem::copy_options::recursive);
  for (const char* file : {"contacts.yaml", "plan.json", "motion.csv"})
    std::filesystem::copy(made_->path() / file, folder.path() / file);
  ASSERT_EQ(mkfifo((folder.path() / "fifo").c_str(), 0600), 0);
  std::ofstream(folder.path() / "walk.amc") << ":FULLY-SPECIFIED\n:DEGREES\n1\n";
  for (const Edit& edit : c.edits) apply(edit, folder.path());

  const test::CommandResult result =
      test::clamber(c.arguments, folder.path(), "CLAMBER_DDS_DOMAIN=191");
  EXPECT_EQ(result.exit_code, c.exit_code) << result.error;
  // Progress lines begin with [, the error is the only other one.
  std::istringstream lines(result.error);
  std::vector<std::string> errors;
  for (std::string line; std::getline(lines, line);)
    if (!line.starts_with('[')) errors.push_back(line);
  ASSERT_EQ(errors.size(), 1u) << result.error;
  EXPECT_THAT(errors[0], testing::StartsWith("clamber: error: "));
  EXPECT_THAT(errors[0], HasSubstr(c.message));
  RecordProperty("message", errors[0]);
  std::printf("  %s\n", errors[0].c_str());
}

const std::string kImport = std::string("import ") + kRecording + " -o out.csv";
const std::string kPlan = "plan contacts.yaml -o out.json";
const std::string kRun = "run plan.json --no-dds -o out.log";

const Case kCases[] = {
    // The command line
    {"NoCommand", {}, "", 2, "A subcommand is required"},
    {"UnknownCommand", {}, "clmb", 2, "unknown command 'clmb'"},
    {"UnknownOption", {}, "climb --hight 0.3", 2, "--hight"},
    {"HeightIsNoNumber", {}, "climb --height high", 2, "high"},
    {"FeedForwardIsNoChoice", {}, kRun + " --feed-forward some", 2, "some"},
    {"NoRecordingGiven", {}, "import", 2, "recording is required"},
    {"FolderCannotBeMade", {}, "climb --out /dev/null/climb", 2, "/dev/null/climb: cannot be made"},

    // Recordings and motions
    {"MissingRecording", {}, "import nothing.mvnx", 2, "nothing.mvnx"},
    {"RecordingIsAFolder", {}, "import configs -o out.csv", 2, "configs"},
    {"RecordingIsAFifo", {}, "import fifo -o out.csv", 2, "fifo: is a FIFO, expected a file"},
    {"RecordingIsADevice", {}, "climb /dev/zero --out out", 2, "/dev/zero: is a device"},
    {"SkeletonIsAFifo", {}, "import walk.amc --skeleton fifo -o out.csv", 2, "fifo: is a FIFO"},
    {"TruncatedMvnx", {{kRecording, "<frame time=\"300\"", "<end>", ""}}, kImport, 2, ".mvnx:"},
    {"MvnxVersion2", {{kRecording, "", "version=\"4\"", "version=\"2\""}}, kImport, 2, "version"},
    {"MvnxNaN",
     {{kRecording, "type=\"normal\"", "<orientation>", "<orientation>nan "}},
     kImport,
     2,
     "is not a finite number"},
    {"MvnxLacksASegment",
     {{kRecording, "<segment ", "label=\"Pelvis\"", "label=\"Pelviss\""}},
     kImport,
     2,
     "Pelvis"},
    {"MotionWithAnUnknownJoint",
     {{"motion.csv", "", "LElbj", "LElbow"}},
     "contacts motion.csv",
     2,
     "column 'LElbj' is missing"},
    {"MotionWithNaN",
     {{"motion.csv", "LElbj\n", "-0.0", "nan-0.0"}},
     "playback motion.csv",
     2,
     "motion.csv:8: expected a finite number, found 'nan"},
    {"TruncatedMotion",
     {{"motion.csv", "LElbj\n-0.022", "<end>", ""}},
     "contacts motion.csv",
     2,
     "columns, found 1"},

    // Robots
    {"MissingRobot", {}, "import motion.csv --robot configs/robots/nao", 2, "nao"},
    {"RobotIsAFifo", {}, "import motion.csv --robot fifo", 2, "fifo: is a FIFO"},
    {"UrdfWithAMesh",
     {{kUrdf, "<collision name=\"pelvis\">",
       "<cylinder radius=\"0.0716302\" length=\"0.11006541912\"/>",
       "<mesh filename=\"pelvis.stl\"/>"}},
     kImport + " --robot configs/robots/coman",
     2,
     "mesh"},
    {"UrdfZeroMass",
     {{kUrdf, "<link name=\"LForearm\">", "<mass value=\"", "<mass value=\"0\"/><mass value=\""}},
     kImport,
     2,
     "mass"},
    {"UrdfCycle",
     {{kUrdf, "<joint name=\"WaistSag\"", "<parent link=\"DWL\"/>", "<parent link=\"DWYTorso\"/>"}},
     kImport,
     2,
     "coman.urdf"},
    {"UrdfIsNoXml", {{kUrdf, "</joint>", "<end>", ""}}, kImport, 2, "coman.urdf"},
    {"UnknownJointInOrder",
     {{kRobot, "", "[WaistLat", "[WaistLateral"}},
     kImport,
     2,
     "WaistLateral"},
    {"UnknownRobotKey", {{kRobot, "", "drives:", "dirves:"}}, kImport, 2, "dirves"},
    {"TorqueLimitBeyondTheDrive",
     {{kRobot, "", "torque_limit: 30", "torque_limit: 60"}},
     kImport,
     2,
     "torque_limit"},
    {"RetargetNamesAnUnknownJoint",
     {{"configs/robots/coman/retarget.yaml", "", "LElbj", "LElbow"}},
     kImport,
     2,
     "LElbow"},

    // Scenarios
    {"MissingScenario", {}, kPlan + " --scenario hill.yaml", 2, "hill.yaml"},
    {"ScenarioIsADevice", {}, kPlan + " --scenario /dev/zero", 2, "/dev/zero: is a device"},
    {"ScenarioWithoutObstacle",
     {{kScenario, "", "obstacles:", "obstacles: []\nothers:"}},
     kPlan,
     2,
     "box_0.275.yaml"},
    {"ScenarioWithEmptyObstacles",
     {{kScenario, "obstacles:",
       "\n  - name: box\n    position: [0.45, 0.0]       # m, centre of its footprint\n"
       "    size: [0.9, 1.0, 0.275]      # m, depth (x), width (y), height\n"
       "    yaw: 0.0                    # rad",
       " []"}},
     kPlan,
     2,
     "expected at least one obstacle"},
    {"FrictionZero", {{kScenario, "", "friction: 0.8", "friction: 0"}}, kPlan, 2, "friction"},
    {"UnknownScenarioKey", {{kScenario, "", "yaw: 0.0", "jaw: 0.0"}}, kPlan, 2, "jaw"},
    {"GoalNamesAnUnknownLink",
     {{kScenario, "contacts: [", "Lwrist", "Lhand"}},
     "playback motion.csv",
     2,
     "goal.contacts: robot coman has no contact link 'Lhand'"},
    {"HeightZero", {}, kPlan + " --height 0", 2, "obstacle height"},
    {"HeightNaN", {}, kPlan + " --height nan", 2, "obstacle height"},

    // Planning
    {"MissingContacts", {}, "plan nothing.yaml", 2, "nothing.yaml"},
    {"ContactsAreAFifo", {}, "plan fifo -o out.json", 2, "fifo: is a FIFO"},
    {"PlannerSettingsAreADevice", {}, kPlan + " --planner /dev/zero", 2, "/dev/zero: is a device"},
    {"ContactsOfAnUnknownLink",
     {{"contacts.yaml", "states:", "Lwrist", "Lhand"}},
     kPlan,
     2,
     "Lhand"},
    {"TruncatedContacts", {{"contacts.yaml", "states:", "<end>", ""}}, kPlan, 2, "contacts.yaml"},
    {"RecordingThatShowsNoClimb",
     {{"contacts.yaml", "reduced:", "<end>", ""},
      {"contacts.yaml", "states:", "reduced:", "reduced: []\n"}},
     kPlan,
     1,
     "shows no climb: none of its"},
    // Few candidates: with the default the search takes its time before it gives up.
    {"UnreachableHeight",
     {{"configs/planner/default.yaml", "", "most_candidates: 40", "most_candidates: 2"}},
     kPlan + " --height 0.8",
     1,
     "no plan: "},
    {"UnknownPlannerKey",
     {{"configs/planner/default.yaml", "", "swing_height", "swing_hight"}},
     kPlan,
     2,
     "search.swing_hight: unknown key"},
    {"PlannerShareAboveOne",
     {{"configs/planner/default.yaml", "", "torque_share: 0.95", "torque_share: 1.5"}},
     kPlan,
     2,
     "forces.torque_share: expected a share"},

    // Execution
    {"MissingPlan", {}, "run nothing.json", 2, "nothing.json"},
    {"PlanIsAFifo", {}, "run fifo --no-dds -o out.log", 2, "fifo: is a FIFO"},
    {"ControlSettingsAreADevice", {}, kRun + " --control /dev/zero", 2, "/dev/zero: is a device"},
    {"HalConfigIsAFifo", {}, kRun + " --hal-config fifo", 2, "fifo: is a FIFO"},
    {"PlanIsNoJson", {{"plan.json", "\"version\"", "<end>", ""}}, kRun, 2, "not a JSON file"},
    {"PlanOfALaterVersion",
     {{"plan.json", "", "\"version\": 3", "\"version\": 7"}},
     kRun,
     2,
     "version"},
    {"PlanForAnotherRobot", {}, kRun + " --ballast", 2, "made for another robot"},
    {"PlanForAnotherScenario",
     {},
     kRun + " --scenario configs/scenarios/box_0.20.yaml",
     2,
     "made for another scenario: 'box_0.275'"},
    {"PlanForAnotherHeight", {}, kRun + " --height 0.3", 2, "made for another scenario"},
    {"UnknownControlKey",
     {{"configs/control/default.yaml", "", "hold_time", "hold_tme"}},
     kRun,
     2,
     "hold_tme"},
    {"GainsOfAnUnknownJoint",
     {{"configs/robots/coman/control.yaml", "", "Waist*", "Hull*"}},
     kRun,
     2,
     "configs/robots/coman/control.yaml:5: gains[0].joints: 'Hull*' matches no joint of robot"},
    {"RobotsControlSetsMoreThanGains",
     {{"configs/robots/coman/control.yaml", "", "gains:", "rate_hz: 500\ngains:"}},
     kRun,
     2,
     "control.yaml:4: rate_hz"},
    {"NegativeRate",
     {{"configs/control/default.yaml", "", "rate_hz: 1000", "rate_hz: -1"}},
     kRun,
     2,
     "rate_hz"},
    {"BusMapWithoutBuses",
     {{"configs/hal/ode.yaml", "", "backend: ode", "backend: socketcan\n  rate: 1000"}},
     "run plan.json --no-dds",
     2,
     "configs/hal/ode.yaml:3: hal: missing key 'motors'"},
    {"BackendInsteadOfItsFile",
     {},
     "run plan.json --no-dds --hal socketcan",
     2,
     "--hal socketcan: expected a file that says which drives are where: configs/hal/coman_mit"},
    {"UncertifiedOnMotors",
     {},
     "run plan.json --uncertified --no-dds --hal configs/hal/coman_mit.yaml",
     2,
     "--uncertified: not on a motor bus"},
    {"LockStepInTheSimulation",
     {},
     "run plan.json --uncertified --no-dds --lock-step",
     2,
     "only on motor buses (--hal), not with backend ode"},
    {"FrameLogInRealTime",
     {},
     "run plan.json --no-dds --hal configs/hal/coman_mit.yaml --frame-log x.log",
     2,
     "--frame-log: needs --lock-step"},
    {"UnknownBackend",
     {{"configs/hal/ode.yaml", "", "backend: ode", "backend: ethercat"}},
     kRun,
     2,
     "expected ode or socketcan, found ethercat"},
    {"LogCannotBeWritten",
     {},
     "run plan.json --uncertified --no-dds -o /dev/null/x.log",
     2,
     "/dev/null"},

    // Monitor and report
    {"NoTelemetry", {}, "monitor --plain --timeout 0.3", 1, "no telemetry of robot 'coman'"},
    {"DomainOutOfRange", {}, "monitor --domain 300", 2, "domain 300"},
    {"NoSuchInterface", {}, "monitor --interface wan7", 2, "wan7"},
    {"ReportOfNothing", {}, "report .", 2, "summary.json"},
};

INSTANTIATE_TEST_SUITE_P(Table, BadInput, testing::ValuesIn(kCases),
                         [](const auto& test_case) { return test_case.param.name; });

TEST(CommandLine, HelpAndVersionAreFine) {
  const test::TemporaryFolder folder("help");
  const test::CommandResult version = test::clamber("--version", folder.path());
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.out, testing::StartsWith("clamber "));
  EXPECT_THAT(test::clamber("--help", folder.path()).out, HasSubstr("clamber climb"));
  for (const char* command : {"climb", "import", "playback", "contacts", "plan", "verify", "run",
                              "sweep", "monitor", "report"}) {
    const test::CommandResult help = test::clamber(std::string(command) + " --help", folder.path());
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_THAT(help.out, HasSubstr("Example")) << command;
    EXPECT_EQ(help.error, "") << command;
  }
}

}  // namespace
}  // namespace clamber
