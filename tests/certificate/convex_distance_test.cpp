// The verifier's distances and support polygon against others' code: FCL, and the planner's own.
#include "certificate/convex_distance.hpp"

#include <fcl/fcl.h>
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "certificate/support_polygon.hpp"
#include "planner_offline/certify/support_region.hpp"
#include "planner_offline/clearance/signed_distance.hpp"
#include "robot_model/kinematics.hpp"

namespace clamber {
namespace {

using Eigen::Vector3d;

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Vector3d vector(double most) {
    return {uniform(-most, most), uniform(-most, most), uniform(-most, most)};
  }
  Geom geom(Shape shape) {
    Geom g;
    g.shape = shape;
    g.radius = shape == Shape::kBox ? 0.0 : uniform(0.02, 0.1);
    g.length = shape == Shape::kCapsule ? uniform(0.05, 0.4) : 0.0;
    if (shape == Shape::kBox)
      g.half_extents = {uniform(0.02, 0.3), uniform(0.02, 0.3), uniform(0.02, 0.3)};
    return g;
  }
  Pose pose(double spread, bool upright) {
    Vector3d turn = vector(3.0);
    if (upright) turn.head<2>().setZero();
    return {rotation_exp(turn), vector(spread)};
  }

 private:
  std::mt19937 engine_;
};

fcl::CollisionObjectd to_fcl(const Geom& g, const Pose& X) {
  std::shared_ptr<fcl::CollisionGeometryd> shape;
  if (g.shape == Shape::kSphere) shape = std::make_shared<fcl::Sphered>(g.radius);
  if (g.shape == Shape::kCapsule) shape = std::make_shared<fcl::Capsuled>(g.radius, g.length);
  if (g.shape == Shape::kBox) shape = std::make_shared<fcl::Boxd>(Vector3d(2.0 * g.half_extents));
  return {shape, X.R, X.p};
}

double fcl_distance(const Geom& a, const Pose& X_a, const Geom& b, const Pose& X_b) {
  fcl::CollisionObjectd first = to_fcl(a, X_a), second = to_fcl(b, X_b);
  fcl::DistanceRequestd request;
  request.gjk_solver_type = fcl::GST_LIBCCD;
  request.distance_tolerance = 1e-9;
  fcl::DistanceResultd result;
  return fcl::distance(&first, &second, request, result);
}

TEST(ConvexDistance, AgreesWithFclAndWithThePlannersFormulas) {
  constexpr Shape kShapes[] = {Shape::kSphere, Shape::kCapsule, Shape::kBox};
  Random random(3);
  int apart = 0, pressed = 0;
  for (int i = 0; i < 20000; ++i) {
    const Geom a = random.geom(kShapes[i % 3]), b = random.geom(kShapes[i / 3 % 3]);
    // Every fourth pair upright: faces and edges parallel, where simplices degenerate.
    const Pose X_a = random.pose(0.5, i % 4 == 0), X_b = random.pose(0.5, i % 4 == 0);
    const double own = convex_distance(inflated_core(a, X_a), inflated_core(b, X_b));
    const double planner = signed_distance(place(a, X_a), place(b, X_b)).value;
    if (own > 1e-6) {
      ++apart;
      EXPECT_NEAR(own, planner, 1e-7) << i;
      if (i % 10 == 0) {
        EXPECT_NEAR(own, fcl_distance(a, X_a, b, X_b), 1e-5) << i;
      }
    } else if (own > -0.9 * (a.radius + b.radius)) {
      ++pressed;  // the cores are apart: exact here as well
      EXPECT_NEAR(own, planner, 1e-7) << i;
    } else {
      EXPECT_LT(planner, 1e-6) << i;
    }
  }
  EXPECT_GT(apart, 5000);
  EXPECT_GT(pressed, 300);
}

TEST(ConvexDistance, LowestHeight) {
  Random random(5);
  for (int i = 0; i < 300; ++i) {
    const Geom g = random.geom(static_cast<Shape>(i % 3));
    const Pose X = random.pose(0.5, false);
    EXPECT_NEAR(lowest_height(inflated_core(g, X)), distance_to_floor(place(g, X), 0.0).value,
                1e-12);
  }
}

TEST(SupportPolygon, AgreesWithThePlannersRegion) {
  Random random(9);
  for (int i = 0; i < 2000; ++i) {
    std::vector<Vector3d> points;
    std::vector<Eigen::Vector2d> flat;
    const int count = 3 + i % 12;
    for (int p = 0; p < count; ++p) {
      points.push_back(random.vector(0.3));
      if (i % 5 == 0) points.back() = 0.1 * (10.0 * points.back()).array().round();  // on a grid
      flat.emplace_back(points.back().head<2>());
    }
    const Eigen::Vector2d at = random.vector(0.3).head<2>();
    const SupportRegion region(points);
    const double own = SupportPolygon(flat).margin(at);
    if (region.corners().size() < 3) {
      EXPECT_TRUE(std::isinf(own)) << i;
    } else {
      EXPECT_NEAR(own, region.margin(at), 1e-9) << i;
    }
  }
}

}  // namespace
}  // namespace clamber
