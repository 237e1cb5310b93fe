// Contacts that are held: what counts as rolling, what as slipping.
#include "planner_offline/contacts/contact.hpp"

#include <gtest/gtest.h>

#include "tests/planner_offline/core/core_fixture.hpp"

namespace clamber {
namespace {

/// The standing robot with its left wrist declared a contact, wherever it is.
ContactSet wrist_contact(const RobotData& data) {
  return {make_contact(coman(), box(), data, link_of("Lwrist"), 0)};
}

TEST(ContactSlip, ASphereThatIsShiftedSlips) {
  Configuration x = standing();
  const RobotData before = data_at(x);
  ContactSet contacts = wrist_contact(before);
  x.X_WB.p += Eigen::Vector3d(1e-3, -2e-3, 5e-4);
  track_slip(coman(), before, data_at(x), contacts);
  EXPECT_NEAR(contacts[0].slip.x(), 1e-3, 1e-12);
  EXPECT_NEAR(contacts[0].slip.y(), -2e-3, 1e-12);
}

TEST(ContactSlip, ASphereThatTurnsAboutItsBottomRolls) {
  Configuration x = standing();
  const RobotData before = data_at(x);
  ContactSet contacts = wrist_contact(before);
  const Eigen::Vector3d bottom = touch_point(coman(), before, contacts[0].link);
  const Eigen::Matrix3d turn = rotation_exp({0.01, -0.02, 0.0});
  x.X_WB.p = bottom + turn * (x.X_WB.p - bottom);
  x.X_WB.R = turn * x.X_WB.R;
  track_slip(coman(), before, data_at(x), contacts);
  EXPECT_LT(contacts[0].slip.norm(), 1e-6);
}

TEST(ContactSlip, TheTaskTakesTheSlipBack) {
  const RobotData data = data_at(standing());
  ContactSet contacts = wrist_contact(data);
  contacts[0].slip = {3e-3, -1e-3};
  const Task task = contact_task(coman(), data, contacts[0]);
  ASSERT_EQ(task.e.size(), 3);
  EXPECT_EQ(task.e[0], -3e-3);
  EXPECT_EQ(task.e[1], 1e-3);
}

TEST(ContactSlip, ASoleHasNone) {
  Configuration x = standing();
  const RobotData before = data_at(x);
  ContactSet contacts = {make_contact(coman(), box(), before, link_of("Lfoot"), kFloor)};
  x.X_WB.p.x() += 1e-3;  // its pose is held, not its velocity
  track_slip(coman(), before, data_at(x), contacts);
  EXPECT_EQ(contacts[0].slip.norm(), 0.0);
}

}  // namespace
}  // namespace clamber
