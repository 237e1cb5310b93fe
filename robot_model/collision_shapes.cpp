#include "robot_model/collision_shapes.hpp"

#include <algorithm>
#include <cmath>

#include "robot_model/loader.hpp"
#include "robot_model/urdf_pose.hpp"

namespace clamber {
namespace {

// Files round to a micrometre or better; wider gaps are a different solid.
constexpr double kSameLength = 1e-6;

// One collision element before capsules are recognised: as a Geom, a cylinder is still marked by
// is_cylinder and a sphere may be taken as a capsule's cap.
struct Element {
  Geom geom;
  bool is_cylinder = false;
  bool is_cap = false;
};

double checked_size(double size, const char* what, const Geom& geom, const std::string& file) {
  if (!(size > 0.0) || !std::isfinite(size)) {
    throw InputError(file + ": link '" + geom.link + "': collision '" + geom.name + "': " + what +
                     " must be > 0");
  }
  return size;
}

Element read_element(const urdf::Link& link, std::size_t index, const std::string& file) {
  const urdf::Collision& collision = *link.collision_array[index];
  Element element;
  Geom& geom = element.geom;
  geom.link = link.name;
  geom.name = collision.name.empty() ? link.name + "/" + std::to_string(index) : collision.name;
  geom.X_BG = from_urdf(collision.origin);
  if (!collision.geometry) {
    throw InputError(file + ": link '" + link.name + "': collision '" + geom.name +
                     "' has no geometry");
  }
  switch (collision.geometry->type) {
    case urdf::Geometry::SPHERE: {
      const auto& sphere = dynamic_cast<const urdf::Sphere&>(*collision.geometry);
      geom.shape = Shape::kSphere;
      geom.radius = checked_size(sphere.radius, "radius", geom, file);
      break;
    }
    case urdf::Geometry::CYLINDER: {
      const auto& cylinder = dynamic_cast<const urdf::Cylinder&>(*collision.geometry);
      geom.shape = Shape::kCapsule;
      geom.radius = checked_size(cylinder.radius, "radius", geom, file);
      geom.length = checked_size(cylinder.length, "length", geom, file);
      element.is_cylinder = true;
      break;
    }
    case urdf::Geometry::BOX: {
      const auto& box = dynamic_cast<const urdf::Box&>(*collision.geometry);
      geom.shape = Shape::kBox;
      geom.half_extents = 0.5 * from_urdf(box.dim);
      checked_size(geom.half_extents.minCoeff(), "every box size", geom, file);
      break;
    }
    default:
      throw InputError(file + ": link '" + link.name + "': collision '" + geom.name +
                       "' is a mesh: expected primitives (box, sphere, capsule)");
  }
  return element;
}

bool is_cap_of(const Element& candidate, const Geom& capsule, const Eigen::Vector3d& end) {
  return !candidate.is_cap && candidate.geom.shape == Shape::kSphere &&
         std::abs(candidate.geom.radius - capsule.radius) < kSameLength &&
         (candidate.geom.X_BG.p - end).norm() < kSameLength;
}

void claim_caps(const Geom& capsule, std::vector<Element>& elements, const std::string& file) {
  for (const double side : {-0.5, 0.5}) {
    const Eigen::Vector3d end = capsule.X_BG * Eigen::Vector3d(0.0, 0.0, side * capsule.length);
    const auto cap = std::find_if(elements.begin(), elements.end(), [&](const Element& candidate) {
      return is_cap_of(candidate, capsule, end);
    });
    if (cap == elements.end()) {
      throw InputError(file + ": link '" + capsule.link + "': collision '" + capsule.name +
                       "' is a bare cylinder: expected a sphere of its radius at each end "
                       "(together they are a capsule)");
    }
    cap->is_cap = true;
  }
}

}  // namespace

std::vector<Geom> collision_shapes(const urdf::Link& link, const std::string& file) {
  std::vector<Element> elements;
  for (std::size_t i = 0; i < link.collision_array.size(); ++i) {
    elements.push_back(read_element(link, i, file));
  }
  for (const Element& element : elements) {
    if (element.is_cylinder) {
      claim_caps(element.geom, elements, file);
    }
  }
  std::vector<Geom> geoms;
  for (const Element& element : elements) {
    if (!element.is_cap) {
      geoms.push_back(element.geom);
    }
  }
  return geoms;
}

}  // namespace clamber
