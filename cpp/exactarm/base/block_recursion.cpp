#include "exactarm/base/block_recursion.hpp"

#include <Eigen/LU>

#include "exactarm/base/interrupt.hpp"
#include "exactarm/base/types.hpp"

namespace exactarm {
namespace {

constexpr long kRowsBetweenChecks = 4096;  // for a signal

}  // namespace

bool block_recursion(const double* before_last, const double* last, const double* diagonal, long rows, long n,
                     long columns, double* x) {
  if (n == 0 || columns == 0) return true;
  // Copies in memory that is aligned, so that the bits do not hang on where the caller's lies.
  Eigen::PartialPivLU<Matrix> factor(n);
  Matrix block(n, n);
  RowMatrix here(n, columns), one_before = RowMatrix::Zero(n, columns), two_before = one_before;
  const auto at = [&](const double* blocks, long t) -> const Matrix& {
    return block = Eigen::Map<const RowMatrix>(blocks + t * n * n, n, n);
  };
  for (long t = 0; t < rows; ++t) {
    if (t % kRowsBetweenChecks == 0) check_interrupt();
    Eigen::Map<RowMatrix> row(x + t * n * columns, n, columns);
    here = row;
    if (t > 1) here.noalias() -= at(before_last, t) * two_before;
    if (t > 0) here.noalias() -= at(last, t) * one_before;
    factor.compute(at(diagonal, t));
    if ((factor.matrixLU().diagonal().array() == 0.0).any()) return false;
    two_before.swap(one_before);
    one_before = factor.solve(here);
    row = one_before;
  }
  return true;
}

}  // namespace exactarm
