#include "telemetry/telemetry_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "robot_model/loader.hpp"

namespace clamber {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class TelemetryEnvironment : public testing::Test {
 protected:
  void SetUp() override { TearDown(); }
  void TearDown() override {
    for (const char* name : {"CLAMBER_DDS_DOMAIN", "ROS_DOMAIN_ID", "CLAMBER_DDS_INTERFACES"}) {
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
  const TelemetryDescription good{{"a", "b"}, {30.0, 30.0}, {"c"}};
  EXPECT_NO_THROW(check({}, good));

  TelemetryDescription bad = good;
  bad.torque_limits.pop_back();
  EXPECT_THROW(check({}, bad), InputError);
  bad = {std::vector<std::string>(33, "j"), std::vector<double>(33, 1.0), {}};
  EXPECT_THROW(check({}, bad), InputError);
  bad = good;
  bad.contact_names.assign(17, "c");
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
