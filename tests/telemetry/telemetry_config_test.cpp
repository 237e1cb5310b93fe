#include "telemetry/telemetry_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "robot_model/loader.hpp"
#include "telemetry/setup_text.hpp"

namespace clamber {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class TelemetryEnvironment : public testing::Test {
 protected:
  void SetUp() override { TearDown(); }
  void TearDown() override {
    for (const char* name : {"CLAMBER_DDS_DOMAIN", "ROS_DOMAIN_ID", "CLAMBER_DDS_INTERFACES",
                             "CLAMBER_DDS_SECURITY"}) {
      unsetenv(name);
    }
  }
};

TEST_F(TelemetryEnvironment, LeavesTheConfigurationAloneWhenUnset) {
  TelemetryConfig config;
  config.domain = 7;
  EXPECT_EQ(with_environment(config).domain, 7);
  EXPECT_THAT(with_environment(config).interfaces, ElementsAre("127.0.0.1"));
}

TEST_F(TelemetryEnvironment, OurDomainGoesBeforeRos) {
  setenv("ROS_DOMAIN_ID", "3", 1);
  EXPECT_EQ(with_environment({}).domain, 3);
  setenv("CLAMBER_DDS_DOMAIN", "4", 1);
  EXPECT_EQ(with_environment({}).domain, 4);
}

TEST_F(TelemetryEnvironment, NamesTheVariableThatIsWrong) {
  for (const char* text : {"", "-1", "233", "1x", "one"}) {
    setenv("CLAMBER_DDS_DOMAIN", text, 1);
    EXPECT_THAT([] { static_cast<void>(with_environment({})); },
                ThrowsMessage<InputError>(HasSubstr("CLAMBER_DDS_DOMAIN")))
        << text;
  }
  unsetenv("CLAMBER_DDS_DOMAIN");
  setenv("CLAMBER_DDS_INTERFACES", ",", 1);
  EXPECT_THAT([] { static_cast<void>(with_environment({})); },
              ThrowsMessage<InputError>(HasSubstr("CLAMBER_DDS_INTERFACES")));
}

TEST(TelemetrySetup, ComesBackFromItsText) {
  TelemetrySetup setup;
  setup.config.domain = 7;
  setup.config.interfaces = {"lo", "10.0.0.1"};
  setup.config.robot = "coman";
  setup.config.security = "/etc/clamber/publisher";
  setup.description.joint_names = {"a", "b"};
  setup.description.torque_limits = {30.0, 0.1};
  setup.description.phases = {{"State1", 3}, {"swing", 1}};
  setup.description.modes = {"boot"};
  setup.description.urdf = "<robot>\xff\n</robot>";  // not UTF-8
  setup.description.links.resize(1);
  setup.description.links[0].name = "thigh";
  setup.description.links[0].joint = 1;
  setup.description.links[0].position = {0.1, 1.0 / 3.0, -2e-17};
  const TelemetrySetup back = parse_setup(format_setup(setup));
  EXPECT_EQ(back.config.domain, 7);
  EXPECT_EQ(back.config.interfaces, setup.config.interfaces);
  EXPECT_EQ(back.config.security, setup.config.security);
  EXPECT_EQ(back.description.joint_names, setup.description.joint_names);
  EXPECT_EQ(back.description.torque_limits, setup.description.torque_limits);
  EXPECT_EQ(back.description.phases[1].name, "swing");
  EXPECT_EQ(back.description.phases[1].contacts, 1U);
  EXPECT_EQ(back.description.links[0].position, setup.description.links[0].position);
  EXPECT_EQ(back.description.links[0].joint, 1);
  EXPECT_THROW(static_cast<void>(parse_setup("{}")), InputError);
}

TEST(TelemetryInterfaces, ResolveNamesAndRefuseWhatIsNotThere) {
  TelemetryConfig config;
  config.interfaces = {"lo"};
  EXPECT_THAT(interface_addresses(config), ElementsAre("127.0.0.1"));
  for (const char* absent : {"no_such0", "203.0.113.1"}) {
    config.interfaces = {"127.0.0.1", absent};
    EXPECT_THAT([&] { static_cast<void>(interface_addresses(config)); },
                ThrowsMessage<InputError>(HasSubstr(absent)));
  }
  config.interfaces.clear();  // Fast DDS would take it for "all of them"
  EXPECT_THROW(static_cast<void>(interface_addresses(config)), InputError);
}

TEST(TelemetryDescriptionCheck, RefusesWhatAFrameCannotHold) {
  TelemetryDescription good;
  good.joint_names = {"a", "b"};
  good.torque_limits = {30.0, 30.0};
  good.contact_names = {"c"};
  EXPECT_NO_THROW(check({}, good));

  TelemetryDescription bad = good;
  bad.torque_limits.pop_back();
  EXPECT_THROW(check({}, bad), InputError);
  bad.joint_names.assign(33, "j");
  bad.torque_limits.assign(33, 1.0);
  EXPECT_THROW(check({}, bad), InputError);
  bad = good;
  bad.contact_names.assign(17, "c");
  EXPECT_THROW(check({}, bad), InputError);
  bad = good;
  bad.phases.resize(513);
  EXPECT_THROW(check({}, bad), InputError);
  bad = good;
  bad.links.push_back({});
  bad.links[0].joint = 2;
  EXPECT_THROW(check({}, bad), InputError);
  bad = good;
  bad.joint_names[0] = std::string(65, 'x');
  EXPECT_THROW(check({}, bad), InputError);

  TelemetryConfig config;
  config.robot = "co/man";
  EXPECT_THROW(check(config, good), InputError);
  config = {};
  config.domain = 233;
  EXPECT_THROW(check(config, good), InputError);
}

}  // namespace
}  // namespace clamber
