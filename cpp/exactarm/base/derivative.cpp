#include "exactarm/base/derivative.hpp"

#include <algorithm>

#include "exactarm/base/check.hpp"
#include "exactarm/base/interrupt.hpp"

namespace exactarm {
namespace {

constexpr int kHalf = 4;
constexpr long kRowsBetweenChecks = 65536;  // for a signal
// Coefficients of x[k + j] - x[k - j], j = 1 .. half, on a unit grid (Fornberg 1988).
constexpr double kStencils[kHalf][kHalf] = {
    {1.0 / 2.0, 0.0, 0.0, 0.0},
    {2.0 / 3.0, -1.0 / 12.0, 0.0, 0.0},
    {3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0, 0.0},
    {4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0},
};

// Weights and offsets of one row of a block of `count` rows; returns how many.
int stencil(long k, long count, double* weights, long* offsets) {
  const long half = std::min({k, count - 1 - k, static_cast<long>(kHalf)});
  if (half > 0) {
    for (int j = 0; j < half; ++j) {
      weights[2 * j] = kStencils[half - 1][j];
      weights[2 * j + 1] = -weights[2 * j];
      offsets[2 * j] = j + 1;
      offsets[2 * j + 1] = -(j + 1);
    }
    return static_cast<int>(2 * half);
  }
  const long inward = k == 0 ? 1 : -1;
  const double two[] = {-1.0, 1.0}, three[] = {-1.5, 2.0, -0.5};
  const int terms = count > 2 ? 3 : static_cast<int>(count);
  if (terms == 1) return 0;
  for (int j = 0; j < terms; ++j) {
    weights[j] = inward * (terms == 3 ? three[j] : two[j]);
    offsets[j] = inward * j;
  }
  return terms;
}

}  // namespace

void derivative(const double* values, const double* time, long rows, long columns,
                const std::vector<long>& starts, double* out) {
  if (rows && (starts.empty() || starts.front() != 0))
    throw InvalidArgument("starts: expected blocks from row 0 on");
  for (size_t b = 0; b < starts.size(); ++b) {
    const long start = starts[b], end = b + 1 < starts.size() ? starts[b + 1] : rows;
    if (end < start || end > rows) throw InvalidArgument("starts: expected rising rows within the samples");
    for (long k = start; k < end; ++k) {
      if (k % kRowsBetweenChecks == 0) check_interrupt();
      double weights[2 * kHalf], step = 0.0;
      long offsets[2 * kHalf];
      const int terms = stencil(k - start, end - start, weights, offsets);
      for (int j = 0; j < terms; ++j) step += weights[j] * time[k + offsets[j]];
      double* row = out + k * columns;
      std::fill(row, row + columns, 0.0);
      for (int j = 0; j < terms; ++j) {
        const double weight = weights[j] / step;
        const double* from = values + (k + offsets[j]) * columns;
        for (long c = 0; c < columns; ++c) row[c] += weight * from[c];
      }
    }
  }
}

}  // namespace exactarm
