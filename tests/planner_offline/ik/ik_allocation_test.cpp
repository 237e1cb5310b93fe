// Repeated solves of sizes seen before stay off the heap.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "planner_offline/ik/hqp.hpp"
#include "tests/planner_offline/ik/hqp_problems.hpp"

namespace {
int news = 0;
}

// Counts the containers' allocations; Eigen's own are trapped by EIGEN_RUNTIME_NO_MALLOC.
void* operator new(std::size_t size) {
  ++news;
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace clamber {
namespace {

TEST(IkAllocation, SecondQpSolveIsOffTheHeap) {
  testing::Random random(1);
  const QpProblem p = testing::feasible_qp({38, 20, 150, true}, random);
  DenseQp qp;
  ASSERT_EQ(qp.solve(p), QpStatus::optimal);
  news = 0;
  Eigen::internal::set_is_malloc_allowed(false);
  const QpStatus status = qp.solve(p);
  Eigen::internal::set_is_malloc_allowed(true);
  EXPECT_EQ(news, 0);
  EXPECT_EQ(status, QpStatus::optimal);
}

TEST(IkAllocation, SecondHierarchySolveIsOffTheHeap) {
  testing::Random random(2);
  const HqpProblem p = testing::random_hqp({14, 12, 23}, 40, 2.0, random);
  Hqp solver;
  Eigen::VectorXd x;
  ASSERT_EQ(solver.solve(p, x), HqpStatus::optimal);
  news = 0;
  Eigen::internal::set_is_malloc_allowed(false);
  const HqpStatus status = solver.solve(p, x);
  Eigen::internal::set_is_malloc_allowed(true);
  EXPECT_EQ(news, 0);
  EXPECT_EQ(status, HqpStatus::optimal);
}

}  // namespace
}  // namespace clamber
