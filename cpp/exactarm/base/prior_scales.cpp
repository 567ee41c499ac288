#include "exactarm/base/prior_scales.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "exactarm/base/interrupt.hpp"

namespace exactarm {
namespace {

constexpr double kWorkBetweenChecks = 1e7;  // for a signal: multiplications
constexpr double kMostProduct = 1e150;      // of pivots, before its logarithm is taken

double dot(const double* one, const double* other, long n) {
  double sum = 0.0;
  for (long i = 0; i < n; ++i) sum += one[i] * other[i];
  return sum;
}

struct Scratch {
  explicit Scratch(long k) : a(k * k), y(k), beside(k), v(k), w(k) {}
  std::vector<double> a, y, beside, v, w;
};

// Q'AQ with three diagonals, in the diagonal of a and in beside, and Q'y.
void to_three_diagonals(Scratch& s, long k) {
  for (long j = 0; j + 1 < k; ++j) {
    const long first = j + 1, n = k - first;
    double* v = s.v.data();
    for (long i = 0; i < n; ++i) v[i] = s.a[(first + i) * k + j];
    const double below = dot(v + 1, v + 1, n - 1);
    s.beside[j] = v[0];
    if (!(below > 0.0)) continue;
    const double length = std::sqrt(v[0] * v[0] + below), end = v[0] > 0.0 ? -length : length;
    s.beside[j] = end;
    v[0] -= end;
    const double beta = 2.0 / (v[0] * v[0] + below);
    double *w = s.w.data(), *y = s.y.data() + first;
    std::fill(w, w + n, 0.0);
    for (long i = 0; i < n; ++i) {
      const double* row = s.a.data() + (first + i) * k + first;
      for (long c = 0; c < n; ++c) w[c] += v[i] * row[c];
    }
    const double half = 0.5 * beta * dot(w, v, n), turn = beta * dot(v, y, n);
    for (long i = 0; i < n; ++i) w[i] = beta * (w[i] - half * v[i]);
    for (long i = 0; i < n; ++i) y[i] -= turn * v[i];
    for (long i = 0; i < n; ++i) {
      double* row = s.a.data() + (first + i) * k + first;
      for (long c = 0; c < n; ++c) row[c] -= v[i] * w[c] + w[i] * v[c];
    }
  }
}

}  // namespace

void gains_by_scale(const double* gram, const double* y, long blocks, long k, const double* squares,
                    long scales, double* gains, double* prices) {
  Scratch s(k);
  double work = 0.0;
  for (long block = 0; block < blocks; ++block) {
    if (work > kWorkBetweenChecks) check_interrupt(), work = 0.0;
    work += 1.0 + 2.0 * k * k * k;
    std::copy(gram + block * k * k, gram + (block + 1) * k * k, s.a.begin());
    std::copy(y + block * k, y + (block + 1) * k, s.y.begin());
    to_three_diagonals(s, k);
    for (long scale = 0; scale < scales; ++scale) {
      const double square = squares[scale];
      double gain = 0.0, price = 0.0, product = 1.0, before = 1.0, onto = 0.0;
      for (long i = 0; i < k; ++i) {
        const double beside = i ? square * s.beside[i - 1] : 0.0, factor = beside / before;
        const double pivot = std::max(1.0 + square * s.a[i * k + i] - factor * beside, 1.0);
        onto = s.y[i] - factor * onto;
        gain += onto * onto / pivot;
        product *= pivot;
        if (product > kMostProduct) price += std::log(product), product = 1.0;
        before = pivot;
      }
      gains[scale * blocks + block] = square * gain;
      prices[scale * blocks + block] = 0.5 * (price + std::log(product));
    }
  }
}

}  // namespace exactarm
