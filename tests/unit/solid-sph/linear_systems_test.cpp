// Least-norm solutions and sparse systems: what the gradients and Newton's method stand on.
#include <gtest/gtest.h>

#include "bodies.hpp"
#include "least_norm.hpp"
#include "sparse_solver.hpp"

namespace estuary::solid {
namespace {

TEST(LeastNorm, MeetsItsConditionsWithoutAnyPartTheyDoNotSee) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    Rows conditions;
    for (unsigned r = 0; r < 3; ++r) conditions.push_back(test::random_field(11, 1, 10 * seed + r));
    for (double& v : conditions[2]) v *= 1e-6;  // of very different sizes
    const std::vector<double> target{0.3, -2, 5e-6};
    const LeastNorm least(conditions);
    EXPECT_EQ(least.rank(0), 3U);
    std::vector<double> x = least.solve(target, 0);
    for (std::size_t r = 0; r < 3; ++r)
      EXPECT_NEAR(dot(conditions[r], x), target[r],
                  1e-14 * std::sqrt(dot(conditions[r], conditions[r])) * std::sqrt(dot(x, x)));
    const double size = std::sqrt(dot(x, x));
    least.project_out(x);
    EXPECT_LT(std::sqrt(dot(x, x)), 1e-14 * size);
  }
}

TEST(LeastNorm, RepeatedConditionsCountOnce) {
  const Rows conditions{{1, 2, 0, -1}, {2, 4, 0, -2}, {0, 1, 1, 1}};
  const LeastNorm least(conditions);
  EXPECT_EQ(least.rank(1e-12 * least.largest()), 2U);
  const std::vector<double> x = least.solve(std::vector<double>{1, 2, 3}, 1e-12 * least.largest());
  EXPECT_NEAR(dot(conditions[0], x), 1, 1e-14);
  EXPECT_NEAR(dot(conditions[2], x), 3, 1e-14);
}

// A second difference in the plane, with a part that leans to one side.
SparseMatrix grid_system(int side, double lean) {
  std::vector<SparseEntry> entries;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      const int here = y * side + x;
      entries.push_back({here, here, 2.0});
      entries.push_back({here, here, 2.1});  // adds up
      if (x > 0) entries.push_back({here, here - 1, -1 - lean});
      if (x + 1 < side) entries.push_back({here, here + 1, -1 + lean});
      if (y > 0) entries.push_back({here, here - side, -1.0});
      if (y + 1 < side) entries.push_back({here, here + side, -1.0});
    }
  return assemble_sparse(static_cast<std::size_t>(side * side), entries);
}

std::vector<double> product(const SparseMatrix& a, const std::vector<double>& x) {
  std::vector<double> result(x.size(), 0.0);
  for (std::size_t c = 0; c < a.columns(); ++c)
    for (auto k = static_cast<std::size_t>(a.first[c]); k < static_cast<std::size_t>(a.first[c + 1]); ++k)
      result[static_cast<std::size_t>(a.row[k])] += a.value[k] * x[c];
  return result;
}

TEST(SparseSolver, SolvesSymmetricAndGeneralSystems) {
  for (const double lean : {0.0, 0.7}) {
    SparseMatrix a = grid_system(13, lean);
    SparseSolver solver(lean == 0 ? SparseSolver::Kind::symmetric : SparseSolver::Kind::general);
    for (const double factor : {1.0, 3.0}) {  // the second time on the same pattern
      for (double& v : a.value) v *= factor;
      ASSERT_TRUE(solver.factorise(a));
      const std::vector<double> exact = test::random_field(169, 1, 5);
      std::vector<double> x;
      ASSERT_TRUE(solver.solve(product(a, exact), x));
      for (std::size_t k = 0; k < x.size(); ++k) ASSERT_NEAR(x[k], exact[k], 1e-12);
    }
    EXPECT_EQ(solver.positive_definite(), lean == 0);
  }
}

TEST(SparseSolver, SeesIndefiniteAndSingularSystems) {
  SparseMatrix a = grid_system(5, 0);
  for (std::size_t c = 0; c < a.columns(); ++c)
    for (auto k = static_cast<std::size_t>(a.first[c]); k < static_cast<std::size_t>(a.first[c + 1]); ++k)
      if (a.row[k] == static_cast<std::int32_t>(c)) a.value[k] -= 4;
  SparseSolver solver(SparseSolver::Kind::symmetric);
  ASSERT_TRUE(solver.factorise(a));
  EXPECT_FALSE(solver.positive_definite());
  const std::vector<SparseEntry> zero{{0, 0, 1}, {1, 1, 0}, {0, 1, 0}, {1, 0, 0}};
  for (const auto kind : {SparseSolver::Kind::symmetric, SparseSolver::Kind::general}) {
    SparseSolver singular(kind);
    std::vector<double> x;
    EXPECT_FALSE(singular.factorise(assemble_sparse(2, zero)) &&
                 singular.solve(std::vector<double>{1, 1}, x));
  }
}

}  // namespace
}  // namespace estuary::solid
