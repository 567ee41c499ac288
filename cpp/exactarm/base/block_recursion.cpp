#include "exactarm/base/block_recursion.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include "exactarm/base/interrupt.hpp"

namespace exactarm {
namespace {

constexpr long kRowsBetweenChecks = 4096;  // for a signal

void subtract(double factor, const double* from, double* row, long columns) {
  for (long c = 0; c < columns; ++c) row[c] -= factor * from[c];
}

// x -= block times from.
void subtract_product(const double* block, const double* from, double* x, long n, long columns) {
  for (long i = 0; i < n; ++i)
    for (long j = 0; j < n; ++j)
      if (block[i * n + j] != 0.0) subtract(block[i * n + j], from + j * columns, x + i * columns, columns);
}

// x = D^-1 x; D is spoiled.
bool eliminate(double* d, double* x, long n, long columns) {
  for (long k = 0; k < n; ++k) {
    long pivot = k;
    for (long i = k + 1; i < n; ++i)
      if (std::abs(d[i * n + k]) > std::abs(d[pivot * n + k])) pivot = i;
    if (d[pivot * n + k] == 0.0) return false;
    if (pivot != k) {
      for (long j = k; j < n; ++j) std::swap(d[k * n + j], d[pivot * n + j]);
      for (long c = 0; c < columns; ++c) std::swap(x[k * columns + c], x[pivot * columns + c]);
    }
    for (long i = k + 1; i < n; ++i) {
      const double factor = d[i * n + k] / d[k * n + k];
      subtract(factor, d + k * n + k, d + i * n + k, n - k);
      subtract(factor, x + k * columns, x + i * columns, columns);
    }
  }
  for (long k = n - 1; k >= 0; --k) {
    double* row = x + k * columns;
    for (long j = k + 1; j < n; ++j) subtract(d[k * n + j], x + j * columns, row, columns);
    const double scale = 1.0 / d[k * n + k];
    for (long c = 0; c < columns; ++c) row[c] *= scale;
  }
  return true;
}

}  // namespace

bool block_recursion(const double* before_last, const double* last, const double* diagonal, long rows, long n,
                     long columns, double* x) {
  if (n == 0 || columns == 0) return true;
  const long block = n * n, step = n * columns;
  std::vector<double> d(block);
  for (long t = 0; t < rows; ++t) {
    if (t % kRowsBetweenChecks == 0) check_interrupt();
    double* row = x + t * step;
    if (t > 1) subtract_product(before_last + t * block, row - 2 * step, row, n, columns);
    if (t > 0) subtract_product(last + t * block, row - step, row, n, columns);
    d.assign(diagonal + t * block, diagonal + (t + 1) * block);
    if (!eliminate(d.data(), row, n, columns)) return false;
  }
  return true;
}

}  // namespace exactarm
