#include "exactarm/base/block_recursion.hpp"

#include <gtest/gtest.h>

#include "random_states.hpp"

namespace exactarm {
namespace {

constexpr long kRows = 9, kAxes = 3, kColumns = 5;

TEST(BlockRecursion, SolvesTheWholeSystem) {
  testing::Random random(91);
  const auto blocks = [&] { return random.matrix(kRows * kAxes, kAxes); };
  const RowMatrix before_last = blocks(), last = blocks(), diagonal = blocks();
  RowMatrix whole = RowMatrix::Zero(kRows * kAxes, kRows * kAxes);
  for (long t = 0; t < kRows; ++t) {
    const auto rows = [&](const RowMatrix& all) { return all.middleRows(t * kAxes, kAxes); };
    whole.block(t * kAxes, t * kAxes, kAxes, kAxes) = rows(diagonal);
    if (t > 0) whole.block(t * kAxes, (t - 1) * kAxes, kAxes, kAxes) = rows(last);
    if (t > 1) whole.block(t * kAxes, (t - 2) * kAxes, kAxes, kAxes) = rows(before_last);
  }
  const RowMatrix right = random.matrix(kRows * kAxes, kColumns);
  RowMatrix x = right;
  ASSERT_TRUE(
      block_recursion(before_last.data(), last.data(), diagonal.data(), kRows, kAxes, kColumns, x.data()));
  EXPECT_LT((whole * x - right).norm(), 1e-12 * whole.norm() * x.norm());
}

TEST(BlockRecursion, ExchangesRowsWhereTheFirstPivotIsNothing) {
  const double nothing[8] = {}, diagonal[8] = {0.0, 2.0, 4.0, 0.0, 0.0, 1.0, 1.0, 0.0};
  double x[4] = {6.0, 8.0, 3.0, 5.0};
  ASSERT_TRUE(block_recursion(nothing, nothing, diagonal, 2, 2, 1, x));
  EXPECT_EQ(std::vector<double>(x, x + 4), (std::vector<double>{2.0, 3.0, 5.0, 3.0}));
}

TEST(BlockRecursion, SaysWhereABlockIsSingular) {
  const double nothing[8] = {}, diagonal[8] = {1.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 4.0};
  double x[4] = {1.0, 1.0, 1.0, 1.0};
  EXPECT_FALSE(block_recursion(nothing, nothing, diagonal, 2, 2, 1, x));
}

}  // namespace
}  // namespace exactarm
