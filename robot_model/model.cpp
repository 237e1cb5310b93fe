#include "robot_model/model.hpp"

#include <algorithm>

namespace clamber {
namespace {

template <typename T>
std::optional<int> index_of(const std::vector<T>& items, std::string_view name) {
  const auto found =
      std::find_if(items.begin(), items.end(), [&](const T& item) { return item.name == name; });
  if (found == items.end()) {
    return std::nullopt;
  }
  return static_cast<int>(found - items.begin());
}

}  // namespace

std::optional<int> RobotModel::find_joint(std::string_view joint) const {
  return index_of(joints, joint);
}

std::optional<int> RobotModel::find_frame(std::string_view frame) const {
  return index_of(frames, frame);
}

std::optional<int> RobotModel::find_contact(std::string_view contact) const {
  return index_of(contacts, contact);
}

std::optional<int> RobotModel::find_geom(std::string_view geom) const {
  return index_of(geoms, geom);
}

}  // namespace clamber
