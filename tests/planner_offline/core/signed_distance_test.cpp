// Signed distances of the primitives: FCL where they are apart, sampling where they are not.
#include "planner_offline/clearance/signed_distance.hpp"

#include <fcl/fcl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "robot_model/kinematics.hpp"

namespace clamber {
namespace {

using Eigen::Vector3d;

class Placements {
 public:
  explicit Placements(unsigned seed) : generator_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator_);
  }
  Vector3d vector(double most) {
    return {uniform(-most, most), uniform(-most, most), uniform(-most, most)};
  }
  Solid solid(Shape shape, double spread) {
    Solid s;
    s.shape = shape;
    s.X_WG.R = rotation_exp(vector(3.0));
    s.X_WG.p = vector(spread);
    s.radius = shape == Shape::kBox ? 0.0 : uniform(0.02, 0.1);
    s.length = shape == Shape::kCapsule ? uniform(0.05, 0.4) : 0.0;
    if (shape == Shape::kBox) {
      s.half_extents = {uniform(0.02, 0.3), uniform(0.02, 0.3), uniform(0.02, 0.3)};
    }
    return s;
  }

 private:
  std::mt19937 generator_;
};

fcl::CollisionObjectd to_fcl(const Solid& s) {
  std::shared_ptr<fcl::CollisionGeometryd> geometry;
  switch (s.shape) {
    case Shape::kSphere:
      geometry = std::make_shared<fcl::Sphered>(s.radius);
      break;
    case Shape::kCapsule:
      geometry = std::make_shared<fcl::Capsuled>(s.radius, s.length);
      break;
    case Shape::kBox:
      geometry = std::make_shared<fcl::Boxd>(Vector3d(2.0 * s.half_extents));
      break;
  }
  fcl::CollisionObjectd object(geometry);
  object.setTransform(s.X_WG.R, s.X_WG.p);
  return object;
}

/// FCL's distance, or nothing useful (<= 0) where the two overlap.
double fcl_distance(const Solid& a, const Solid& b) {
  const auto oa = to_fcl(a), ob = to_fcl(b);
  fcl::DistanceRequestd request;
  request.gjk_solver_type = fcl::GST_INDEP;
  request.enable_signed_distance = false;
  fcl::DistanceResultd result;
  return fcl::distance(&oa, &ob, request, result);
}

bool fcl_overlap(const Solid& a, const Solid& b) {
  const auto oa = to_fcl(a), ob = to_fcl(b);
  fcl::CollisionRequestd request;
  request.gjk_solver_type = fcl::GST_INDEP;
  fcl::CollisionResultd result;
  return fcl::collide(&oa, &ob, request, result) > 0;
}

/// Signed distance of a world point to a solid's surface, written from the shapes' definitions.
double point_distance(const Vector3d& p_W, const Solid& s) {
  const Vector3d p = s.X_WG.R.transpose() * (p_W - s.X_WG.p);
  if (s.shape == Shape::kBox) {
    const Vector3d beyond = p.cwiseAbs() - s.half_extents;
    return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
  }
  const double along = std::clamp(p.z(), -0.5 * s.length, 0.5 * s.length);
  return (p - Vector3d(0.0, 0.0, along)).norm() - s.radius;
}

/// Deepest (or nearest) point of a sphere's or capsule's axis, by trying many.
double sampled_distance(const Solid& round, const Solid& other) {
  double least = std::numeric_limits<double>::infinity();
  constexpr int kSamples = 4000;
  for (int i = 0; i <= kSamples; ++i) {
    const double z = round.length * (static_cast<double>(i) / kSamples - 0.5);
    least = std::min(least, point_distance(round.X_WG * Vector3d(0.0, 0.0, z), other));
  }
  return least - round.radius;
}

struct Pair {
  Shape a, b;
};

std::string name_of(const testing::TestParamInfo<Pair>& info) {
  const auto name = [](Shape s) {
    return std::string(s == Shape::kSphere ? "sphere" : s == Shape::kCapsule ? "capsule" : "box");
  };
  return name(info.param.a) + "_" + name(info.param.b);
}

class Apart : public testing::TestWithParam<Pair> {};

TEST_P(Apart, IsWhatFclSays) {
  Placements random(1);
  int apart = 0, equal = 0;
  for (int i = 0; i < 3000; ++i) {
    const Solid a = random.solid(GetParam().a, 0.4), b = random.solid(GetParam().b, 0.4);
    const Distance d = signed_distance(a, b);
    if (std::abs(d.value) > 1e-4) {
      EXPECT_EQ(d.value < 0.0, fcl_overlap(a, b)) << "placement " << i << " value " << d.value;
    }
    if (d.value > 1e-3) {
      ++apart;
      // FCL's solver sometimes stops early, never below the distance; ours is spanned by points of
      // both surfaces (next test), so whichever is smaller is the better one.
      const double fcl = fcl_distance(a, b);
      EXPECT_LT(d.value, fcl + 2e-5) << "placement " << i;
      equal += std::abs(d.value - fcl) <= 2e-5 ? 1 : 0;
    }
  }
  EXPECT_GT(apart, 500);
  EXPECT_GT(equal, 0.98 * apart);
}

TEST_P(Apart, WitnessesLieOnBothSurfacesAndSpanTheDistance) {
  Placements random(2);
  for (int i = 0; i < 2000; ++i) {
    const Solid a = random.solid(GetParam().a, 0.4), b = random.solid(GetParam().b, 0.4);
    const Distance d = signed_distance(a, b);
    if (d.value < 1e-6 - std::max(a.radius, b.radius)) {
      continue;  // two boxes that overlap, an axis inside a box: estimates, by the contract
    }
    EXPECT_NEAR(d.normal.norm(), 1.0, 1e-9);
    EXPECT_NEAR(point_distance(d.on_a, a), 0.0, 1e-6) << "placement " << i;
    EXPECT_NEAR(point_distance(d.on_b, b), 0.0, 1e-6) << "placement " << i;
    EXPECT_LT((d.on_a - d.on_b - d.value * d.normal).norm(), 1e-6) << "placement " << i;
  }
}

TEST_P(Apart, NormalIsTheGradient) {
  Placements random(3);
  int compared = 0;
  for (int i = 0; i < 2000; ++i) {
    const Solid a = random.solid(GetParam().a, 0.4), b = random.solid(GetParam().b, 0.4);
    const Distance d = signed_distance(a, b);
    if (d.value < 1e-3) {
      continue;
    }
    constexpr double kProbe = 1e-5;
    Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      Solid forth = a, back = a;
      forth.X_WG.p[axis] += kProbe;
      back.X_WG.p[axis] -= kProbe;
      gradient[axis] =
          (signed_distance(forth, b).value - signed_distance(back, b).value) / (2.0 * kProbe);
    }
    EXPECT_LT((gradient - d.normal).norm(), 2e-2) << "placement " << i;
    ++compared;
  }
  EXPECT_GT(compared, 300);
}

TEST_P(Apart, ChangingSidesFlipsTheResult) {
  Placements random(4);
  for (int i = 0; i < 500; ++i) {
    const Solid a = random.solid(GetParam().a, 0.5), b = random.solid(GetParam().b, 0.5);
    const Distance ab = signed_distance(a, b), ba = signed_distance(b, a);
    EXPECT_NEAR(ab.value, ba.value, 1e-9);
    if (ab.value > 1e-3) {
      EXPECT_LT((ab.normal + ba.normal).norm(), 1e-3) << "placement " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Pairs, Apart,
    testing::Values(Pair{Shape::kSphere, Shape::kSphere}, Pair{Shape::kSphere, Shape::kCapsule},
                    Pair{Shape::kSphere, Shape::kBox}, Pair{Shape::kCapsule, Shape::kCapsule},
                    Pair{Shape::kCapsule, Shape::kBox}, Pair{Shape::kBox, Shape::kCapsule},
                    Pair{Shape::kBox, Shape::kBox}),
    name_of);

class InABox : public testing::TestWithParam<Shape> {};

TEST_P(InABox, DepthIsThatOfTheDeepestPoint) {
  Placements random(5);
  int deep = 0, shallow = 0;
  for (int i = 0; i < 1500; ++i) {
    const Solid a = random.solid(GetParam(), 0.15), b = random.solid(Shape::kBox, 0.15);
    const Distance d = signed_distance(a, b);
    if (d.value >= 0.0) {
      continue;
    }
    (d.value < -a.radius ? deep : shallow) += 1;
    EXPECT_NEAR(d.value, sampled_distance(a, b), 5e-5) << "placement " << i;
  }
  EXPECT_GT(deep, 100);
  EXPECT_GT(shallow, 100);
}

TEST_P(InABox, NormalPointsTheWayOut) {
  Placements random(6);
  int compared = 0;
  for (int i = 0; i < 3000; ++i) {
    Solid a = random.solid(GetParam(), 0.3);
    const Solid b = random.solid(Shape::kBox, 0.3);
    const Distance d = signed_distance(a, b);
    // The surface is in, the axis is not: as far as a plan ever comes.
    if (d.value >= -1e-3 || d.value < -a.radius + 1e-3) {
      continue;
    }
    a.X_WG.p -= d.value * d.normal;
    EXPECT_GE(signed_distance(a, b).value, -1e-6) << "placement " << i;
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

INSTANTIATE_TEST_SUITE_P(Shapes, InABox, testing::Values(Shape::kSphere, Shape::kCapsule));

TEST(SignedDistance, ParallelCapsulesAndCentresOnAFaceAreNoSpecialCase) {
  Solid a, b;
  a.shape = b.shape = Shape::kCapsule;
  a.radius = b.radius = 0.05;
  a.length = b.length = 0.3;
  b.X_WG.p = {0.2, 0.0, 0.1};
  EXPECT_NEAR(signed_distance(a, b).value, 0.1, 1e-12);
  b.X_WG.p = {0.0, 0.0, 0.5};
  EXPECT_NEAR(signed_distance(a, b).value, 0.1, 1e-12);

  Solid box;
  box.shape = Shape::kBox;
  box.half_extents = {0.2, 0.2, 0.1};
  Solid sphere;
  sphere.radius = 0.03;
  sphere.X_WG.p = {0.05, 0.05, 0.1};
  const Distance d = signed_distance(sphere, box);
  EXPECT_NEAR(d.value, -0.03, 1e-12);
  EXPECT_NEAR(d.normal.z(), 1.0, 1e-9);
}

TEST(SignedDistance, FloorIsMetByTheLowestPoint) {
  Placements random(7);
  for (const Shape shape : {Shape::kSphere, Shape::kCapsule, Shape::kBox}) {
    for (int i = 0; i < 200; ++i) {
      const Solid s = random.solid(shape, 0.5);
      const double height = random.uniform(-0.3, 0.3);
      const Distance d = distance_to_floor(s, height);
      double lowest = std::numeric_limits<double>::infinity();
      if (shape == Shape::kBox) {
        for (int corner = 0; corner < 8; ++corner) {
          const Vector3d sign((corner & 1) ? 1 : -1, (corner & 2) ? 1 : -1, (corner & 4) ? 1 : -1);
          lowest = std::min(lowest, (s.X_WG * sign.cwiseProduct(s.half_extents)).z());
        }
      } else {
        for (const double end : {-0.5, 0.5}) {
          lowest = std::min(lowest, (s.X_WG * Vector3d(0.0, 0.0, end * s.length)).z() - s.radius);
        }
      }
      EXPECT_NEAR(d.value, lowest - height, 1e-12);
      EXPECT_NEAR(point_distance(d.on_a, s), 0.0, 1e-12);
      EXPECT_NEAR(d.on_b.z(), height, 1e-12);
      EXPECT_EQ(d.normal, Vector3d::UnitZ());
    }
  }
}

TEST(SignedDistance, AGeomIsPlacedByItsBody) {
  Geom geom;
  geom.shape = Shape::kCapsule;
  geom.radius = 0.1;
  geom.length = 0.2;
  geom.X_BG.p = {1.0, 0.0, 0.0};
  Pose X_WB;
  X_WB.R = rotation_exp({0.0, 0.0, 0.5 * 3.14159265358979323846});
  X_WB.p = {0.0, 0.0, 2.0};
  const Solid s = place(geom, X_WB);
  EXPECT_LT((s.X_WG.p - Vector3d(0.0, 1.0, 2.0)).norm(), 1e-12);
  EXPECT_EQ(s.shape, Shape::kCapsule);
  EXPECT_EQ(s.radius, 0.1);
  EXPECT_EQ(s.length, 0.2);
}

TEST(SignedDistance, LowerBoundIsNeverAboveTheDistance) {
  Placements random(17);
  const Shape shapes[] = {Shape::kSphere, Shape::kCapsule, Shape::kBox};
  for (const Shape first : shapes) {
    for (const Shape second : shapes) {
      double closest = std::numeric_limits<double>::infinity();
      for (int i = 0; i < 2000; ++i) {
        const Solid a = random.solid(first, 0.5), b = random.solid(second, 0.5);
        const double distance = signed_distance(a, b).value;
        if (distance < 0.0) {
          continue;  // deep inside, the distance itself is an estimate
        }
        ASSERT_LE(distance_at_least(a, b), distance + 1e-12);
        closest = std::min(closest, distance - distance_at_least(a, b));
      }
      EXPECT_LT(closest, 0.05) << "a bound that far off spares nothing";
    }
  }
}

}  // namespace
}  // namespace clamber
