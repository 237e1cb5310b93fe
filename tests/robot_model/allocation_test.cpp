// Counts heap requests of the kinematics functions by replacing malloc in this program.
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/robot_model/test_robots.hpp"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define CLAMBER_COUNTS_ALLOCATIONS 0
#else
#define CLAMBER_COUNTS_ALLOCATIONS 1
#endif

namespace {
thread_local bool counting = false;
thread_local long allocations = 0;
}  // namespace

#if CLAMBER_COUNTS_ALLOCATIONS
// operator new and Eigen both end in these.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  allocations += counting ? 1 : 0;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  allocations += counting ? 1 : 0;
  return __libc_calloc(count, size);
}
void* realloc(void* old, std::size_t size) {
  allocations += counting ? 1 : 0;
  return __libc_realloc(old, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  allocations += counting ? 1 : 0;
  return __libc_memalign(alignment, size);
}
}
#endif

namespace clamber {
namespace {

long allocations_of(const auto& action) {
  allocations = 0;
  counting = true;
  action();
  counting = false;
  return allocations;
}

TEST(Allocation, TheCounterCounts) {
  if (!CLAMBER_COUNTS_ALLOCATIONS) {
    GTEST_SKIP() << "skipped: a sanitizer owns malloc";
  }
  EXPECT_GE(allocations_of([] {
              const Eigen::VectorXd dynamic = Eigen::VectorXd::Random(40);
              EXPECT_EQ(dynamic.size(), 40);
            }),
            1);
}

TEST(Allocation, KinematicsAndDynamicsNeverAllocate) {
  if (!CLAMBER_COUNTS_ALLOCATIONS) {
    GTEST_SKIP() << "skipped: a sanitizer owns malloc";
  }
  for (const char* robot : {"coman", "testbot"}) {
    const RobotModel model = load_test_robot(robot);
    const State state = StateSampler(model, 5).next();
    const int last = static_cast<int>(model.bodies.size()) - 1;
    EXPECT_EQ(allocations_of([&] {
                RobotData data;
                Jacobian3 J3;
                Jacobian6 J6;
                VelocityVector tau;
                MassMatrix M;
                Configuration next;
                forward_kinematics(model, state.x, data);
                point_jacobian(model, data, last, data.com, J3);
                com_jacobian(model, data, J3);
                frame_jacobian(model, data, last, data.com, J6);
                gravity_torque(model, data, tau);
                inverse_dynamics(model, data, state.v, state.a, tau);
                mass_matrix(model, data, M);
                integrate(model, state.x, state.v, next);
                (void)rotation_log(rotation_exp(data.com));
              }),
              0)
        << robot;
  }
}

}  // namespace
}  // namespace clamber
