// A block lower triangular system with two blocks below the diagonal, row by row:
//   D_t x_t = r_t - B_t x_{t-1} - A_t x_{t-2}
// Blocks (rows, n, n), right sides and solution (rows, n, columns), all row by row. The same bits wherever
// the memory lies.
#pragma once

namespace exactarm {

// x: the right sides on entry, the solution on return. False where a D_t is singular.
bool block_recursion(const double* before_last, const double* last, const double* diagonal, long rows, long n,
                     long columns, double* x);

}  // namespace exactarm
